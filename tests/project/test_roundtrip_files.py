"""The project files of the round-trip application, against the facts of the experiment."""

from __future__ import annotations

from pathlib import Path

import pytest

import reconros_zenoh.applications.roundtrip
from reconros_zenoh.project.build_cfg import BuildConfiguration, read_build_cfg
from reconros_zenoh.project.interfaces import read_interfaces
from reconros_zenoh.project.mapping_file import ProjectMapping, built_for, read_mapping
from reconros_zenoh.project.resources import SlotResources, slot_resources

PROJECT = Path(reconros_zenoh.applications.roundtrip.__path__[0])


@pytest.fixture(scope="module")
def configuration() -> BuildConfiguration:
    return read_build_cfg(PROJECT / "build.cfg")


def mapping(configuration: BuildConfiguration, name: str) -> ProjectMapping:
    return read_mapping(
        PROJECT / "mappings" / f"{name}.toml",
        built_for(configuration),
        [slot.id for slot in configuration.slots],
    )


def test_the_file_is_clean(configuration: BuildConfiguration) -> None:
    assert configuration.warnings == ()
    assert (configuration.name, configuration.part) == ("roundtrip", "xc7z100ffg900-2")
    assert configuration.partial_reconfiguration


def test_the_slots_are_those_of_table_2(configuration: BuildConfiguration) -> None:
    assert {slot.id: slot_resources(slot.regions) for slot in configuration.slots} == {
        0: SlotResources(20800, 160, 60, 120),
        1: SlotResources(20800, 160, 60, 120),
        2: SlotResources(41600, 320, 120, 240),
        3: SlotResources(40800, 280, 100, 200),
    }
    clocks = {clock.name: clock.hz for clock in configuration.clocks}
    assert {clocks[slot.clock or ""] for slot in configuration.slots} == {120_000_000}
    assert clocks[configuration.system_clock or ""] == 100_000_000
    assert all(slot.reconfigurable for slot in configuration.slots)


def test_what_each_callback_is_bound_to(configuration: BuildConfiguration) -> None:
    bound = {
        thread.name: [
            (resource.name, resource.ros_name, resource.interface, resource.number)
            for resource in configuration.resources
            if resource.group in thread.resource_groups and resource.name in {"sub", "srv", "tmr", "pub"}
        ]
        for thread in configuration.threads
    }
    assert bound == {
        "inverse": [
            ("sub", "/angle", "std_msgs/msg/UInt32", None),
            ("pub", "legangle", "std_msgs/msg/UInt32", None),
        ],
        "mnist": [
            ("sub", "/image_classification", "sensor_msgs/msg/Image", None),
            ("pub", "class", "std_msgs/msg/UInt32", None),
        ],
        "sobel": [
            ("sub", "/image_raw", "sensor_msgs/msg/Image", None),
            ("pub", "filtered", "sensor_msgs/msg/Image", None),
        ],
        "sort": [("srv", "sorter", "sorter_msgs/srv/Sort", None)],
        "hash": [
            ("tmr", None, None, 250),
            ("pub", "hash", "std_msgs/msg/UInt32MultiArray", None),
        ],
    }


def test_the_sort_service() -> None:
    texts = read_interfaces(PROJECT).texts
    assert texts == {"sorter_msgs/srv/Sort": "uint32[] unsorted\n---\nuint32[] sorted\n"}


@pytest.mark.parametrize(
    ("name", "executor", "slots"),
    [
        ("all_software", "standard", {}),
        ("mixed", "reconros", {"inverse": (0,), "sort": (1,), "mnist": (2,), "sobel": (3,)}),
        (
            "all_hardware",
            "reconros",
            {"inverse": (0,), "sort": (1,), "mnist": (2, 3), "sobel": (2, 3), "hash": (3,)},
        ),
    ],
)
def test_the_mappings_of_the_experiment(
    configuration: BuildConfiguration, name: str, executor: str, slots: dict[str, tuple[int, ...]]
) -> None:
    read = mapping(configuration, name)
    assert (read.name, read.executor, read.software_workers) == (name, executor, 2)
    for thread in configuration.threads:
        place = read.callbacks[thread.name]
        assert place.slots == slots.get(thread.name, ())
        assert place.software == (thread.name not in slots)
        assert set(place.slots) <= set(thread.slots)
