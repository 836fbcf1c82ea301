"""Board profiles: the shipped ones load, and every mistake in one is found in its line."""

from __future__ import annotations

import ast
from importlib import resources
from pathlib import Path

import pytest
from pydantic import BaseModel

import reconros_zenoh
from reconros_zenoh.board.bitstream_fit import BitstreamFit, frames
from reconros_zenoh.board.profile import Profile, profile_names, read_profile
from reconros_zenoh.errors import FileError, UsageError

MINIITX = (resources.files("reconros_zenoh.board") / "profiles" / "miniitx-zynq7100.toml").read_text("utf-8")


def test_three_profiles_ship() -> None:
    assert profile_names() == ["miniitx-zynq7100", "native", "zcu104"]


@pytest.mark.parametrize("name", profile_names())
def test_a_shipped_profile_loads_by_its_name(name: str) -> None:
    assert read_profile(name).name == name
    assert read_profile(name).description


def test_native_models_nothing() -> None:
    assert read_profile("native").model is None


def test_the_figures_that_the_paper_prints() -> None:
    """ReconROS Executor, Sections V-A and V-B."""
    model = read_profile("miniitx-zynq7100").model
    assert model is not None
    published = {
        "cores": (model.cores.count, 2),
        "core clock": (model.cores.clock, 666),
        "hardware threads": (model.fabric.thread_clock, 120),
        "B": (model.icap.bandwidth, 160),
        "t_offset": (model.icap.offset, 6.8),
    }
    assert {what: (quantity.value, quantity.basis) for what, (quantity, _) in published.items()} == {
        what: (value, "published") for what, (_, value) in published.items()
    }
    assert {(slot.lut, slot.size.bytes, slot.size.basis) for slot in model.bitstreams} == {
        (20800, 2838976, "published"),
        (41600, 5285728, "published"),
        (40800, 4883328, "published"),
    }
    assert list(model.callbacks) == ["sobel", "sort", "mnist", "inverse", "hash"]


def test_every_quantity_of_a_profile_is_read_somewhere() -> None:
    files = Path(reconros_zenoh.__file__).parent.rglob("*.py")
    nodes = (node for file in files for node in ast.walk(ast.parse(file.read_text("utf-8"))))
    read = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    model = read_profile("zcu104").model
    assert model is not None
    sections = [section for _, section in model if isinstance(section, BaseModel)]
    keys = {key for section in sections for key in type(section).model_fields}
    assert {"thread_clock", "recovery", "cancel"} <= keys <= read


def test_the_reference_executor_polls_once_in_a_millisecond_and_in_ten() -> None:
    model = read_profile("miniitx-zynq7100").model
    assert model is not None
    assert (model.executor.hardware_poll.ns, model.executor.software_poll.ns) == (1_040_000, 10_000_000)


def test_a_slot_that_is_listed_takes_what_the_profile_says() -> None:
    profile = read_profile("miniitx-zynq7100")
    assert profile.bitstream_size(20800, 160, 60) == 2838976
    assert profile.bitstream_size(41600, 320, 120) == 5285728
    assert read_profile("native").bitstream_size(20800, 160, 60) == 4096


def test_the_size_of_another_slot_is_estimated_from_the_listed_ones() -> None:
    profile = read_profile("miniitx-zynq7100")
    listed = BitstreamFit.of(
        [
            (frames(20800, 160, 60), 2838976),
            (frames(41600, 320, 120), 5285728),
            (frames(40800, 280, 100), 4883328),
        ]
    )
    assert profile.bitstream_size(20800, 160, 61) == listed.size(frames(20800, 160, 61))
    assert profile.bitstream_size(30000, 200, 80) == listed.size(frames(30000, 200, 80))
    assert 2838976 < profile.bitstream_size(30000, 200, 80) < 4883328


def test_a_profile_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(MINIITX.replace('name = "miniitx-zynq7100"', 'name = "mine"'))
    assert read_profile(str(path)).name == "mine"
    assert read_profile(str(path)).model == read_profile("miniitx-zynq7100").model


