"""Traces as files: for Perfetto, and drawn."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from PIL import Image

from reconros_zenoh.board.trace import Trace
from reconros_zenoh.clock.virtual import VirtualEnvironment
from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.trace_file import own_trace_file, write_trace
from reconros_zenoh.measure.trace_plots import trace_figure

if TYPE_CHECKING:
    from pathlib import Path


def one_call(at_ns: int = 1_000_000) -> Trace:
    """The ICAP loads `a` for 1 ms, `a` computes for 2 ms, a message goes out for 1 ms."""
    environment = VirtualEnvironment(0)
    trace = Trace(environment)
    worker = trace.add_slot(0)
    environment.run(until=at_ns)
    worker.begin("a")
    trace.icap.begin("a")
    environment.run(until=at_ns + 1_000_000)
    trace.icap.end()
    worker.stage("reconfiguration", at_ns)
    environment.run(until=at_ns + 3_000_000)
    worker.stage("execution", at_ns + 1_000_000)
    worker.end()
    trace.stack.begin("out")
    environment.run(until=at_ns + 4_000_000)
    return trace


def test_in_the_trace_event_format_stages_stand_within_their_call(tmp_path: Path) -> None:
    path = tmp_path / "all" / "new" / "trace.json"
    with own_trace_file(path):
        write_trace(path, "board7", one_call())
    events = json.loads(path.read_text())["traceEvents"]
    names = {event["tid"]: event["args"]["name"] for event in events if event["name"] == "thread_name"}
    assert names == {0: "RS0", 1: "ICAP", 2: "DDS stack"}
    assert events[0] == {"ph": "M", "pid": 0, "name": "process_name", "args": {"name": "board7"}}
    drawn = [
        (names[event["tid"]], event["name"], event["cat"], event["ts"], event["dur"])
        for event in events
        if event["ph"] == "X"
    ]
    assert drawn == [
        ("RS0", "a", "call", 1000, 3000),
        ("ICAP", "a", "call", 1000, 1000),
        ("RS0", "reconfiguration", "stage", 1000, 1000),
        ("RS0", "execution", "stage", 2000, 2000),
        ("DDS stack", "out", "call", 4000, 1000),
    ]


def test_the_drawing_has_a_line_per_track_and_the_last_second() -> None:
    figure = trace_figure("board7", one_call(2_000_000_000))
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["RS0", "ICAP", "DDS stack"]
    assert axes.get_xlim() == (1004, 2004)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "a",
        "reconfiguration",
        "message in",
        "message out",
    ]


def test_each_of_many_callbacks_has_a_colour_of_its_own() -> None:
    trace = Trace(VirtualEnvironment(0))
    worker = trace.add_slot(0)
    names = [f"callback_{number:02}" for number in range(40)]
    for name in names:
        worker.begin(name)
        worker.end()
    (legend,) = trace_figure("board7", trace).legends
    patches = dict(zip((text.get_text() for text in legend.get_texts()), legend.get_patches(), strict=True))
    assert len({patches[name].get_facecolor() for name in names}) == len(names)


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_trace_is_drawn_to_a_file_also_where_nothing_happened(tmp_path: Path, suffix: str) -> None:
    for name, trace in {"some": one_call(), "none": Trace(VirtualEnvironment(0))}.items():
        path = tmp_path / f"{name}.{suffix}"
        write_trace(path, "board7", trace)
        if suffix == "png":
            with Image.open(path) as image:
                assert image.width > image.height
        else:
            assert "<svg" in path.read_text()


def test_a_file_of_another_kind_or_in_no_folder_is_refused_at_once(tmp_path: Path) -> None:
    with (
        pytest.raises(UsageError, match=r"trace\.txt: a trace is written as \.json"),
        own_trace_file(tmp_path / "trace.txt"),
    ):
        pass
    (tmp_path / "file").touch()
    with (
        pytest.raises(UsageError, match=r"cannot be written .* another file for --trace"),
        own_trace_file(tmp_path / "file" / "trace.json"),
    ):
        pass
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(UsageError, match=r"cannot be written"), own_trace_file(tmp_path / "folder.json"):
        pass


def test_two_boards_do_not_write_to_one_file(tmp_path: Path) -> None:
    path = tmp_path / "trace.json"
    with (
        own_trace_file(path),
        pytest.raises(UsageError, match=r"another board writes its trace to .*trace\.json\. Give each"),
        own_trace_file(path),
    ):
        pass
    with own_trace_file(path):  # afterwards it is free again
        pass
