"""What a running ROS 2 gave: ROS 2 Kilted, rclpy 9.1.2 with rosidl 4.9.5."""

from __future__ import annotations

import pytest

from reconros_zenoh.errors import FileError
from reconros_zenoh.ros.definition_lines import Constant, Field, LineError, definition_line
from reconros_zenoh.ros.type_registry import TypeRegistry

DEFINITIONS = {
    "lab_msgs/msg/Sample": '# of a sensor\nuint8 RED = 0x10\nstring UNIT="m\\"s"\nbool[<=5] flags\n'
    "string<=7[3] names\n",
    "lab_msgs/srv/Scan": "char KEY=65\nSample[] samples\nfloat64[2] limits [-1.5, 2]\n---\nbyte state 3\n"
    "lab_msgs/Sample[<=4] best   # of them\n",
    "lab_msgs/action/Move": "int32 to 5\n---\n---\nstd_msgs/Header header\nuint64 step\n",
}


@pytest.fixture(scope="module")
def registry() -> TypeRegistry:
    registry = TypeRegistry()
    for name, text in DEFINITIONS.items():
        registry.add(name, text)
    return registry


def test_hashes_of_own_types(registry: TypeRegistry) -> None:
    hashes = [
        registry.message("lab_msgs/msg/Sample").type_hash,
        registry.service("lab_msgs/srv/Scan").type_hash,
        registry.action("lab_msgs/action/Move").type_hash,
        registry.message("lab_msgs/action/Move_FeedbackMessage").type_hash,
        registry.service("lab_msgs/action/Move_SendGoal").type_hash,
    ]
    assert hashes == [
        "RIHS01_0b7265ff28258f51218608c4ef470ff3c4dfcd5305e4693c0d9bd81b58eb10fd",
        "RIHS01_9c93f458c1e6de5c09f7db1075cfe8edd5e361c42bda76a41dea233686586e59",
        "RIHS01_80eea1cfea5657ff5259e7d467091fea68ae6c26d117c76ac655f7fb04c7f4f1",
        "RIHS01_310b56b64c974a6a34190d4455e85df69159b5757349b21be239abf3f155ca37",
        "RIHS01_5907785527d86ff5dc11367a446dc6bd9ef37c56b881e5c6145cde804e418be9",
    ]


def test_the_bytes_of_serialize_message_are_understood_with_what_follows_them(registry: TypeRegistry) -> None:
    kind = registry.message("sensor_msgs/msg/JointState")
    serialized = bytes.fromhex(
        "00010000feffffff070000000400000061726d000100000006000000656c626f77000000"
        "0000000000000000010000000000000000000000000000800000000000000000"
    )
    message = kind.decode(serialized)
    assert (message.header.stamp.sec, message.header.frame_id, message.name) == (-2, "arm", ["elbow"])
    assert str(message.effort) == "[-0.]"
    assert serialized == b"".join(kind.encode(message)) + bytes(8)


@pytest.mark.parametrize(
    ("line", "value"),
    [
        ("uint8 A=017", 17),
        ("uint8 A=0o17", 15),
        ("int16 A = -0b101", -5),
        ("uint32 A=1_000", 1000),
        ("bool A=FALSE", False),
        ("char A\t=\t65  # a letter", 65),
        ("float32 A=1e3", 1000.0),
        ("string A=  spaced   # comment", "spaced"),
        ("string A='  a '", "  a "),
        ('string A="a\\"b"', 'a"b'),
        ("string A='a # b'", "'a"),
        ('string A="a', '"a'),
        ("string A=", ""),
        ("string A_1B=a=b", "a=b"),
    ],
)
def test_constants(line: str, value: object) -> None:
    constant = definition_line("lab_msgs", line)
    assert isinstance(constant, Constant)
    assert (type(constant.value), constant.value) == (type(value), value)


@pytest.mark.parametrize(
    "line",
    [
        " uint8 indented",
        "uint8 camelCase",
        "uint8 a__b",
        "uint8 a.b",
        "std_msgs/msg/Header header",
        "std__msgs/Header header",
        "Foo_Bar a",
        "time a",
        "uint8[ 3] a",
        "uint8[<=] a",
        "uint8[3][2] a",
        "uint8<=3 a",
        "uint8 a 256",
        "uint8 a b c",
        "uint8[2] a 1",
        "uint8[2] a [1]",
        "uint8[<=2] a [1, 2, 3]",
        "string<=2 a abc",
        "Point a 0",
        "uint8 red=1",
        "uint8 A__B=1",
        "uint8[] A=[1]",
        "string<=5 A=a",
        "Point A=1",
        "bool A=yes",
        "uint8 A=1.0",
        "int8 A=128",
        "float32 A=1.0f",
        'string A="a"b"',
    ],
)
def test_lines_that_are_refused(line: str) -> None:
    with pytest.raises(LineError):
        definition_line("lab_msgs", line)


@pytest.mark.parametrize(
    "line",
    [
        "uint8 a +1",
        "uint8[] a []",
        "uint8[<=3] a [1,2]",
        "float64[2] a [.5, nan]",
        'string<=3 a "abc"',
        "string[2] a ['x, y', z]",
    ],
)
def test_defaults_are_read_over(line: str) -> None:
    field = definition_line("lab_msgs", line)
    assert isinstance(field, Field)
    assert field.name == "a"


def test_a_type_without_package_is_of_the_own_one_even_if_it_is_called_header(registry: TypeRegistry) -> None:
    registry.add("lab_msgs/msg/Frame", "Header header")
    registry.add("lab_msgs/msg/Header", "uint8 id")
    assert [
        name for name, _ in registry.message("lab_msgs/msg/Frame").nested("lab_msgs/msg/Header").fields
    ] == ["id"]


def test_a_separator_stands_alone_in_its_line(registry: TypeRegistry) -> None:
    with pytest.raises(FileError):
        registry.add("lab_msgs/srv/Wrong", "uint8 a\n--- \nuint8 b\n")