def test_a_profile_needs_no_times_of_callbacks(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(MINIITX.partition("[model.callbacks.")[0])
    profile = read_profile(str(path))
    assert profile.model is not None
    assert profile.model.callbacks == {}


def test_an_unknown_name_lists_those_there_are() -> None:
    with pytest.raises(UsageError) as caught:
        read_profile("zynq7000")
    assert str(caught.value) == (
        "no profile named 'zynq7000'. Give one of miniitx-zynq7100, native, zcu104 or a .toml file."
    )


def test_a_file_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(FileError) as caught:
        read_profile(str(tmp_path / "mine.toml"))
    assert str(caught.value).startswith(f"{tmp_path / 'mine.toml'}: cannot be read")
    assert "readable TOML file" in caught.value.remedy


LAST_SIZE = 'size = { value = 4883328, unit = "B", basis = "published", source = "Table II, RS3" }'
OSIF = '[model.osif]\ncall = { value = 10, unit = "us", basis = "assumed" }\n'

# What is replaced by what, the text of the line that must be named, and what must be said.
MISTAKES = {
    "misspelt key": (
        "hardware_poll =",
        "hardware_pol =",
        "hardware_pol =",
        "model.executor.hardware_pol: there",
    ),
    "misspelt section": ("[model.icap]", "[model.icp]", "[model.icp]", "model.icp: there is no such key"),
    "not TOML": ("count = {", "count = = {", "count = = {", "is not TOML"),
    "not closed": ('name = "miniitx-zynq7100"', 'name = "miniitx', 'name = "miniitx', "is not TOML"),
    "section missing": (OSIF, "", "[model.cores]", "model.osif: Field required"),
    "name missing": ('name = "miniitx-zynq7100"\n', "", None, "name: Field required"),
    "key missing": (
        'call = { value = 10, unit = "us", basis = "assumed" }',
        "",
        "[model.osif]",
        "model.osif.call",
    ),
    "negative": (
        "hardware_poll = { value = ",
        "hardware_poll = { value = -",
        "hardware_poll =",
        "model.executor.hardware_poll.value: Input should be greater than or equal to 0",
    ),
    "no bandwidth": (
        "bandwidth = { value = 160",
        "bandwidth = { value = 0",
        "bandwidth = { value = 0",
        "model.icap.bandwidth.value: Input should be greater than 0",
    ),
    "not a number": ("value = 666", 'value = "fast"', "clock = { value", "model.cores.clock.value"),
    "no core": (
        "count = { value = 2",
        "count = { value = 0",
        "count = {",
        "model.cores.count.value: Input should be greater than or equal to 1",
    ),
    "half a core": ("count = { value = 2", "count = { value = 1.5", "count = {", "model.cores.count.value"),
    "more than all": (
        "nack_probability = { value = 0",
        "nack_probability = { value = 7",
        "nack_probability =",
        "Input should be less than 1",
    ),
    "resent for ever": (
        "nack_probability = { value = 0.",
        "nack_probability = { value = 1.",
        "nack_probability =",
        "Input should be less than 1",
    ),
    "a number in quotes": (
        "value = 666",
        'value = "666"',
        "clock = { value",
        "model.cores.clock.value: Input should be a valid number",
    ),
    "a yes or no in quotes": (
        "stalled_by_reconfiguration = true",
        'stalled_by_reconfiguration = "true"',
        "stalled_by_reconfiguration =",
        "model.dds.stalled_by_reconfiguration: Input should be a valid boolean",
    ),
    "unknown unit": (
        'value = 666, unit = "MHz"',
        'value = 666, unit = "rpm"',
        "clock = { value = 666",
        "model.cores.clock: Value error, unknown unit 'rpm': write one of Hz, kHz, MHz, GHz",
    ),
    "unit missing": (
        'value = 666, unit = "MHz"',
        "value = 666",
        "clock = {",
        "model.cores.clock.unit: Field required",
    ),
    "unknown basis": (
        'value = 666, unit = "MHz", basis = "published"',
        'value = 666, unit = "MHz", basis = "guessed"',
        "clock = { value = 666",
        "model.cores.clock.basis: Input should be 'published', 'calibrated' or 'assumed'",
    ),
    "unknown key": (
        "stalled_by_reconfiguration = true",
        "stalled_by_reconfiguration = true\ncolour = 3",
        "colour = 3",
        "model.dds.colour: there is no such key",
    ),
    "unknown section": (
        OSIF,
        OSIF + "[model.gpu]\ncores = 1\n",
        "[model.gpu]",
        "model.gpu: there is no such key",
    ),
    "unknown key of a quantity": (
        'call = { value = 10, unit = "us"',
        'call = { value = 10, units = "us", unit = "us"',
        "call = {",
        "model.osif.call.units: there is no such key",
    ),
    "unknown key of the file": (
        'description = "',
        'colour = "red"\ndescription = "',
        'colour = "red"',
        "colour: there is no such key",
    ),
    "not a quantity": (
        'call = { value = 10, unit = "us", basis = "assumed" }',
        "call = 10",
        "call = 10",
        "model.osif.call",
    ),
    "a number for a yes or no": (
        "stalled_by_reconfiguration = true",
        "stalled_by_reconfiguration = 7",
        "stalled_by_reconfiguration = 7",
        "model.dds.stalled_by_reconfiguration: Input should be a valid boolean",
    ),
    "a callback's time": (
        "compute = { value = 65.428",
        "compute = { value = -65.428",
        "compute = { value = -65.428",
        "model.callbacks.hash.compute.value",
    ),
    "a callback without software": (
        'software = { value = 1.5, unit = "ms", basis = "published", source = "Table I" }\n',
        "",
        "[model.callbacks.inverse]",
        "model.callbacks.inverse.software: Field required",
    ),
    "the third bitstream": (
        LAST_SIZE,
        LAST_SIZE.replace('"B"', '"Byte"'),
        'size = { value = 4883328, unit = "Byte"',
        "model.bitstreams.2.size: Value error, unknown unit 'Byte'",
    ),
    "the third bitstream's resources": ("lut = 40800", "lut = -1", "lut = -1", "model.bitstreams.2.lut"),
    "a slot without LUTs": ("lut = 40800", "lut = 0", "lut = 0", "model.bitstreams.2.lut"),
}


@pytest.mark.parametrize(("old", "new", "place", "said"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_found_in_its_line(
    tmp_path: Path, old: str, new: str, place: str | None, said: str
) -> None:
    assert MINIITX.count(old) == 1
    path = tmp_path / "mine.toml"
    path.write_text(MINIITX.replace(old, new))
    with pytest.raises(FileError) as caught:
        read_profile(str(path))
    error = caught.value
    assert error.path == path
    assert said in error.problem
    assert error.remedy
    lines = path.read_text().splitlines()
    assert (None if error.line is None else lines[error.line - 1][: len(place or "")]) == place


@pytest.mark.parametrize(
    ("right", "written", "remedy"),
    [
        ("hardware_poll =", "hardware_pol =", "Did you mean hardware_poll?"),
        ("[model.icap]", "[model.icp]", "Did you mean icap?"),
        ("[model.memif]", "[model.streams]", "Correct model.streams; the shipped profiles show every key."),
    ],
)
def test_a_misspelt_key_is_told_what_it_may_have_been(
    tmp_path: Path, right: str, written: str, remedy: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(MINIITX.replace(right, written))
    with pytest.raises(FileError) as caught:
        read_profile(str(path))
    assert caught.value.remedy == remedy


def test_without_any_bitstream_size_a_model_is_of_no_use(tmp_path: Path) -> None:
    head, rest = MINIITX.split("# Table II;")
    path = tmp_path / "mine.toml"
    path.write_text(head + "[model.callbacks" + rest.split("[model.callbacks", 1)[1])
    with pytest.raises(FileError, match=r"model\.bitstreams: Field required"):
        read_profile(str(path))


def test_a_profile_cannot_be_changed() -> None:
    profile = read_profile("native")
    with pytest.raises(ValueError, match="frozen"):
        profile.name = "other"
    assert isinstance(profile, Profile)
