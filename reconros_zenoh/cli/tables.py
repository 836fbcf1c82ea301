"""`reconros experiment callbacks` and `reconfiguration`: Tables I and II of the paper."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from reconros_zenoh.cli.console import interrupted, new_table, wide_console
from reconros_zenoh.cli.options import AsJson, ClockName, Profile
from reconros_zenoh.cli.progress import run_bar
from reconros_zenoh.mapping.graph import Side
from reconros_zenoh.measure.statistics import format_error, format_ms, format_part, format_share

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rich.console import Console

Clock = Annotated[ClockName, typer.Option(help="Real time on this host, or virtual time.")]

_MARKS = {"published": "", "calibrated": "c", "assumed": "a"}


def callbacks(
    clock: Clock = ClockName.VIRTUAL,
    repeat: Annotated[int, typer.Option(min=1, help="Requests per callback and place.")] = 10,
    profile: Profile = "miniitx-zynq7100",
    accuracy: Annotated[
        Path | None,
        typer.Option(metavar="DIGITS.npz", help="Also classify these digits (images, labels) with MNIST."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Table I: the time of each callback alone.

    In hardware and in software, beside the paper's. In wall time the real times and those of this host's own
    kernels stand beside it.
    """
    from reconros_zenoh.board.profile import read_profile
    from reconros_zenoh.experiments.callbacks import TABLE_I, measure_callbacks

    digits = _classified(accuracy) if accuracy else {}
    model = read_profile(profile)
    with run_bar("callbacks alone", len(TABLE_I) * len(Side), quiet=as_json) as advance:
        result = measure_callbacks(clock.value, model, repeat, advance) | digits
    if as_json:
        print(json.dumps(result))
    else:
        _show_callbacks(result)
    if result["interrupted"]:
        raise interrupted(quiet=as_json, measured=bool(result["callbacks"]))


