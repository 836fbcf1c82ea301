"""Reading Compose files."""

from __future__ import annotations

import string
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

import deploy
from deploy.compose import ComposeService, Deployment, Healthcheck, StartCondition, duration_ns, read_compose
from reconros_zenoh.errors import FileError
from reconros_zenoh.yaml_node import YamlNode

if TYPE_CHECKING:
    from collections.abc import Callable

SHIPPED = Path(deploy.__file__).parent

COMPLETE = """\
name: demo
networks: {board: {}}
x-notes:
  note: $not replaced
services:
  router:
    image: some/image
    build: {context: ..}
    container_name: router
    ports: ["7447:7447"]
    init: true
    networks: [board]
    x-note: anything
    command: reconros router --name "${NAME:-first router}" $$HOME
    environment:
      - MODE=$MODE
      - INHERITED
      - ABSENT
    healthcheck:
      test: [CMD, reconros, status, "${NAME}"]
      interval: 1m30s
      timeout: 1.5s
      retries: ${RETRIES:-7}
      start_period: 500ms
  board:
    command: [python3, -c, "print(1)"]
    environment: {COUNT: 3, RATE: 0.5, INHERITED: , ABSENT: , EMPTY: "${EMPTY-unset}"}
    depends_on: [router]
    healthcheck:
      test: test -e ready
  client:
    command: [client]
    depends_on:
      router: {condition: service_healthy}
      board: {condition: service_completed_successfully}
    healthcheck: {test: [CMD-SHELL, "exit 0"], retries: 2}
"""
ENVIRONMENT = {"MODE": "fast", "INHERITED": "from outside", "NAME": "r1", "EMPTY": ""}


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Deployment]:
    def read_text(text: str, **environment: str) -> Deployment:
        path = tmp_path / "compose.yaml"
        path.write_text(text)
        return read_compose(path, environment)

    return read_text


def test_everything_that_is_supported(read: Callable[..., Deployment], tmp_path: Path) -> None:
    assert read(COMPLETE, **ENVIRONMENT) == Deployment(
        path=tmp_path / "compose.yaml",
        services={
            "router": ComposeService(
                "router",
                ("reconros", "router", "--name", "r1", "$HOME"),
                {"MODE": "fast", "INHERITED": "from outside"},
                {},
                Healthcheck(
                    ("reconros", "status", "r1"),
                    90 * 10**9,
                    1_500_000_000,
                    retries=7,
                    start_period_ns=500 * 10**6,
                ),
            ),
            "board": ComposeService(
                "board",
                ("python3", "-c", "print(1)"),
                {"COUNT": "3", "RATE": "0.5", "INHERITED": "from outside", "EMPTY": ""},
                {"router": StartCondition.STARTED},
                Healthcheck(("/bin/sh", "-c", "test -e ready"), 30 * 10**9, 30 * 10**9, 3, 0),
            ),
            "client": ComposeService(
                "client",
                ("client",),
                {},
                {"router": StartCondition.HEALTHY, "board": StartCondition.COMPLETED},
                Healthcheck(("/bin/sh", "-c", "exit 0"), retries=2),
            ),
        },
    )


def test_anchors_and_merges(read: Callable[..., Deployment]) -> None:
    text = (
        "x-base: &base\n  environment: {A: 1}\n  command: base\n"
        "services:\n  one:\n    <<: *base\n  two:\n    <<: *base\n    command: own\n"
    )
    services = read(text).services
    assert [(s.command, s.environment) for s in services.values()] == [
        (("base",), {"A": "1"}),
        (("own",), {"A": "1"}),
    ]


