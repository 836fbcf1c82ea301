"""The report of the design example: one HTML file that needs nothing else."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING, Any

from reconros_zenoh.measure.findings import host_troubles
from reconros_zenoh.measure.markup import figure, table, write_page
from reconros_zenoh.measure.plots import inline_svg, spans_figure
from reconros_zenoh.measure.statistics import format_ms

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

_TITLE = "One slot for two callbacks: the design example"
_NAMES = {"one_slot": "one slot", "two_slots": "two slots"}
FIGURES = {
    "reconfigurations": "reconfigurations",
    "reconfiguration_ms": "time in them",
    "frames_in": "pictures taken",
    "frames_out": "pictures filtered",
    "control_out": "servo indices",
    "wrong": "wrong",
}
"""What the figures of a variant are called; those that end in `_ms` are times in ms, the others counts."""

Picture = tuple[str, bytes]
"""What a picture shows, and the bytes of its PNG file."""


def write_design_report(
    path: Path, experiment: Mapping[str, Any], pictures: Mapping[str, Sequence[Picture]]
) -> None:
    """Write one self-contained HTML file about the experiment, an object of `experiments.design.finish`.

    `pictures` has those of each variant. Raises UsageError if the file cannot be written.
    """
    variants = experiment["variants"]
    parts = [_introduction(experiment), "<h2>In short</h2>", _summary(experiment)]
    if experiment["interrupted"]:
        parts.append('<p class="warning">The run was interrupted: its last variant ended early.</p>')
    for name, variant in variants.items():
        if troubles := host_troubles(variant["host"]):
            text = f"{_NAMES[name]}: {' '.join(troubles)}"
            parts.append(f'<p class="warning">{escape(text)}</p>')
    parts += ["<h2>Both variants</h2>", _table(variants), "<h2>The slots</h2>", _slots(variants)]
    spans = {_NAMES[name]: variant["spans_ms"] for name, variant in variants.items()}
    if any(spans.values()):
        parts += [
            "<h2>Where the time goes</h2>",
            figure(
                inline_svg(spans_figure(spans)),
                "Mean time per stage, callback and variant",
                "The mean time of each stage on a message's way through the board, for the messages that "
                "came out of it. The stages are stacked; the number at the end is their sum.",
            ),
        ]
    parts.append("<h2>What went in, what came out</h2>")
    for name, shown in pictures.items():
        parts += [f"<h3>{_NAMES[name]}</h3>", "".join(map(_picture, shown))]
    shown_keys = ("command", "profile", "clock", "seconds", "seed", "date", "machine")
    parts += [
        "<h2>How it was made</h2>",
        table(["what", "value"], [[key, str(experiment[key])] for key in shown_keys]),
    ]
    write_page(path, _TITLE, parts)


def format_figure(key: str, value: float | None) -> str:
    """Return a value of FIGURES as it is shown, `-` for None."""
    if key.endswith("_ms"):
        return format_ms(value)
    return "-" if value is None else str(value)


def _introduction(experiment: Mapping[str, Any]) -> str:
    text = (
        "The application of ReconROS Executor, Section IV. A camera on the desktop publishes a moving test "
        "picture; the node /filter finds its edges, and a viewer shows them. Beside it runs a control loop: "
        "/pid_ctrl commands an angle, /inv_kinematics turns it into a servo index, /actor_driver moves the "
        "servo and measures. /filter and /inv_kinematics run in hardware on one board that has no software "
        "workers; in the paper they share one reconfigurable slot, which has to be loaded with the other's "
        "bitstream whenever they alternate. Here the same is also run with a slot for each. "
    )
    text += (
        "Time is virtual: the same seed gives the same figures."
        if experiment["clock"] == "virtual"
        else "Boards, camera and viewer were processes that talked over a network in real time."
    )
    return f"<p>{escape(text)}</p>"


def _summary(experiment: Mapping[str, Any]) -> str:
    if experiment["variants"].keys() != _NAMES.keys():
        return "<p>Only one variant was run, so there is nothing to compare it with.</p>"
    one, two = (experiment["variants"][name] for name in _NAMES)
    costs = experiment["shared_slot_costs_ms"]
    slots = (
        f"The shared slot was reconfigured {one['reconfigurations']} times, "
        f"{format_ms(one['reconfiguration_ms'])} ms in all; two slots {two['reconfigurations']} times, "
        f"{format_ms(two['reconfiguration_ms'])} ms."
    )
    times = (
        f"With the shared slot a picture takes {_longer(costs['filter'])} (median, camera to viewer), a "
        f"servo index {_longer(costs['control'])} (median, from its command to its publication)."
    )
    losses = (
        f"With one slot {_share(one)} pictures came back, with two {_share(two)}. They are sent with best "
        "effort: a picture that loses a fragment on the network, or is overtaken by a newer one before it is "
        "filtered, is gone."
    )
    sentences = (slots, times, losses)
    return "<ul>" + "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences) + "</ul>"


def _share(variant: Mapping[str, Any]) -> str:
    taken = variant["frames_in"]
    return f"{variant['frames_out']}" if taken is None else f"{variant['frames_out']} of {taken}"


def _longer(cost_ms: float | None) -> str:
    if cost_ms is None:
        return "a time that was not measured"
    return f"{format_ms(abs(cost_ms))} ms {'longer' if cost_ms >= 0 else 'less'}"


def _table(variants: Mapping[str, Mapping[str, Any]]) -> str:
    rows = []
    for name, variant in variants.items():
        figures = [format_figure(key, variant[key]) for key in FIGURES]
        times = [
            format_ms(variant[chain][point])
            for chain in ("filter_ms", "control_ms")
            for point in ("median", "p95")
        ]
        rows.append([_NAMES[name], *figures, *times])
    heads = [f"{text} [ms]" if key.endswith("_ms") else text for key, text in FIGURES.items()]
    heads += [f"{chain}, {point}" for chain in ("picture", "servo index") for point in ("median", "p95")]
    return (
        table(["variant", *heads], rows)
        + '<p class="small">Times of pictures are from the camera to the viewer, those of servo indices from '
        "their command to their publication, in ms.</p>"
    )


def _slots(variants: Mapping[str, Mapping[str, Any]]) -> str:
    rows = [
        [
            _NAMES[name],
            f"RS{slot['id']}",
            str(slot["reconfigurations"]),
            format_ms(slot["reconfiguration_ms"]),
            format_ms(slot["busy_ms"]),
            slot["holds"] or "-",
        ]
        for name, variant in variants.items()
        for slot in variant["slots"]
    ]
    head = ["variant", "slot", "reconfigurations", "time in them [ms]", "computing [ms]", "holds at the end"]
    return table(head, rows)


def _picture(shown: Picture) -> str:
    caption, png = shown
    data = base64.b64encode(png).decode()
    return (
        '<figure style="display: inline-block; width: 48%; margin: 0.5%">'
        f'<img style="width: 100%" alt="{escape(caption)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )
