"""TOML files: in which line a key stands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.errors import FileError
from reconros_zenoh.toml_file import TomlFile

if TYPE_CHECKING:
    from pathlib import Path

TEXT = """\
# A comment with name = "x" and [model]
name = "board"
nameless = 1
dotted.key = 2
"quoted key" = 3

[model.cores]
count = { value = 2, unit = "1" }
clock.value = 666

[model.callbacks."left arm"]  # a comment
software = 1

[[model.slots]]
lut = 10
size = { value = 1 }

[[model.slots]]
lut = 20
size = { value = 2 }
  [ model.indented ]
  key = 1
"""

LINES = {
    "name": (("name",), 'name = "board"'),
    "a name that begins alike": (("nameless",), "nameless = 1"),
    "dotted": (("dotted", "key"), "dotted.key = 2"),
    "quoted": (("quoted key",), '"quoted key" = 3'),
    "table": (("model", "cores"), "[model.cores]"),
    "key of a table": (("model", "cores", "count"), "count = {"),
    "key of an inline table": (("model", "cores", "count", "unit"), "count = {"),
    "dotted key of a table": (("model", "cores", "clock", "value"), "clock.value"),
    "key that a table lacks": (("model", "cores", "voltage"), "[model.cores]"),
    "quoted table": (("model", "callbacks", "left arm", "software"), "software = 1"),
    "first of an array": (("model", "slots", "0", "size", "value"), "size = { value = 1 }"),
    "second of an array": (("model", "slots", "1", "size", "value"), "size = { value = 2 }"),
    "key that the second lacks": (("model", "slots", "1", "dsp"), "[[model.slots]]\nlut = 20"),
    "an array itself": (("model", "slots"), "[[model.slots]]\nlut = 10"),
    "indented": (("model", "indented", "key"), "  key = 1"),
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "some.toml"


@pytest.mark.parametrize(("key", "place"), LINES.values(), ids=LINES)
def test_the_line_of_a_key(path: Path, key: tuple[str, ...], place: str) -> None:
    path.write_text(TEXT)
    line = TomlFile.read(path).line(key)
    assert line is not None
    assert "\n".join(TEXT.splitlines()[line - 1 :]).startswith(place)


def test_the_first_line(path: Path) -> None:
    path.write_text("a = 1\n")
    assert TomlFile.read(path).line(("a",)) == 1


@pytest.mark.parametrize("key", [("voltage",), ("other", "table"), ()])
def test_a_key_without_any_place_in_the_file_has_no_line(path: Path, key: tuple[str, ...]) -> None:
    path.write_text(TEXT)
    assert TomlFile.read(path).line(key) is None


def test_the_content_is_what_the_file_says(path: Path) -> None:
    path.write_text("a = 1\n[b]\nc = 'ü'\n", encoding="utf-8")
    file = TomlFile.read(path)
    assert file.content == {"a": 1, "b": {"c": "ü"}}
    assert file.path == path


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a = 1\nb = = 2\n", 2),
        ("a = 1\n\n[b\n", 3),
        ("a = 1\na = 2\n", 2),
        ('a = """\nnever\nclosed\n', 4),
        ("= 1", 1),
    ],
)
def test_a_file_that_is_not_toml(path: Path, text: str, line: int) -> None:
    path.write_text(text)
    with pytest.raises(FileError, match="is not TOML") as caught:
        TomlFile.read(path)
    assert (caught.value.path, caught.value.line) == (path, line)


def test_a_file_that_is_missing(path: Path) -> None:
    with pytest.raises(FileError, match=r"some.toml: cannot be read: No such file.* readable TOML file"):
        TomlFile.read(path)


def test_a_file_that_is_a_folder(path: Path) -> None:
    path.mkdir()
    with pytest.raises(FileError, match="cannot be read"):
        TomlFile.read(path)


def test_a_file_that_is_not_utf_8(path: Path) -> None:
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(FileError, match=r"some.toml:1: The text is not UTF-8"):
        TomlFile.read(path)


def test_an_unknown_table_that_has_only_headers_of_tables_in_it(path: Path) -> None:
    path.write_text("a = 1\n[callbakcs.sobel]\nsoftware = true\n")
    assert TomlFile.read(path).line(("callbakcs",)) == 2


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        ("[" * 3000, "is nested too deeply"),
        ("[\n" * 3000, "is nested too deeply"),
        ("9" * 5000, "has a number of thousands of digits"),
        ("1\n[" + "a." * 100 + "a]", "is nested too deeply"),
        ("1\n" + '"a" . ' * 50_000 + "a = 1", "is nested too deeply"),
    ],
)
def test_a_value_that_python_cannot_take(path: Path, value: str, problem: str) -> None:
    path.write_text(f"a = 1\nb = {value}\nc = 2\n")
    with pytest.raises(FileError, match=problem) as caught:
        TomlFile.read(path)
    assert caught.value.line is not None
    assert caught.value.line > 1
