"""`reconros experiment gateway`: Section 4 of the gateways paper."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from reconros_zenoh.cli.console import interrupted, new_table, wide_console
from reconros_zenoh.cli.options import AsJson, ClockName, Out, Profile
from reconros_zenoh.cli.progress import run_bar
from reconros_zenoh.errors import UsageError
from reconros_zenoh.experiments.provenance import own_folder, writing
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.measure.findings import host_troubles

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

    from reconros_zenoh.experiments.roundtrip import Clock

_LARGEST_BYTES = 1_000_000_000
"""Every subscriber has a copy of its own."""
_RESULT = "gateway.json"
_FIGURES = {"hardware": "fig6_hardware_publisher.png", "software": "fig7_software_publisher.png"}


def gateway(
    publisher: Annotated[
        Side | None, typer.Option(help="Where the publisher runs.", show_default="both")
    ] = None,
    clock: Annotated[
        ClockName | None, typer.Option(help="Real time, or virtual time.", show_default="virtual")
    ] = None,
    sizes: Annotated[str, typer.Option(metavar="LIST", help="Message sizes.")] = "10kB,100kB,1MB,10MB",
    subscribers: Annotated[str, typer.Option(metavar="LIST", help="Subscribers in hardware.")] = "2,4,8",
    repeat: Annotated[int, typer.Option(min=1, help="Messages per cell.")] = 500,
    profile: Profile = "zcu104",
    out: Out = Path("results/gateway"),
    as_json: AsJson = False,
) -> None:
    """Section 4 of the gateways paper: what a gateway is worth.

    One publisher, 2 to 8 subscribers in hardware and one in software, on an SMT and with a gateway. Every
    subscriber checks number and CRC of what it got. The profile native models nothing: real bytes between
    real processes, publisher and subscriber in software.
    """
    from reconros_zenoh.board.profile import read_profile
    from reconros_zenoh.experiments.gateway import check_profile, measure_gateway
    from reconros_zenoh.experiments.gateway_native import measure_native

    byte_counts, counts = _sizes(sizes), _counts(subscribers)
    board = read_profile(profile)
    time: Clock = "wall" if clock is ClockName.WALL else "virtual"
    publishers = list(Side) if publisher is None else [publisher]
    if board.model is None:
        if clock is ClockName.VIRTUAL or publisher is Side.HARDWARE:
            raise UsageError("profile native runs in real time, with the publisher in software.")
        publishers = [Side.SOFTWARE]
    else:
        check_profile(board, publishers, counts)
    with own_folder(out):
        _prepare(out)
        with run_bar("cells", len(publishers) * len(byte_counts) * len(counts), quiet=as_json) as advance:
            if board.model is None:
                result = measure_native(byte_counts, counts, repeat, advance)
            else:
                result = measure_gateway(time, board, publishers, byte_counts, counts, repeat, advance)
        paths = _write(out, result)
    if as_json:
        print(json.dumps(result))
    else:
        _print(wide_console(), result)
        print(f"{_RESULT} is in {out}")
        for path in paths:
            print(f"drawn to {path}")
    if result["interrupted"]:
        raise interrupted(quiet=as_json, measured=bool(result["cells"]))


def _prepare(out: Path) -> None:
    """Remove what an earlier run left, before anything is measured."""
    with writing(out):
        for name in (_RESULT, *_FIGURES.values()):
            (out / name).unlink(missing_ok=True)


def _write(out: Path, result: dict[str, Any]) -> list[Path]:
    from reconros_zenoh.measure.gateway_plots import transmission_figure
    from reconros_zenoh.measure.plots import write_figure

    (out / _RESULT).write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    paths = []
    for publisher in dict.fromkeys(cell["publisher"] for cell in result["cells"]):
        paths.append(out / _FIGURES[publisher])
        write_figure(transmission_figure(result, publisher), paths[-1])
    return paths


def _print(console: Console, result: dict[str, Any]) -> None:
    for publisher in dict.fromkeys(cell["publisher"] for cell in result["cells"]):
        table = new_table(title=f"from {publisher}: ms to the slowest subscriber in HW, and in SW", padding=1)
        for column in ("kB", "subscribers", *_to("HW"), *_to("SW")):
            table.add_column(column, justify="right", vertical="bottom", no_wrap=True)
        for cell in result["cells"]:
            if cell["publisher"] == publisher:
                table.add_row(
                    f"{cell['size'] / 1000:g}",
                    str(cell["subscribers"]),
                    *_three(cell, "hw_max_ms", "speedup_hw"),
                    *_three(cell, "sw_ms", "speedup_sw"),
                )
        console.print(table)
        console.print()
    for anchor in result["anchors"]:
        console.print(
            f"{anchor['name']}: speedup {anchor['ours']:.2f}, paper {anchor['paper']:g} "
            f"({anchor['error']:+.1%})"
        )
    lost = sum(cell[variant]["lost"] for cell in result["cells"] for variant in ("smt", "gateway"))
    if lost:
        console.print(f"{lost} messages were lost to somebody and are not in the times")
    for trouble in host_troubles(result["host"]):
        console.print(Text(f"host: {trouble}", style="yellow"))
    for line in result.get("copies", ()):
        console.print(line)


def _to(side: str) -> Iterable[str]:
    return f"to {side}\nSMT", "gateway", "speedup"


def _three(cell: dict[str, Any], time: str, speedup: str) -> Iterable[str]:
    return f"{cell['smt'][time]:.3f}", f"{cell['gateway'][time]:.3f}", f"{cell[speedup]:.2f}"


def _sizes(text: str) -> list[int]:
    """Return the bytes of `10kB,1MB`."""
    units = {"kB": 1000, "MB": 1_000_000, "B": 1}
    sizes = []
    for word in text.split(","):
        unit = next((unit for unit in units if word.strip().endswith(unit)), "")
        number = word.strip().removesuffix(unit)
        size = int(number) * units[unit] if unit and number.isascii() and number.isdigit() else 0
        if not 1 <= size <= _LARGEST_BYTES:
            raise UsageError(
                f"{word!r} is no message size. Write whole numbers of B, kB or MB up to 1000MB, as in "
                "--sizes 10kB,1MB."
            )
        sizes.append(size)
    return sizes


def _counts(text: str) -> list[int]:
    from reconros_zenoh.applications.gateway.nodes import SUBSCRIBERS

    words = [word.strip() for word in text.split(",")]
    if not all(word.isascii() and word.isdigit() and 1 <= int(word) <= SUBSCRIBERS for word in words):
        raise UsageError(f"{text!r} are no numbers of subscribers from 1 to {SUBSCRIBERS}, such as 2,4,8.")
    return [int(word) for word in words]
