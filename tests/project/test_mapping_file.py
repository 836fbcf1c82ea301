"""Mapping files: what they say and the line of each mistake."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.errors import FileError
from reconros_zenoh.project.build_cfg import read_build_cfg
from reconros_zenoh.project.mapping_file import CallbackMapping, ProjectMapping, read_mapping

if TYPE_CHECKING:
    from pathlib import Path

GOOD = """\
executor = "reconros"
software_workers = 2

[callbacks.sobel]
slots = [2, 3]

[callbacks.hash]
software = true
slots = [3]
"""


def read(tmp_path: Path, text: str) -> ProjectMapping:
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return read_mapping(path, {"sobel": (2, 3), "hash": (3,)}, (2, 3))


def test_a_mapping(tmp_path: Path) -> None:
    assert read(tmp_path, GOOD) == ProjectMapping(
        name="mine",
        executor="reconros",
        software_workers=2,
        hardware_workers=2,
        callbacks={
            "sobel": CallbackMapping(software=False, slots=(2, 3)),
            "hash": CallbackMapping(software=True, slots=(3,)),
        },
    )


@pytest.mark.parametrize("name", ["..", "a\nb", "\x1b[31m", "\udcff"])
def test_a_mapping_has_a_name_for_folders_and_drawings(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.toml"
    path.write_text(GOOD, encoding="utf-8")
    with pytest.raises(FileError, match="cannot name a mapping"):
        read_mapping(path, {"sobel": (2, 3), "hash": (3,)}, (2, 3))


def test_hardware_workers(tmp_path: Path) -> None:
    one_slot = GOOD.replace("slots = [2, 3]", "slots = [2]").replace("slots = [3]\n", "")
    assert read(tmp_path, "hardware_workers = 1\n" + one_slot).hardware_workers == 1


def test_the_standard_executor_has_no_hardware_workers(tmp_path: Path) -> None:
    software = "[callbacks.sobel]\nsoftware = true\n[callbacks.hash]\nsoftware = true\n"
    mapping = read(tmp_path, f'executor = "standard"\nsoftware_workers = 2\n{software}')
    assert (mapping.executor, mapping.hardware_workers) == ("standard", 0)


def test_without_a_file_what_can_be_in_hardware_is(tmp_path: Path) -> None:
    path = tmp_path / "build.cfg"
    path.write_text(
        "[General]\nName = x\nPartialReconfiguration = true\n"
        "[HwSlot@s(0:1)]\nId = 4\nReconfigurable = true\n"
        "Region_0 = SLICE_X0Y0:SLICE_X1Y1\nRegion_1 = SLICE_X2Y0:SLICE_X3Y1\n"
        "[HwSlot@fixed(0:0)]\nId = 9\n"
        "[ReconosThread@both]\nSlot = s(*), fixed(0)\nHwSource = hls\nSwSource = c\n"
        "[ReconosThread@soft]\nSlot = s(*)\nSwSource = c\n"
        "[ReconosThread@static]\nSlot = fixed(0)\nHwSource = hls\n"
        "[ReconosThread@late]\nSlot = fixed(0)\nHwSource = hls\nSwSource = c\n"
        "[ReconosThread@nowhere]\nHwSource = hls\n",
        encoding="utf-8",
    )
    assert ProjectMapping.default(read_build_cfg(path)) == ProjectMapping(
        name="default",
        executor="reconros",
        software_workers=2,
        hardware_workers=3,
        callbacks={
            "both": CallbackMapping(slots=(4, 5)),
            "soft": CallbackMapping(software=True),
            "static": CallbackMapping(slots=(9,)),
            "late": CallbackMapping(software=True),
            "nowhere": CallbackMapping(software=True),
        },
    )


def test_without_a_file_who_has_the_slots_of_a_callback_that_can_be_nowhere_else_is_named(
    tmp_path: Path,
) -> None:
    path = tmp_path / "build.cfg"
    path.write_text(
        "[General]\nName = x\nPartialReconfiguration = true\n"
        "[HwSlot@s(0:0)]\nId = 4\nReconfigurable = true\nRegion_0 = SLICE_X0Y0:SLICE_X1Y1\n"
        "[HwSlot@fixed(0:0)]\nId = 9\n"
        "[ReconosThread@first]\nSlot = fixed(0)\nHwSource = hls\n"
        "[ReconosThread@late]\nSlot = s(0), fixed(0)\nHwSource = hls\n"
        "[ROSGateway@g]\nSlot = s(0)\nHWTopic = /a\nSWTopic = /a\nMsgType = std_msgs/UInt32\n",
        encoding="utf-8",
    )
    with pytest.raises(FileError) as refused:
        ProjectMapping.default(read_build_cfg(path))
    assert refused.value.line == 13
    assert (
        "The callback late has no slot left, and no SwSource: s(0) is that of the gateway g (line 16) and "
        "fixed(0) is that of the callback first (line 10)."
    ) in str(refused.value)


MISTAKES = {
    "syntax": (GOOD.replace("= 2\n", "= \n"), 2, "TOML"),
    "unknown key": ("workers = 2\n" + GOOD, 1, "workers: unknown key. Known keys: callbacks, executor"),
    "name": ('name = "x"\n' + GOOD, 1, "unknown key"),
    "unknown key of a callback": (GOOD + "slot = 1\n", 10, "Known keys: slots, software"),
    "misspelt key": (GOOD.replace("software_w", "softwarew"), 2, "softwareworkers: unknown key. Known keys:"),
    "slots that are no list": (GOOD.replace("[2, 3]", "2"), 5, "slots: Input should be a valid list"),
    "unknown executor": (GOOD.replace("reconros", "other"), 1, "'reconros' or 'standard'"),
    "no executor": (GOOD.split("\n", 1)[1], None, "executor: Field required"),
    "no workers": (GOOD.replace("software_workers = 2\n", ""), None, "software_workers: Field required"),
    "a hundred million workers": (GOOD.replace("= 2", "= 100000000"), 2, "less than or equal to 1000"),
    "negative workers": (GOOD.replace("= 2", "= -2"), 2, "software_workers"),
    "negative hardware workers": ("hardware_workers = -1\n" + GOOD, 1, "hardware_workers"),
    "workers that are no number": (GOOD.replace("= 2", "= true"), 2, "valid integer"),
    "software that is no boolean": (GOOD.replace("true", '"yes"'), 8, "valid boolean"),
    "slot that is no number": (GOOD.replace("[2, 3]", '["RS2"]'), 5, "valid integer"),
    "unknown callback": (GOOD.replace("sobel", "sobol"), 4, "'sobol'. Its callbacks: sobel, hash."),
    "unknown slot": (GOOD.replace("[2, 3]", "[2, 4]"), 5, "unknown slot 4. Known slots: 2, 3."),
    "slot that it is not built for": (
        GOOD.replace("[3]", "[2, 3]"),
        9,
        "slot 2, which its thread is not built for. It is built for: 3;",
    ),
    "no place": (GOOD.replace("slots = [2, 3]", "software = false"), 4, "no place"),
    "callback not mapped": (
        GOOD.split("[callbacks.hash]", maxsplit=1)[0],
        None,
        "'hash' of the project is not mapped",
    ),
    "hardware under the standard executor": (GOOD.replace("reconros", "standard"), 5, "knows only software"),
    "no software workers": (GOOD.replace("= 2", "= 0"), 8, "0 software workers"),
    "more hardware workers than slots": (
        "hardware_workers = 3\n" + GOOD,
        1,
        "hardware_workers = 3 is more than the slots of the project: 2",
    ),
    "hardware workers under the standard executor": (
        'hardware_workers = 1\nexecutor = "standard"\n' + GOOD.split("\n", 1)[1],
        1,
        "standard executor has no hardware workers",
    ),
    "slot that no worker serves": (
        "hardware_workers = 1\n" + GOOD,
        6,
        "sobel is mapped to slot 3, which no hardware worker serves; they serve 2.",
    ),
    "no hardware workers": ("hardware_workers = 0\n" + GOOD, 6, "no hardware worker serves; they serve none"),
}


@pytest.mark.parametrize(("text", "line", "problem"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_reported_with_its_line(
    tmp_path: Path, text: str, line: int | None, problem: str
) -> None:
    with pytest.raises(FileError) as caught:
        read(tmp_path, text)
    assert caught.value.line == line
    assert problem in str(caught.value)
    assert caught.value.remedy


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be read"):
        read_mapping(tmp_path / "none.toml", {}, ())
