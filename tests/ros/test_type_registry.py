"""The registry of message and service types, and the hashes of types."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from reconros_zenoh.errors import FileError, UsageError
from reconros_zenoh.ros.type_registry import TypeRegistry
from reconros_zenoh.ros.zero_message import zero_message

if TYPE_CHECKING:
    from reconros_zenoh.ros.types import MessageType

SORT = "# What the sorter does\nuint32[] unsorted\n---\nuint32[] sorted\n"


@pytest.fixture
def registry() -> TypeRegistry:
    return TypeRegistry()


def field_names(kind: MessageType) -> list[str]:
    # rosbags 0.11 lets the class variable `__msgtype__` become a field.
    return [field.name for field in dataclasses.fields(kind.cls) if field.name != "__msgtype__"]


def test_importing_the_types_loads_neither_zenoh_nor_the_types_of_jazzy() -> None:
    source = (
        "import sys\n"
        "from reconros_zenoh.ros import attachment, graph, names, qos, type_registry\n"
        "type_registry.TypeRegistry()\n"
        "print([m for m in sys.modules if m.split('.')[0] == 'zenoh' or m.endswith('ros2_jazzy')])"
    )
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# Hashes of std_msgs/String and of the services are from the reference, those of the others were seen in keys
# of rmw_zenoh and in the type descriptions that ROS 2 ships.
@pytest.mark.parametrize(
    ("name", "type_hash"),
    [
        ("std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        ("std_msgs/msg/UInt64MultiArray", "fc1c685c2f76bdc6983da025cb25d2db5fb5157b059e300f6d957d86f981b366"),
        ("sensor_msgs/msg/PointCloud2", "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"),
        ("sensor_msgs/msg/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
        (
            "service_msgs/msg/ServiceEventInfo",
            "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45",
        ),
    ],
)
def test_hashes_of_messages(registry: TypeRegistry, name: str, type_hash: str) -> None:
    assert registry.message(name).type_hash == f"RIHS01_{type_hash}"


def test_hashes_of_services(registry: TypeRegistry) -> None:
    registry.add_service("example_interfaces/srv/AddTwoInts", "int64 a\nint64 b\n---\nint64 sum\n")
    assert registry.service("example_interfaces/srv/AddTwoInts").type_hash.startswith("RIHS01_e118de6b")
    assert registry.service("std_srvs/srv/SetBool").type_hash.startswith("RIHS01_abe9e4bb")


@pytest.mark.parametrize(
    ("spelling", "name"),
    [
        ("std_msgs/msg/UInt32", "std_msgs/msg/UInt32"),
        ("std_msgs/UInt32", "std_msgs/msg/UInt32"),
        ("std_msgs/U_Int32", "std_msgs/msg/UInt32"),
        ("std_msgs/msg/U_Int32", "std_msgs/msg/UInt32"),
        ("std_msgs/Uint32", "std_msgs/msg/UInt32"),
        ("std_msgs/msg/U_Int32_Multi_Array", "std_msgs/msg/UInt32MultiArray"),
        ("sensor_msgs/msg/Point_Cloud2", "sensor_msgs/msg/PointCloud2"),
        ("sorter_msgs/srv/Sort_Request", "sorter_msgs/srv/Sort_Request"),
    ],
)
def test_spellings_of_a_message(registry: TypeRegistry, spelling: str, name: str) -> None:
    registry.add_service("sorter_msgs/srv/Sort", SORT)
    found = registry.message(spelling)
    assert found.name == name
    assert found is registry.message(name)


@pytest.mark.parametrize("spelling", ["std_srvs/srv/SetBool", "std_srvs/SetBool", "std_srvs/Set_Bool"])
def test_spellings_of_a_service(registry: TypeRegistry, spelling: str) -> None:
    found = registry.service(spelling)
    assert found.name == "std_srvs/srv/SetBool"
    assert found.dds_name == "std_srvs::srv::dds_::SetBool_"
    assert found is registry.service("std_srvs/srv/SetBool")


def test_a_service_has_its_request_and_response(registry: TypeRegistry) -> None:
    registry.add_service("sorter_msgs/srv/Sort", SORT)
    sort = registry.service("sorter_msgs/srv/Sort")
    assert sort.dds_name == "sorter_msgs::srv::dds_::Sort_"
    assert sort.request.dds_name == "sorter_msgs::srv::dds_::Sort_Request_"
    assert sort.response.name == "sorter_msgs/srv/Sort_Response"
    assert field_names(sort.request) == ["unsorted"]
    assert field_names(sort.response) == ["sorted"]
    assert sort.type_hash not in {sort.request.type_hash, sort.response.type_hash}


@pytest.mark.parametrize("name", ["std_srvs/srv/Trigger", "std_srvs/srv/Empty"])
def test_an_empty_structure_has_one_member_on_the_wire(registry: TypeRegistry, name: str) -> None:
    request = registry.service(name).request
    assert field_names(request) == ["structure_needs_at_least_one_member"]
    assert request.encode(request.cls()) == (bytes.fromhex("0001000000"),)
    assert request.decode(bytes.fromhex("0001000000")) == request.cls()


def test_trigger_and_empty_have_the_hashes_of_ros_2(registry: TypeRegistry) -> None:
    # ros2_pyterfaces, an independent implementation, gives the same.
    assert registry.service("std_srvs/Trigger").type_hash == (
        "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
    )
    assert registry.service("std_srvs/Empty").type_hash == (
        "RIHS01_5888399dedec5ccc85ea6451949fd2c9f97bfdf963f9a588821639fcd31b5d19"
    )


def test_own_messages_refer_to_each_other_in_any_order(registry: TypeRegistry) -> None:
    registry.add_message("lab_msgs/msg/Scan", "Sample[] samples\nstd_msgs/Header header\n")
    with pytest.raises(UsageError, match="'samples' of lab_msgs/msg/Scan has the type lab_msgs/msg/Sample"):
        registry.message("lab_msgs/msg/Scan")
    registry.add_message("lab_msgs/msg/Sample", "float32 RANGE=4.5\r\nfloat32 value  # in metres\r\n\r\n")
    scan, sample = registry.message("lab_msgs/Scan"), registry.message("lab_msgs/Sample")
    assert sample.cls.RANGE == 4.5
    assert field_names(scan) == ["samples", "header"]


def test_a_service_of_unknown_types_is_refused_when_it_is_used(registry: TypeRegistry) -> None:
    registry.add_service("lab_msgs/srv/Scan", "---\nSample[<=4] samples\n")
    with pytest.raises(UsageError, match=r"which is not known\. Correct its name or give its \.msg file"):
        registry.service("lab_msgs/srv/Scan")


def test_a_message_cannot_contain_itself(registry: TypeRegistry) -> None:
    registry.add_message("lab_msgs/msg/Tree", "Branch[] branches\n")
    registry.add_message("lab_msgs/msg/Branch", "Tree tree\n")
    with pytest.raises(UsageError, match="'tree' of lab_msgs/msg/Branch contains lab_msgs/msg/Branch itself"):
        registry.message("lab_msgs/msg/Tree")


def test_a_message_has_nineteen_levels_of_messages_at_most(registry: TypeRegistry) -> None:
    registry.add_message("lab_msgs/msg/Doll0", "string[] names")
    for number in range(1, 21):
        registry.add_message(f"lab_msgs/msg/Doll{number}", f"Doll{number - 1}[1] inside\nuint8 size")
    kind = registry.message("lab_msgs/Doll19")
    message = zero_message(kind)
    assert kind.decode(b"".join(kind.encode(message))) == message
    with pytest.raises(UsageError, match="lab_msgs/msg/Doll20 has more than 19 levels of messages"):
        registry.message("lab_msgs/Doll20")


def test_adding_a_type_again(registry: TypeRegistry) -> None:
    registry.add_service("sorter_msgs/srv/Sort", SORT)
    registry.add_service("sorter_msgs/srv/Sort", SORT)
    registry.add_message("std_msgs/msg/Char", "char data")
    with pytest.raises(FileError, match="already present with different definition"):
        registry.add_service("sorter_msgs/srv/Sort", "uint32[] numbers\n---\nuint32[] numbers\n")
    with pytest.raises(FileError, match="std_msgs/msg/UInt32: cannot be added"):
        registry.add_message("std_msgs/msg/UInt32", "uint64 data")
    with pytest.raises(FileError, match="The name a stands twice"):
        registry.add_message("lab_msgs/msg/Twice", "uint32 a\nuint32 a")


def test_char_is_uint8_as_rosidl_has_it(registry: TypeRegistry) -> None:
    registry.add_message("lab_msgs/msg/A", "char one\nchar[] many\nchar[3] three")
    registry.add_message("lab_msgs/msg/B", "uint8 one\nuint8[] many\nuint8[3] three")
    fields = registry._store.fielddefs
    assert fields["lab_msgs/msg/A"] == fields["lab_msgs/msg/B"]


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("UInt32", "package/msg/Type"),
        ("", "package/msg/Type"),
        ("std_msgs/msg/UInt33", "similar are std_msgs/msg/UInt32"),
        ("std_msgs/srv/UInt32", "package/msg/Type"),
        ("std_msgs/msg/sub/UInt32", "package/msg/Type"),
        ("sorter_msgs/srv/Sort", "similar are sorter_msgs/srv/Sort_"),
    ],
)
def test_unknown_messages(registry: TypeRegistry, name: str, remedy: str) -> None:
    registry.add_service("sorter_msgs/srv/Sort", SORT)
    with pytest.raises(UsageError, match="is not known") as caught:
        registry.message(name)
    assert remedy in str(caught.value)


def test_a_message_is_no_service(registry: TypeRegistry) -> None:
    registry.add_service("sorter_msgs/srv/Sort", SORT)
    for name in ("std_msgs/msg/UInt32", "sorter_msgs/srv/Sort_Request", "std_msgs/UInt32"):
        with pytest.raises(UsageError, match=r"is not known.* give its \.srv file"):
            registry.service(name)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("uint32 a\n---\n", 2),
        ("uint32\n", 1),
        ("\n\n uint32 indented\n", 3),
        ("=" * 80 + "\nMSG: lab_msgs/msg/Other\nuint8 a\n", 1),
    ],
)
def test_a_line_that_cannot_be_understood_is_named(registry: TypeRegistry, text: str, line: int) -> None:
    with pytest.raises(FileError, match="neither a field, a constant nor a comment") as caught:
        registry.add_message("lab_msgs/msg/Wrong", text)
    assert caught.value.line == line
    assert caught.value.path == "lab_msgs/msg/Wrong"


@pytest.mark.parametrize(
    "field",
    ["uint8[0] a", "uint8[-3] a", "uint8[<=0] a", "string<=0 a", "string<=3[00] a", "string<=-1[] a"],
)
def test_a_size_below_one_is_refused_as_ros_2_does(registry: TypeRegistry, field: str) -> None:
    with pytest.raises(FileError, match="a size or bound is below 1") as caught:
        registry.add_message("lab_msgs/msg/Wrong", f"uint8 b\n{field}")
    assert caught.value.line == 2


def test_a_zero_elsewhere_is_no_size(registry: TypeRegistry) -> None:
    registry.add_message("lab_msgs/msg/Right", "#[0]\nstring C=a<=0\nuint8[10] a # [0]\nuint8[<=05] b\n")
    assert registry.message("lab_msgs/Right").cls.C == "a<=0"


CONSTANTS: dict[str, object] = {
    "uint8 C=255": 255,
    "byte C=0xff": 255,
    "int8 C=-128 # lowest": -128,
    "bool C=1": True,
    "float32 C=3": 3.0,
    "float64 C=-.5e-3": -0.0005,
    "string C=1.50 # of firmware": "1.50",
    "string C=true": "true",
    "string C=a=b": "a=b",
}


@pytest.mark.parametrize(("line", "value"), CONSTANTS.items())
def test_a_constant_is_of_its_type(registry: TypeRegistry, line: str, value: object) -> None:
    registry.add_message("lab_msgs/msg/Right", f"uint8 a\n{line}\n")
    constant = registry.message("lab_msgs/Right").cls.C
    assert (type(constant), constant) == (type(value), value)


@pytest.mark.parametrize(
    "line",
    [
        "uint8 C=256",
        "char C=-1",
        "int8 C=one",
        "int8 C = 1 2",
        "uint8 C=[1, 2]",
        "uint8 C=1.5",
        "bool C=maybe",
        "bool C=2",
        "float32 C=inf",
        'string C="a"b"',
    ],
)
def test_a_constant_of_another_type_is_named(registry: TypeRegistry, line: str) -> None:
    with pytest.raises(FileError, match="is no value of the constant C") as caught:
        registry.add_message("lab_msgs/msg/Wrong", f"uint8 a\n{line}\n")
    assert caught.value.line == 2


def test_lines_of_a_service_are_counted_through(registry: TypeRegistry) -> None:
    with pytest.raises(FileError) as caught:
        registry.add_service("lab_msgs/srv/Wrong", "uint32 a\n---\nuint32 b\nwrong\n")
    assert caught.value.line == 4


@pytest.mark.parametrize(("text", "line"), [("uint32 a\n", None), ("---\n---\n", 2)])
def test_a_service_has_one_separator(registry: TypeRegistry, text: str, line: int | None) -> None:
    with pytest.raises(FileError, match="exactly 1") as caught:
        registry.add_service("lab_msgs/srv/Wrong", text)
    assert caught.value.line == line


@pytest.mark.parametrize(
    "name",
    [
        "Scan",
        "lab_msgs/Scan",
        "lab_msgs/msg/scan",
        "lab_msgs/msg/Sc_an",
        "lab_msgs/srv/Scan",
        "Lab/msg/Scan",
        "lab__msgs/msg/Scan",
        "lab_/msg/Scan",
        "lab_msgs/msg/Scan\nuint8 a",
    ],
)
def test_names_of_own_messages(registry: TypeRegistry, name: str) -> None:
    with pytest.raises(UsageError, match="cannot be the name of a type"):
        registry.add_message(name, "uint32 data")
    with pytest.raises(UsageError, match="cannot be the name of a type"):
        registry.add_service(name.replace("/srv/", "/msg/"), "---")
