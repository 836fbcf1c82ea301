from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconros_zenoh.errors import ExperimentError, FileError, UsageError
from reconros_zenoh.measure.record import (
    HEADER,
    Record,
    RecordWriter,
    RoundTrip,
    find_records,
    read_record,
    short_names,
)

times_ns = st.integers(0, 10**12)
round_trips = st.one_of(
    st.tuples(times_ns, st.sampled_from(["ok", "wrong"])), st.tuples(st.none(), st.just("lost"))
)
times_ms = st.floats(0, 1e6, allow_nan=False)


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@given(st.lists(round_trips, max_size=30))
def test_what_is_written_is_read_back_to_the_nanosecond(tmp_path_factory, trips):
    path = tmp_path_factory.mktemp("records") / "mixed" / "sort.csv"
    with RecordWriter(path) as writer:
        for index, (time_ns, outcome) in enumerate(trips):
            writer.write(RoundTrip(index, time_ns, outcome))
    record = read_record(path)
    assert record.name == "sort"
    assert np.rint(record.values_ms * 1e6).astype(int).tolist() == [t for t, _ in trips if t is not None]
    assert record.lost == sum(outcome == "lost" for _, outcome in trips)
    assert record.wrong == sum(outcome == "wrong" for _, outcome in trips)
    made = Record.of("sort", [RoundTrip(index, *trip) for index, trip in enumerate(trips)])
    assert (made.name, made.lost, made.wrong) == (record.name, record.lost, record.wrong)
    assert made.values_ms.tolist() == pytest.approx(record.values_ms.tolist())


def test_every_line_is_on_disk_before_the_next(tmp_path):
    path = tmp_path / "sort.csv"
    with RecordWriter(path) as writer:
        assert path.read_text() == f"{HEADER}\n"
        writer.write(RoundTrip(0, 2_500_001, "ok"))
        assert path.read_text() == f"{HEADER}\n0,2.500001,ok\n"
        writer.write(RoundTrip(1, None, "lost"))
        assert path.read_text().endswith("\n1,,lost\n")


@given(
    st.lists(times_ms, min_size=1, max_size=30),
    st.sampled_from([";\n", "\n", ",\n", ";", ",", " ; ", "\r\n", ";\r\n", "\n\n"]),
    st.sampled_from(["", "Periodic", "Round trip [ms]", "latency_ms"]),
    st.booleans(),
)
def test_foreign_files_keep_every_value(tmp_path_factory, values, separator, header, ended):
    fields = [*([header] if header else []), *map(repr, values)]
    text = separator.join(fields) + (separator if ended else "")
    path = tmp_path_factory.mktemp("records") / "Periodic.csv"
    path.write_bytes(text.encode())
    record = read_record(path)
    assert record.values_ms.tolist() == values
    assert (record.name, record.lost, record.wrong) == ("Periodic", 0, 0)


def test_the_authors_format_is_read_with_warm_up_and_total(tmp_path):
    path = written(tmp_path / "hash.csv", "Periodic;\n692.845;\n246.875;\n250416;\n")
    assert read_record(path).values_ms.tolist() == [692.845, 246.875, 250416.0]


def test_a_nan_among_foreign_times_is_a_lost_request(tmp_path):
    path = tmp_path / "times.csv"
    path.write_text("nan\n12.5\nNaN\n7\n")
    record = read_record(path)
    assert record.values_ms.tolist() == [12.5, 7]
    assert (record.lost, record.wrong) == (2, 0)
    path.write_text("nan\nnan")
    assert read_record(path).values_ms.size == 0
    assert read_record(path).lost == 2


def test_a_byte_order_mark_is_no_part_of_the_values(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"\xef\xbb\xbf1.5\n2\n")
    assert read_record(path).values_ms.tolist() == [1.5, 2.0]


