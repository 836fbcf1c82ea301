from __future__ import annotations

import re
from html.parser import HTMLParser

import numpy as np
import pytest
from board_like_runs import experiment_of, like_the_board

from reconros_zenoh.errors import UsageError
from reconros_zenoh.measure.record import Record
from reconros_zenoh.measure.report import write_report
from reconros_zenoh.measure.run import load_run

VOID = {"meta", "br", "hr", "img", "link", "input"}
SPANS = {"mixed": {"sort": {"transport": 0.5, "execution": 1.25}}}


class Page(HTMLParser):
    """The text of a page; fails if its tags do not match."""

    def __init__(self, html):
        super().__init__()
        self.open, self.text, self.attributes = [], "", []
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.text += data


def written(path, *runs):
    write_report(path, [experiment for experiment, _ in runs], [records for _, records in runs])
    return path.read_text(encoding="utf-8")


def test_the_report_tells_everything_and_needs_nothing(tmp_path, write_run, board_records):
    wall_host = {"overruns": 12, "lag_p50_us": 11.0, "lag_p99_us": 300.0}
    runs = [
        load_run(
            write_run(
                board_records, "virtual", spans=SPANS, command="reconros demo", versions={"zenoh": "1.8.0"}
            )
        ),
        load_run(write_run(board_records, "wall", host=wall_host, date="2025-01-02", profile="zynq7100")),
    ]
    html = written(tmp_path / "report.html", *runs)
    page = Page(html)
    assert len(html.encode()) < 3_000_000
    assert "http" not in html.lower()
    assert "<script" not in html
    assert "@import" not in html
    assert all(ref.startswith("#") for ref in re.findall(r'(?:href|src)="([^"]*)"', html))
    assert all(ref.startswith("#") for ref in re.findall(r"url\(([^)]*)\)", html))
    for word in (
        "In short",
        "15 of 15 medians lie within 10 %",
        "sort: shortest under",
        "roundtrip, virtual clock",
        "roundtrip, wall clock",
        "12 times a computation took longer",
        "Where the time goes",
        "swapped columns",
        "modulo 1 s",
        "reconros demo",
        "version of zenoh",
        "zynq7100",
        "2025-01-02",
        "host: lag_p99_us",
    ):
        assert word in page.text
    assert html.count("<svg") == 3  # a grid per clock, and the spans of one
    assert html.count('class="warning"') == 1
    assert [path.name for path in tmp_path.glob("report*")] == ["report.html"]


