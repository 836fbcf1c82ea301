from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from reconros_zenoh.measure.mapping_plots import ages_figure

LONG = "all_hardware_but_the_camera_with_its_gateway"


def drawn(ages_ms):
    """Return the figure as it is laid out."""
    figure = ages_figure(ages_ms)
    figure.draw_without_rendering()
    return figure


def test_the_age_of_a_single_message_is_a_line():
    figure = drawn({"mixed": {"/a": [5.0]}, "all_software": {"/a": []}})
    one, none = figure.axes[0].get_lines()
    assert [*zip(*one.get_data(), strict=True)] == [(5.0, 0.0), (5.0, 1.0)]
    assert one.get_drawstyle() == "steps-post"
    assert not none.get_xdata().size
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["mixed", "all_software"]


@pytest.mark.parametrize(
    ("least", "greatest", "scale"),
    [(82.0, 120.0, "linear"), (33.2, 33.4, "linear"), (0, 3, "linear"), (1, 20, "log"), (1e-4, 1e5, "log")],
)
def test_any_range_of_ages_has_figures_at_its_axis(least, greatest, scale):
    ages = np.linspace(least, greatest, 50).tolist()
    axes = drawn({"mixed": {"/a": ages}}).axes[0]
    low, high = axes.get_xlim()
    shown = [tick for tick in axes.xaxis.get_major_ticks() if low <= tick.get_loc() <= high]
    assert axes.get_xscale() == scale
    assert len({tick.label1.get_text() for tick in shown} - {""}) >= 3


def test_long_names_of_mappings_and_topics_are_neither_cut_nor_overlap():
    topics = {f"/robot/camera_front_left_of_the_arm/image_{number}": [1.0, 2.0] for number in range(3)}
    figure = drawn({f"{LONG}_{number}": topics for number in range(8)})
    (legend,) = figure.legends
    assert figure.bbox.contains(*legend.get_window_extent().max)
    boxes = [axes._left_title.get_window_extent() for axes in figure.axes]
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
    assert boxes[-1].x1 <= figure.bbox.x1


def test_many_mappings_leave_room_for_the_only_panel():
    figure = drawn({f"{LONG}_{number}": {"/a": [1.0, 2.0]} for number in range(8)})
    panel, legend = figure.axes[0].get_window_extent(), figure.legends[0].get_window_extent()
    assert figure.bbox.contains(*legend.max)
    assert panel.y1 < legend.y0
    assert panel.height > figure.dpi