ERRORS = {
    "services: {a: {command: [}": (1, "is not YAML"),
    "services: \x00": (1, "character"),
    "a: 1\na: 2": (2, "a stands twice"),
    "- services": (1, "but is a list"),
    "": (1, "the file must be a mapping (`key: value`), but is empty"),
    "name: x": (1, "has no services"),
    "services:\n  a:\n    command: x\nvolumes: {}": (4, "volumes is not a key"),
    "services:": (1, "services must be a mapping (`key: value`), but is empty"),
    "services:\n  a/b:\n    command: x": (2, "no name for a service"),
    "services:\n  1:\n    command: x": (1, "not a string"),
    "services:\n  a:\n    image: x": (2, "services.a has no command"),
    "services:\n  a:\n    command: x\n    volumes: [x]": (4, "services.a.volumes is not a key"),
    "services:\n  a:\n    command: ''": (3, "is empty"),
    "services:\n  a:\n    command: []": (3, "is empty"),
    "services:\n  a:\n    command: 'a \"b'": (3, "No closing quotation"),
    "services:\n  a:\n    command:\n      - x\n      - 5": (5, "item 2 must be a string, but is 5"),
    "services:\n  a:\n    command: x ${UNSET}": (3, "needs the variable UNSET"),
    "services:\n  a:\n    command: x ${A:-${B}}": (3, "cannot be replaced"),
    "services:\n  a:\n    command: costs $5": (3, "cannot be replaced"),
    "services:\n  a:\n    command: x\n    environment:\n      A: true": (5, "must be a string, but is True"),
    "services:\n  a:\n    command: x\n    environment:\n      - A=1\n      - =2": (
        6,
        "no name of a variable",
    ),
    "services:\n  a:\n    command: x\n    environment: 5": (4, "must be a mapping"),
    "services:\n  a:\n    command: x\n    depends_on: [b]": (4, "names no service of this file: 'b'"),
    "services:\n  a:\n    command: x\n    depends_on:\n      a:": (5, "must be a mapping"),
    "services:\n  a:\n    command: x\n    depends_on:\n      a: service_healthy": (5, "must be a mapping"),
    "services:\n  a:\n    command: x\n    depends_on:\n      a: {}": (5, "has no condition"),
    "services:\n  a:\n    command: x\n    depends_on:\n      a:\n        condition: ready": (
        6,
        "unknown: 'ready'",
    ),
    "services:\n  a:\n    command: x\n    depends_on: {a: {condition: service_healthy, restart: true}}": (
        4,
        "restart is not a key",
    ),
    "services:\n  b:\n    command: x\n  a:\n    command: x\n    depends_on:\n      b:\n"
    "        condition: service_healthy": (7, "b has no healthcheck"),
    "services:\n  a:\n    command: x\n    depends_on: [a]": (2, "a -> a"),
    "services:\n  a:\n    command: x\n    healthcheck: {}": (4, "has no test"),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: x\n      disable: true": (
        6,
        "disable is not",
    ),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: ''": (5, "is empty"),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: [x]": (5, "is not a healthcheck"),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: [CMD]": (5, "is not a healthcheck"),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: x\n      interval: 5": (
        6,
        "must be a string",
    ),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: x\n      interval: 5 s": (
        6,
        "not a duration",
    ),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: x\n      timeout: 0s": (
        6,
        "longer than 0",
    ),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: x\n      retries: 0": (
        6,
        "must be 1 or more",
    ),
    "services:\n  a:\n    command: x\n    healthcheck:\n      test: x\n      retries: 1.5": (
        6,
        "whole number",
    ),
    "x-b: &b\n  image: 5\n  other: 5\nservices:\n  a:\n    <<: *b\n    command: x": (
        5,
        "services.a.other is not",
    ),
}


@pytest.mark.parametrize("text", ERRORS)
def test_mistakes_are_told_with_their_line(read: Callable[..., Deployment], text: str) -> None:
    line, words = ERRORS[text]
    with pytest.raises(FileError) as caught:
        read(text)
    assert (caught.value.line, words in caught.value.problem) == (line, True), str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize("content", [None, b"services: \xff"])