def test_the_tables_hold_the_figures_beside_the_real_boards(tmp_path, board_records):
    html = written(tmp_path / "r.html", (experiment_of(board_records), board_records))
    rows = [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", html)]
    (medians,) = [row for row in rows if row[:2] == ["sort", "mixed"] and len(row) == 15]
    assert medians[2:8] == ["201", "0", "0", "2.63", "2.63", "+0.0 %"]
    (speedups,) = [row for row in rows if row[:2] == ["sort", "mixed"] and len(row) == 7]
    assert speedups[2:4] == ["19.65", "19.65"]
    assert speedups[5:] == ["20.97", "18.18"]
    assert "real board are of times modulo 1 s, ours of whole times" in html


def test_what_the_board_never_ran_has_a_speedup_and_nothing_beside_it(tmp_path):
    records = {
        "all_software": {"mine": Record("mine", np.array([4.0]))},
        "mixed": {"mine": Record("mine", np.array([2.0]))},
        "other": {"sort": like_the_board("mixed", "sort")},
    }
    records["all_software"]["sort"] = like_the_board("all_software", "sort")
    html = written(tmp_path / "r.html", (experiment_of(records), records))
    rows = [re.findall(r"<td[^>]*>([^<]*)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", html)]
    (mine,) = [row for row in rows if row[:2] == ["mine", "mixed"] and len(row) == 7]
    assert mine[2:] == ["2.00", "-", "2.00", "-", "-"]
    (other,) = [row for row in rows if row[:2] == ["sort", "other"] and len(row) == 7]
    assert (other[2], other[3], other[5:]) == ("19.65", "-", ["-", "-"])


def test_stages_come_in_the_order_of_the_clients(tmp_path, board_records):
    spans = {"mixed": {client: {"execution": 1.0} for client in reversed(board_records["mixed"])}}
    html = written(tmp_path / "r.html", (experiment_of(board_records, spans=spans), board_records))
    (stages,) = re.findall(r"<details>(.*?)</details>", html, flags=re.DOTALL)
    assert re.findall(r'<tr><td class="text ">(\w+)', stages) == list(board_records["mixed"])


def test_stages_stand_in_the_table_as_in_the_drawing(tmp_path, board_records):
    spans = {"mixed": {"sort": {"mine": 1.0, "execution": 1.0}, "sobel": {"retransmission": 1.0, "dds": 1.0}}}
    html = written(tmp_path / "r.html", (experiment_of(board_records, spans=spans), board_records))
    (stages,) = re.findall(r"<details>(.*?)</details>", html, flags=re.DOTALL)
    assert re.findall(r'<th class="number">(\w+)', stages) == ["dds", "retransmission", "execution", "mine"]


def test_nothing_is_cut_on_paper(tmp_path, board_records):
    html = written(tmp_path / "r.html", (experiment_of(board_records), board_records))
    (on_paper,) = re.findall(r"@media print \{(.*)\}", html, flags=re.DOTALL)
    assert ".wide { overflow: visible; }" in on_paper
    assert "@page { size: landscape; }" in html


def test_without_overruns_spans_or_software_the_report_says_less(tmp_path):
    records = {
        "mine": {"sort": like_the_board("mixed", "sort"), "dead": Record("dead", np.array([]), lost=5)}
    }
    page_html = written(tmp_path / "r.html", (experiment_of(records, "wall"), records))
    text = Page(page_html).text
    assert 'class="warning"' not in page_html
    assert "no overrun" in text
    assert "Where the time goes" not in text
    assert "all_software was not run" in text
    assert "dead: no answer under any mapping." in text


def test_names_are_text_never_markup(tmp_path):
    records = {"<b>&mine": {'<img src="x">': Record("x", np.array([1.0, 2.0]))}}
    spans = {"<b>&mine": {'<img src="x">': {"<i>": 1.0}}}
    html = written(tmp_path / "r.html", (experiment_of(records, spans=spans, command="<u>"), records))
    page = Page(html)
    assert "<b>&mine" in page.text
    assert 'src="x"' not in html


def test_a_command_that_is_not_utf_8_is_quoted(tmp_path):
    records = {"mine": {"x": Record("x", np.array([1.0, 2.0]))}}
    experiment = experiment_of(records, command="demo --out \udcff")
    assert "demo --out \\udcff" in Page(written(tmp_path / "r.html", (experiment, records))).text


def test_a_run_that_was_stopped_at_once_still_has_a_report(tmp_path):
    records = {"mixed": {}}
    text = Page(written(tmp_path / "r.html", (experiment_of(records, spans=records), records))).text
    assert "Nothing was measured." in text


def test_the_report_replaces_an_older_one_or_leaves_it(tmp_path):
    records = {"mine": {"x": Record("x", np.array([1.0, 2.0]))}}
    run = (experiment_of(records), records)
    path = tmp_path / "as" / "deep" / "report.html"
    written(path, run)
    path.write_text("older")
    written(path, run)
    assert path.read_text().startswith("<!DOCTYPE html>")
    path.write_text("older")
    path.with_name("report.html.partial").mkdir()  # so that the new one cannot be written
    with pytest.raises(UsageError, match=r"report\.html: the report cannot be written"):
        written(path, run)
    assert path.read_text() == "older"


def test_the_report_says_what_the_times_of_callbacks_rest_on(tmp_path):
    timing = {"mixed": {"sort": {"software": {"basis": "cycles"}, "slot 1": {"basis": "table"}}}}
    records = {"mixed": {"sort": Record("sort", np.array([2.5]))}}
    experiment = experiment_of(records, "virtual", timing=timing)
    page = Page(written(tmp_path / "report.html", (experiment, records)))
    assert "sort in software from cycles, sort in slot 1 from table" in page.text