def test_a_record_without_any_round_trip_is_empty(tmp_path):
    record = read_record(written(tmp_path / "a.csv", HEADER + "\n"))
    assert (record.values_ms.size, record.lost, record.wrong) == (0, 0, 0)
    assert record.values_ms.dtype == np.float64


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("Sort;\n1.0;\nabc;\n2.0;", 3, "'abc'"),
        ("Sort;\nMore;\n1.0;", 2, "'More'"),
        ("692ms\n1.0\n", 1, "'692ms'"),
        ("1.0\n-2.0\n", 2, "'-2.0'"),
        ("inf\n1.0\n", 1, "'inf'"),
        ("1.0\ninf\n", 2, "'inf'"),
        ("1.0;;2.0\n", 1, "missing"),
        ("1.0\n2,5;\n", 2, "both"),
        ("", None, "no times"),
        ("Sort;\n\n", None, "no times"),
        (f"{HEADER}\n0,1.0,ok\n1,,ok\n", 3, "missing"),
        (f"{HEADER}\n0,1.0,lost\n", 2, "lost request has a time"),
        (f"{HEADER}\n0,1.0,fine\n", 2, "not a round trip"),
        (f"{HEADER}\n0,1.0\n", 2, "not a round trip"),
        (f"{HEADER}\nx,1.0,ok\n", 2, "not a round trip"),
        (f"{HEADER}\n0,fast,ok\n", 2, "'fast'"),
        (f"{HEADER}\n0,-1,ok\n", 2, "'-1'"),
        (f"{HEADER}\n0,nan,wrong\n", 2, "'nan'"),
    ],
)
def test_bad_records_are_refused_with_line_and_remedy(tmp_path, text, line, word):
    path = written(tmp_path / "bad.csv", text)
    with pytest.raises(FileError, match=word) as error:
        read_record(path)
    assert (error.value.path, error.value.line) == (path, line)
    assert error.value.remedy


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(FileError, match=r"gone\.csv: cannot be read"):
        read_record(tmp_path / "gone.csv")
    with pytest.raises(FileError, match="cannot be read"):
        read_record(tmp_path)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(FileError, match="not UTF-8"):
        read_record(tmp_path / "binary.csv")


def test_a_folder_that_cannot_be_written_is_a_usage_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match=r"sort\.csv: the record cannot be created.*Choose an output folder"):
        RecordWriter(tmp_path / "file" / "mixed" / "sort.csv")


def test_a_full_disk_ends_the_experiment(tmp_path):
    with pytest.raises(ExperimentError, match="/dev/full: a round trip could not be recorded"):
        RecordWriter(Path("/dev/full"))


def test_a_line_of_which_the_disk_takes_a_part_ends_the_experiment_and_is_left_out(tmp_path, monkeypatch):
    with RecordWriter(tmp_path / "sort.csv") as writer, monkeypatch.context() as patched:
        file = FullAfter(3)
        patched.setattr(writer, "_file", file)
        with pytest.raises(ExperimentError, match="the disk is full"):
            writer.write(RoundTrip(0, 1_000_000, "ok"))
        assert file.getvalue() == b""


class FullAfter(io.BytesIO):
    """A raw file that takes so many bytes and no more, and says so as `write` does."""

    def __init__(self, room):
        super().__init__()
        self._room = room

    def write(self, data):
        return super().write(data[: self._room])


def test_records_are_found_below_a_folder(tmp_path):
    for name in ("mixed/sort.csv", "mixed/hash.csv", "all_software/sort.csv", "mixed/notes.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1.0\n")
    found = [str(path.relative_to(tmp_path)) for path in find_records(tmp_path)]
    assert found == ["all_software/sort.csv", "mixed/hash.csv", "mixed/sort.csv"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="empty: no record found"):
        find_records(tmp_path / "empty")


def test_names_are_as_short_as_they_can_be():
    a, b = Path("/r/wall/mixed/sort.csv"), Path("/r/virtual/mixed/sort.csv")
    assert short_names([a]) == ["mixed/sort"]
    assert short_names([a, b]) == ["wall/mixed/sort", "virtual/mixed/sort"]
    assert short_names([a, a]) == [str(a), str(a)]
    assert short_names([Path("/sort.csv"), Path("/sort.txt")]) == ["/sort.csv", "/sort.txt"]