def test_unreadable_file(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "compose.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError, match=r"compose.yaml(: cannot be read|:1: The text is not UTF-8)"):
        read_compose(path, {})


def test_volumes_are_refused_with_a_place_to_keep_them(read: Callable[..., Deployment]) -> None:
    with pytest.raises(FileError) as caught:
        read("services:\n  a:\n    command: x\n    volumes: [./results:/results]")
    assert caught.value.line == 4
    assert "docker compose -f FILE -f SECOND" in caught.value.remedy


def test_a_circle_names_who_waits_for_whom(read: Callable[..., Deployment]) -> None:
    text = "services:\n" + "".join(
        f"  {name}:\n    command: x\n    depends_on: [{other}]\n" for name, other in ("ab", "bc", "ca")
    )
    with pytest.raises(
        FileError, match=r"waits for itself: (a -> b -> c -> a|b -> c -> a -> b|c -> a -> b -> c)"
    ):
        read(text)


@given(st.lists(st.sets(st.integers(0, 6)), min_size=7, max_size=7), st.booleans())
def test_exactly_the_circles_are_refused(
    tmp_path_factory: pytest.TempPathFactory, wanted: list[set[int]], back: bool
) -> None:
    edges = {i: {j for j in others if j < i} for i, others in enumerate(wanted)}
    last = max((i for i in edges if edges[i]), default=None)
    if back and last is not None:
        edges[min(edges[last])].add(last)
    path = tmp_path_factory.getbasetemp() / "circles.yaml"
    path.write_text(
        "services:\n"
        + "".join(
            f"  s{i}:\n    command: x\n    depends_on: [{', '.join(f's{j}' for j in sorted(others))}]\n"
            for i, others in edges.items()
        )
    )
    if back and last is not None:
        with pytest.raises(FileError, match="waits for itself"):
            read_compose(path, {})
    else:
        assert len(read_compose(path, {}).services) == len(edges)


def _replaced(text: str, environment: dict[str, str]) -> str:
    return YamlNode(text, "value", 1, Path("file"), environment).text()


@given(st.text())
def test_escaped_text_comes_back(text: str) -> None:
    assert _replaced(text.replace("$", "$$"), {}) == text


NAMES = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]*", fullmatch=True).filter(str.isascii)
DEFAULTS = st.text(string.ascii_letters + " /:.-?+#")


@given(NAMES, st.text(), DEFAULTS, st.text(" /.\"'"))
def test_a_set_variable_is_taken_as_it_is(name: str, value: str, default: str, around: str) -> None:
    environment = {name: value}
    assert _replaced(f"{around}${name}{around}", environment) == f"{around}{value}{around}"
    assert _replaced(f"${{{name}}}x", environment) == f"{value}x"
    assert _replaced(f"${{{name}-{default}}}", environment) == value
    assert _replaced(f"${{{name}:-{default}}}", environment) == (value or default)


@given(NAMES, DEFAULTS)
def test_an_unset_variable_takes_its_default(name: str, default: str) -> None:
    assert _replaced(f"${{{name}-{default}}}", {}) == default
    assert _replaced(f"${{{name}:-{default}}}", {}) == default
    with pytest.raises(FileError, match=rf"file:1: value needs the variable {name}, .*{name}:-default"):
        _replaced(f"${{{name}}}", {})


UNITS = {"h": 3600 * 10**9, "m": 60 * 10**9, "s": 10**9, "ms": 10**6, "us": 10**3}


@given(st.lists(st.tuples(st.integers(0, 10**6), st.sampled_from(sorted(UNITS))), min_size=1, max_size=5))
def test_durations_add_up(parts: list[tuple[int, str]]) -> None:
    text = "".join(f"{number}{unit}" for number, unit in parts)
    assert duration_ns(text) == sum(number * UNITS[unit] for number, unit in parts)


@pytest.mark.parametrize("text", ["", "5", "s", "1 s", "-1s", "1s ", "1d", "1.s", "1e3s", "1s5"])
def test_other_words_are_no_durations(text: str) -> None:
    assert duration_ns(text) is None


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.yaml")), ids=lambda path: path.name)
def test_shipped_files_need_no_variables(path: Path) -> None:
    assert read_compose(path, {}).services


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("*.yaml")), ids=lambda path: path.name)
def test_variables_for_containers_reach_every_process(path: Path) -> None:
    lines = (SHIPPED / "containers.env").read_text().splitlines()
    environment = dict(line.split("=", 1) for line in lines if not line.startswith("#"))
    services = read_compose(path, environment).services
    assert {service.environment["RECONROS_ROUTER"] for service in services.values()} == {"tcp/router:7447"}
    assert not [s for s in services.values() if "127.0.0.1" in " ".join(s.command)]
