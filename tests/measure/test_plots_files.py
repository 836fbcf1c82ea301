from __future__ import annotations

import subprocess
import sys
from itertools import combinations, pairwise
from typing import get_args
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from board_like_runs import like_the_board

from reconros_zenoh.board.stages import Stage
from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure import plots
from reconros_zenoh.measure.histogram import NamedRecord
from reconros_zenoh.measure.plots import grid_figure, inline_svg, spans_figure, write_histograms
from reconros_zenoh.measure.record import Record

PNG = b"\x89PNG\r\n\x1a\n"
LONG = "a_mapping_with_a_very_long_name_that_says_which_callback_is_in_which_slot"


def texts(svg):
    return inline_svg(svg).count('<g id="text_')


def titles(figure, loc):
    return [axes.get_title(loc).strip() for axes in figure.axes]


def test_the_grid_has_a_panel_per_mapping_and_client(board_records):
    figure = grid_figure(board_records)
    assert titles(figure, "left") == ["sort", "inverse", "sobel", "mnist", "hash"] * 3
    assert titles(figure, "right")[5] == "2.63 ms (board 2.63)"
    assert [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()] == list(board_records)
    # One time axis per client, so that mappings can be compared.
    limits = [axes.get_xlim() for axes in figure.axes]
    assert limits[:5] == limits[5:10] == limits[10:]
    # sort is 20 times faster in hardware, sobel is not: only sort needs the logarithmic axis.
    assert [axes.get_xscale() for axes in figure.axes[:3]] == ["log", "log", "linear"]


def test_the_grid_of_a_foreign_mapping_has_no_real_board():
    figure = grid_figure(
        {LONG: {"sort": like_the_board("mixed", "sort"), "$x": Record("$x", np.array([3.0]))}}
    )
    assert titles(figure, "right") == ["2.63 ms", "3.00 ms"]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["this run", "its mean"]
    inline_svg(figure)


def test_clients_without_answers_or_not_run_say_so():
    figure = grid_figure(
        {
            "mixed": {
                "sort": Record("sort", np.array([]), lost=9),
                "mine": Record("mine", np.array([]), lost=2),
            },
            "other": {"sort": Record("sort", np.array([0.0, 0.0]))},
        }
    )
    written = [
        [text.get_text() for text in axes.texts if "\n" in text.get_text() or text.get_text() == "not run"]
        for axes in figure.axes
    ]
    assert written == [["no answer\n(9 lost)"], ["no answer\n(2 lost)"], [], ["not run"]]
    inline_svg(figure)


def test_the_shares_outside_and_a_mean_outside_are_told():
    values = np.concatenate([np.full(98, 10.0), np.full(2, 9000.0)])
    (axes,) = grid_figure({"mine": {"x": Record("x", values)}}).axes
    assert axes.get_xlabel() == "mean 189.8 ms →, 2.0 % outside"


def test_spans_are_stacked_to_their_sum():
    spans = {
        LONG: {"sort": {"execution": 2.0, "queue": 1.0, "odd": 0.5}, "hash": {}},
        "b": {"hash": {"execution": 80.0}},
    }
    figure = spans_figure(spans)
    assert [text.get_text().strip() for text in figure.axes[0].texts] == ["3.50"]
    assert [text.get_text().strip() for text in figure.axes[1].texts] == ["80.00"]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["queue", "execution", "odd"]
    inline_svg(figure)


def test_the_inline_drawing_needs_nothing_from_outside(board_records):
    svg = inline_svg(grid_figure(board_records))
    assert "http" not in svg
    assert "var(--ink)" in svg
    assert "<metadata" not in svg
    ET.fromstring(svg)


def test_histograms_are_drawn_with_their_comparison(tmp_path):
    ours = NamedRecord("mixed/sort", tmp_path / "a.csv", like_the_board("mixed", "sort"))
    other = NamedRecord("all_hardware/sort", tmp_path / "b.csv", like_the_board("all_hardware", "sort"))
    silent = NamedRecord(f"{LONG}/sort", tmp_path / "c.csv", Record("sort", np.array([]), lost=1))
    path = tmp_path / "new" / "h.png"
    write_histograms(path, [(ours, other), (ours, None), (silent, other), (silent, silent)], 20)
    assert path.read_bytes().startswith(PNG)
    with pytest.raises(UsageError, match=r"h\.svg: histograms are written as png"):
        write_histograms(tmp_path / "h.svg", [(ours, None)], 20)
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be written"):
        write_histograms(tmp_path / "file" / "h.png", [(ours, None)], 20)


def test_measuring_does_not_load_the_drawing_library():
    code = "import sys, reconros_zenoh.measure.report; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_each_stage_has_a_colour_of_its_own():
    assert set(plots.STAGE_COLOURS) == set(get_args(Stage))
    assert len(set(plots.STAGE_COLOURS.values())) == len(plots.STAGE_COLOURS)


# Machado and others (2009): A Physiologically-based Model for Simulation of Colour Vision Deficiency
SEEN_BY = {
    "all": np.eye(3),
    "protanopes": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deuteranopes": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritanopes": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}
XYZ = np.array([[0.4339, 0.3762, 0.1899], [0.2126, 0.7152, 0.0722], [0.0177, 0.1095, 0.8729]])  # of D65


def linear(colour):
    """Red, green and blue, as much light as they are."""
    parts = np.array([int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)])
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    """The colour in CIELAB, where distances are about as large as they look."""
    x, y, z = np.cbrt(XYZ @ np.clip(rgb, 0, 1))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_stages_that_follow_each_other_differ_in_grey():
    greys = {stage: XYZ[1] @ linear(colour) + 0.05 for stage, colour in plots.STAGE_COLOURS.items()}
    assert min(max(pair) / min(pair) for pair in pairwise(greys.values())) > 1.3
    # The two that most often take most of the time.
    assert greys["execution"] / greys["dds"] > 2


@pytest.mark.parametrize("eyes", SEEN_BY)
def test_the_colour_blind_can_tell_the_stages_apart(eyes):
    seen = [lab(np.array(SEEN_BY[eyes]) @ linear(colour)) for colour in plots.STAGE_COLOURS.values()]
    assert min(np.linalg.norm(one - other) for one, other in combinations(seen, 2)) > 12
