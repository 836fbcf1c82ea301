"""The parameters of a node over its services, as `ros2 param` uses them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from two_sessions import TwoSessions, types

from reconros_zenoh.errors import UsageError
from reconros_zenoh.rmw import parameters as parameters_module
from reconros_zenoh.rmw.parameters import Parameters
from reconros_zenoh.ros.graph import EndpointKind, EndpointToken, parse
from reconros_zenoh.ros.qos import QosProfile
from reconros_zenoh.ros.zero_message import zero_message

VALUES: dict[str, Any] = {
    "flag": True,
    "count": 3,
    "gain.x": 0.5,
    "gain.inner.y": 1.5,
    "name": "left",
    "raw": b"\1\2",
    "flags": [True, False],
    "counts": [1, 2],
    "gains": [0.5],
    "names": ["a", "b"],
    "none": [],
}
KINDS = [1, 2, 3, 3, 4, 5, 6, 7, 8, 9, 9]


class Remote:
    """A node /arm/motor with parameters here, and clients of its services there."""

    def __init__(self) -> None:
        self.sessions = TwoSessions()
        self.parameters = Parameters(self.sessions.here.node("motor", "/arm"), types())
        self._client = self.sessions.there.node("remote")

    def ask(self, service: str, **fields: Any) -> Any:
        snake = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in service)[1:]
        service_type = types().service(f"rcl_interfaces/srv/{service}")
        answers: list[Any] = []
        request = service_type.request.cls(**fields)
        self._client.client(service_type, f"/arm/motor/{snake}").call(request, answers.append, 10**9)
        self.sessions.settle()
        (answer,) = answers
        return answer

    def set(self, service: str, **values: Any) -> Any:
        parameter = types().message("rcl_interfaces/msg/Parameter")
        scratch = Parameters(TwoSessions().here.node("scratch"), types())
        for name, value in values.items():
            scratch.declare(name, value)
        made = [parameter.cls(name=name, value=scratch._message(name)) for name in values]
        return self.ask(service, parameters=made)


@pytest.fixture
def remote() -> Remote:
    remote = Remote()
    for name, value in VALUES.items():
        remote.parameters.declare(name, value, description=f"the {name}")
    return remote


def test_values_and_their_types(remote: Remote) -> None:
    names = list(VALUES)
    values = remote.ask("GetParameters", names=names).values
    assert [value.type for value in values] == KINDS
    assert values[0].bool_value is True
    assert values[1].integer_value == 3
    assert values[4].string_value == "left"
    assert values[5].byte_array_value.tolist() == [1, 2]
    assert values[6].bool_array_value.tolist() == [True, False]
    assert values[9].string_array_value == ["a", "b"]
    assert remote.ask("GetParameterTypes", names=names).types.tolist() == KINDS
    described = remote.ask("DescribeParameters", names=names).descriptors
    assert [(d.name, d.type, d.description) for d in described[:1]] == [("flag", 1, "the flag")]


def test_nothing_is_answered_when_one_of_the_names_is_not_declared(remote: Remote) -> None:
    # as a node of rclpy 9.1.2 (ROS 2 Kilted) answers
    names = ["flag", "nothing", "count"]
    assert remote.ask("GetParameters", names=names).values == []
    assert remote.ask("GetParameterTypes", names=names).types.tolist() == []
    assert remote.ask("DescribeParameters", names=names).descriptors == []


@pytest.mark.parametrize(
    ("prefixes", "depth", "names"),
    [
        ([], 0, list(VALUES)),
        ([], 1, [name for name in VALUES if "." not in name]),
        (["gain"], 0, ["gain.x", "gain.inner.y"]),
        (["gain"], 1, ["gain.x"]),
        (["gain.inner", "flag"], 0, ["flag", "gain.inner.y"]),
        (["gai"], 0, []),
        (["gain.x", "flag"], 1, ["flag", "gain.x"]),
        ([""], 0, []),
        (["", "gain"], 1, ["gain.x"]),
    ],
)
def test_the_list(remote: Remote, prefixes: list[str], depth: int, names: list[str]) -> None:
    result = remote.ask("ListParameters", prefixes=prefixes, depth=depth).result
    assert result.names == names
    assert set(result.prefixes) == {name.rpartition(".")[0] for name in names if "." in name}


def test_a_parameter_may_be_declared_while_another_thread_lists_them(
    remote: Remote, monkeypatch: pytest.MonkeyPatch
) -> None:
    def is_listed(name: str, *_: object) -> bool:
        if name == "flag":
            remote.parameters.declare("new", 1)  # as another thread may, at this very moment
        return True

    monkeypatch.setattr(parameters_module, "_is_listed", is_listed)
    assert remote.ask("ListParameters", prefixes=[], depth=0).result.names == list(VALUES)


def test_setting(remote: Remote) -> None:
    results = remote.set("SetParameters", count=7, flag=5, unknown=1).results
    assert [result.successful for result in results] == [True, False, False]
    assert "'flag' is bool, not int" in results[1].reason
    assert "'unknown' is not declared" in results[2].reason
    assert (remote.parameters.get("count"), remote.parameters.get("flag")) == (7, True)
    for name, value in VALUES.items():
        if "." not in name:
            assert remote.set("SetParameters", **{name: value}).results[0].successful
            assert remote.parameters.get(name) == value


def test_an_empty_list_is_one_of_the_type_that_the_parameter_was_declared_with(remote: Remote) -> None:
    assert remote.set("SetParameters", counts=[]).results[0].successful
    assert remote.ask("GetParameterTypes", names=["counts"]).types.tolist() == [7]
    assert remote.set("SetParameters", counts=[3]).results[0].successful
    assert remote.parameters.get("counts") == [3]
    refused = remote.set("SetParameters", count=[]).results[0]
    assert (refused.successful, refused.reason) == (False, "parameter 'count' is int, not list.")
    assert remote.parameters.get("count") == 3


def test_setting_all_or_none(remote: Remote) -> None:
    assert not remote.set("SetParametersAtomically", count=7, flag=5).result.successful
    assert remote.parameters.get("count") == 3
    assert remote.set("SetParametersAtomically", count=7, flag=False).result.successful
    assert (remote.parameters.get("count"), remote.parameters.get("flag")) == (7, False)


def test_each_value_counts_of_a_parameter_that_is_set_twice_at_once(remote: Remote) -> None:
    parameter = types().message("rcl_interfaces/msg/Parameter").cls
    wrong, right = (
        parameter(name="count", value=remote.parameters._message(name)) for name in ("flag", "count")
    )
    assert not remote.ask("SetParametersAtomically", parameters=[wrong, right]).result.successful


def test_a_callback_may_refuse_a_value() -> None:
    remote = Remote()
    told: list[int] = []

    def on_set(value: int) -> None:
        told.append(value)
        if value < 0:
            raise UsageError("not below 0")

    remote.parameters.declare("count", 1, on_set)
    results = [remote.set("SetParameters", count=value).results[0] for value in (-1, 2)]
    assert [(result.successful, result.reason) for result in results] == [(False, "not below 0"), (True, "")]
    assert (told, remote.parameters.get("count")) == ([-1, 2], 2)
    with pytest.raises(UsageError, match="not below 0"):
        remote.parameters.set("count", -5)


def test_a_callback_that_fails_refuses_the_value_and_says_why() -> None:
    remote = Remote()
    remote.parameters.declare("share", 1, lambda value: divmod(1, value))
    result = remote.set("SetParameters", share=0).results[0]
    assert not result.successful
    assert result.reason.startswith("on_set of parameter 'share' failed: ZeroDivisionError(")
    assert remote.parameters.get("share") == 1


def test_a_callback_that_changes_parameters_itself_refuses_the_value() -> None:
    remote = Remote()
    parameters = remote.parameters
    parameters.declare("other", 1)
    parameters.declare("setting", 1, lambda value: parameters.set("other", value))
    parameters.declare("declaring", 1, lambda value: parameters.declare("new", value))
    for name in ("setting", "declaring"):
        with pytest.raises(UsageError, match="on_set cannot declare or set a parameter"):
            parameters.set(name, 2)
    refused = remote.set("SetParametersAtomically", other=3, setting=3).result
    assert not refused.successful
    assert "on_set cannot" in refused.reason
    assert [parameters.get(name) for name in ("other", "setting", "declaring")] == [1, 1, 1]
    parameters.set("other", 4)
    assert parameters.get("other") == 4


def test_what_cannot_be_unset(remote: Remote) -> None:
    unset = zero_message(types().message("rcl_interfaces/msg/Parameter"))
    unset.name = "count"
    assert not remote.ask("SetParameters", parameters=[unset]).results[0].successful


@pytest.mark.parametrize("value", [None, [1, "a"], {}, np.float32(1), [None], 2**63, [0, -(2**63) - 1]])
def test_what_no_parameter_can_be(value: Any) -> None:
    parameters = Remote().parameters
    with pytest.raises(UsageError, match="cannot be"):
        parameters.declare("x", value)
    parameters.declare("x", [2**63 - 1, -(2**63)])


@pytest.mark.parametrize("name", ["", 5, None])
def test_what_is_no_name_of_a_parameter(name: Any) -> None:
    remote = Remote()
    with pytest.raises(UsageError, match=f"{name!r} is no name of a parameter"):
        remote.parameters.declare(name, 1)
    assert remote.ask("ListParameters", prefixes=[], depth=0).result.names == []


def test_declared_twice(remote: Remote) -> None:
    with pytest.raises(UsageError, match="declared already"):
        remote.parameters.declare("flag", False)


class Heard:
    """What comes on /parameter_events in the other session: new and changed parameters, by node."""

    def __init__(self, remote: Remote) -> None:
        self._remote = remote
        self._events: list[Any] = []
        remote.sessions.there.node("listener").subscription(
            types().message("rcl_interfaces/msg/ParameterEvent"),
            "/parameter_events",
            lambda received: self._events.append(received.message),
        )
        remote.sessions.settle()

    def take(self) -> list[tuple[str, list[str], list[str]]]:
        self._remote.sessions.settle()
        events, self._events[:] = list(self._events), []
        return [
            (
                event.node,
                [parameter.name for parameter in event.new_parameters],
                [
                    f"{parameter.name}={parameter.value.integer_value}"
                    for parameter in event.changed_parameters
                ],
            )
            for event in events
        ]


def test_what_is_declared_and_set_is_published() -> None:
    remote = Remote()
    heard = Heard(remote)
    for name in ("a", "b"):
        remote.parameters.declare(name, 1)
    assert heard.take() == [("/arm/motor", ["a"], []), ("/arm/motor", ["b"], [])]
    remote.parameters.set("a", 2)
    assert heard.take() == [("/arm/motor", [], ["a=2"])]
    remote.set("SetParameters", a=3, b=4)
    assert heard.take() == [("/arm/motor", [], ["a=3"]), ("/arm/motor", [], ["b=4"])]
    remote.set("SetParametersAtomically", a=5, b=6)
    assert heard.take() == [("/arm/motor", [], ["a=5", "b=6"])]


def test_what_is_refused_is_not_published() -> None:
    remote = Remote()
    remote.parameters.declare("a", 1)
    heard = Heard(remote)
    remote.set("SetParameters", a="word", unknown=1)
    remote.set("SetParametersAtomically", a=2, unknown=1)
    remote.ask("SetParametersAtomically", parameters=[])
    with pytest.raises(UsageError):
        remote.parameters.set("a", "word")
    assert heard.take() == []


def test_an_event_has_the_time_of_its_nodes_clock_and_the_qos_of_ros_2() -> None:
    remote = Remote()
    stamps: list[tuple[int, int]] = []
    remote.sessions.there.node("listener").subscription(
        types().message("rcl_interfaces/msg/ParameterEvent"),
        "/parameter_events",
        lambda received: stamps.append((received.message.stamp.sec, received.message.stamp.nanosec)),
    )
    remote.sessions.settle()
    remote.sessions.here_ns = 3_000_000_007
    remote.parameters.declare("a", 1)
    remote.sessions.settle()
    assert stamps == [(3, 7)]
    (publisher,) = (
        token
        for token in map(parse, remote.sessions.tokens())
        if isinstance(token, EndpointToken) and token.kind is EndpointKind.PUBLISHER
    )
    assert (publisher.name, publisher.qos) == ("/parameter_events", QosProfile(depth=1000))


def test_who_hears_of_a_parameter_within_the_call_may_set_another(monkeypatch: pytest.MonkeyPatch) -> None:
    remote = Remote()
    parameters = remote.parameters
    for name in ("a", "b"):
        parameters.declare(name, 1)

    def follow(event: Any) -> None:
        if [parameter.name for parameter in event.changed_parameters] == ["a"]:
            parameters.set("b", parameters.get("a"))

    monkeypatch.setattr(parameters._events, "publish", follow)  # as a transport may deliver in one session
    parameters.set("a", 2)
    assert parameters.get("b") == 2