def reconfiguration(
    clock: Clock = ClockName.VIRTUAL,
    writes: Annotated[int, typer.Option(min=1, help="Writes per slot.")] = 100,
    profile: Profile = "miniitx-zynq7100",
    region: Annotated[
        list[str] | None,
        typer.Option(
            metavar='"SITE_XaYb:SITE_XcYd, ..."',
            help="Regions of a slot to estimate, as in build.cfg; may be repeated.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Table II: reconfiguration times of the slots.

    Resources, bitstream sizes and times, beside the paper's.
    """
    from reconros_zenoh.board.profile import read_profile
    from reconros_zenoh.experiments.reconfiguration import TABLE_II, measure_reconfiguration

    model = read_profile(profile)
    with run_bar("slots reconfigured", len(TABLE_II), quiet=as_json) as advance:
        result = measure_reconfiguration(clock.value, model, writes, region or [], advance)
    if as_json:
        print(json.dumps(result))
    else:
        console = wide_console()
        _print_slots(console, result)
        _print_regression(console, result)
        _print_what_if(console, result)
    if result["interrupted"]:
        raise interrupted(quiet=as_json, measured=bool(result["slots"]))


def _classified(path: Path) -> dict[str, float | int]:
    """Return how many digits the file holds and the share of them that is classified as labelled."""
    from reconros_zenoh.applications.roundtrip.kernels import mnist  # loads OpenCV

    images, labels = mnist.load_digits(path)
    return {"digits": len(labels), "accuracy": mnist.accuracy(images, labels)}


def _show_callbacks(result: Mapping[str, Any]) -> None:
    console = wide_console()
    _print_callbacks(console, result)
    if result["clock"] == "wall":
        _print_host(console, result)
    if "digits" in result:
        console.print(f"MNIST: {result['accuracy']:.2%} of {result['digits']} digits classified as labelled")


def _print_callbacks(console: Console, result: Mapping[str, Any]) -> None:
    figures = ["HW", "comp.", "MEMIF", "calls", "paper", "dev.", "SW", "paper", "dev.", "SW/HW", "paper"]
    title = f"Table I, {result['clock']} clock, profile {result['profile']}"
    table = new_table(("",), figures, title=title)
    for name, row in result["callbacks"].items():
        split = row["hardware"]
        table.add_row(
            name,
            _marked(row["hardware_ms"], row["basis_hardware"]),
            *(format_part(split[part]) for part in ("compute_ms", "memif_ms", "calls_ms")),
            format_ms(row["paper_hardware_ms"]),
            format_error(row["hardware_deviation"]),
            _marked(row["software_ms"], row["basis_software"]),
            format_ms(row["paper_software_ms"]),
            format_error(row["software_deviation"]),
            f"{row['speedup']:.1f}" if row["speedup"] is not None else "-",
            f"{row['paper_speedup']:.1f}",
        )
    console.print(table)
    _note(
        console,
        "Times in ms. HW: from start to completion, without reconfiguration = compute + MEMIF + calls. "
        "c: the profile's time is calibrated to round trips rather than Table I's, a: assumed, no mark: "
        f"published. MEMIF bandwidth is {result['basis_memif']}, the time of a call {result['basis_calls']}.",
    )


def _print_host(console: Console, result: Mapping[str, Any]) -> None:
    figures = ("HW elapsed", "SW elapsed", "kernel", "affords HW", "affords SW")
    title = f"This host ({result['host']['machine']}), medians over {result['repeat']} requests"
    table = new_table(("callback",), figures, title=title)
    for name, row in result["callbacks"].items():
        table.add_row(
            name,
            *(
                format_ms(row[key])
                for key in ("elapsed_hardware_ms", "elapsed_software_ms", "host_kernel_ms")
            ),
            *(
                Text("yes" if row[key] else "no", style="" if row[key] else "red")
                for key in ("host_affords_hardware", "host_affords_software")
            ),
        )
    console.print(table)
    _note(
        console,
        "elapsed: from start to completion on this host's clock; less than the modelled time where the start "
        "was late, because lateness does not add up. kernel: what this host computes, transport and encoding "
        "aside. affords: the kernel is no slower than the modelled computation. Results later than modelled: "
        f"{result['host']['overruns']}.",
    )


def _print_slots(console: Console, result: Mapping[str, Any]) -> None:
    figures = ("LUT", "DSP", "BRAM 36/18", "S [B]", "paper", "t_rc", "min", "max", "paper", "dev.")
    run = f"{result['clock']} clock, profile {result['profile']}, {result['writes']} writes per slot"
    table = new_table(("slot",), figures, title=f"Table II, {run}")
    for slot, row in result["slots"].items():
        table.add_row(
            f"RS{slot}",
            str(row["lut"]),
            str(row["dsp"]),
            f"{row['bram36']}/{row['bram18']}",
            str(row["size_bytes"]),
            str(row["paper_size_bytes"]),
            *(format_ms(row[key]) for key in ("mean_ms", "min_ms", "max_ms", "paper_ms")),
            format_error(row["deviation"]),
        )
    console.print(table)
    _note(
        console,
        "Times in ms. LUT, DSP and BRAM are counted from the regions of build.cfg. The paper prints the BRAM "
        "columns of RS2 and RS3 swapped (240/120, 200/100).",
    )


def _print_regression(console: Console, result: Mapping[str, Any]) -> None:
    paper = result["paper"]
    ours = paper["regression_of_table"]
    slots = [f"RS{slot}" for slot, _ in enumerate(ours["residuals_ms"])]
    title = "t_rc = S / B + t_offset, with the residuals [ms] of each slot"
    table = new_table(("",), ("t_offset [ms]", "B [MB/s]", *slots), title=title)
    for name, values in (
        ("measured here", result["regression"]),
        ("printed t_rc, our regression", ours),
        ("printed t_offset and B", paper),
    ):
        if values is not None:
            bandwidth = values["bandwidth_mb_s"]
            table.add_row(
                name,
                f"{values['t_offset_ms']:.2f}",
                "-" if bandwidth is None else f"{bandwidth:.1f}",
                *(f"{round(residual, 2) + 0:+.2f}" for residual in values["residuals_ms"]),
            )
    console.print(table)
    _note(
        console,
        "Residuals: t_rc less the line. The regression of the four printed times gives "
        f"{ours['t_offset_ms']:.2f} ms and {ours['bandwidth_mb_s']:.1f} MB/s "
        f"({ours['bandwidth_mb_s'] * 1e6 / 2**20:.1f} MiB/s), not quite the printed "
        f"{paper['t_offset_ms']} ms and about {paper['bandwidth_mb_s']:.0f} MByte/s: with those every "
        "printed time lies below the line.",
    )


def _print_what_if(console: Console, result: Mapping[str, Any]) -> None:
    figures = ("S [B]", "now", "ZyCAP nominal", "PCAP", "zero-copy")
    table = new_table(("slot",), figures, title="What if: t_rc [ms]")
    rows: Iterable[tuple[str, Mapping[str, Any], float]] = [
        *((f"RS{slot}", row, row["mean_ms"]) for slot, row in result["slots"].items()),
        *((row["region"], row, row["t_rc_ms"]) for row in result["regions"]),
    ]
    for name, row, now_ms in rows:
        times = row["what_if_ms"]
        table.add_row(
            Text(name),
            str(row["size_bytes"]),
            *(
                format_ms(value)
                for value in (now_ms, times["zycap_nominal"], times["pcap"], times["zero_copy"])
            ),
        )
    console.print(table)
    labels = ("ZyCAP nominal", "PCAP", "zero-copy")
    _note(
        console,
        " ".join(f"{label}: {text}." for label, text in zip(labels, result["what_if"].values(), strict=True)),
    )
    for row in result["regions"]:
        console.print(
            Text(
                f"{row['region']}: {row['lut']} LUT, {row['dsp']} DSP, {row['bram36']} RAMB36; "
                f"{row['size_bytes']} B, {'a slot of the profile' if row['known'] else 'estimated'}."
            )
        )
    fit = result["bitstream_fit"]
    left_out = ", ".join(map(format_error, fit["left_out_errors"])) or "-"
    _note(
        console,
        f"Estimated size: {fit['constant_bytes']:.0f} B + {fit['bytes_per_frame']:.1f} B per configuration "
        f"frame, fitted to the {fit['points']} different slots of the profile: at most "
        f"{format_share(fit['largest_error'])} off on these; each estimated from the others: {left_out}. "
        "Far from their sizes, or on a family other than the 7 series, take it as a guess.",
    )


def _marked(value_ms: float, basis: str) -> str:
    return format_ms(value_ms) + _MARKS[basis]


def _note(console: Console, text: str) -> None:
    console.print(text, style="dim", highlight=False)
