"""Commands that cannot do what they are told end with status 2 and say in one line why and what helps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from processes import run

from reconros_zenoh.experiments.roundtrip import application_folder

if TYPE_CHECKING:
    from conftest import Network


def assert_refused(*arguments: object, says: tuple[object, ...]) -> None:
    """Run a command; fail unless it ends with status 2 and one line with all these words on stderr."""
    done = run(*arguments)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("reconros: ")
    for words in says:
        assert str(words) in line


def test_a_second_board_of_the_same_name(network: Network) -> None:
    assert_refused(
        "board",
        "--router",
        network.endpoint,
        says=("a board named 'board0' is running already", "Stop it, or start this one with --name"),
    )


def test_a_missing_router(endpoint: str) -> None:
    assert_refused(
        "board",
        "--router",
        endpoint,
        says=(f"no Zenoh router at {endpoint}", f"start one with `reconros router --listen {endpoint}`"),
    )


def test_a_second_router_on_a_port(network: Network) -> None:
    assert_refused(
        "router",
        "--listen",
        network.endpoint,
        says=(network.endpoint, "Address already in use", "choose another endpoint"),
    )


def test_what_is_no_endpoint() -> None:
    assert_refused("client", "sort", "--router", "localhost", says=("'localhost'", "tcp/127.0.0.1:7447"))


def test_no_board_for_a_client(network: Network) -> None:
    assert_refused(
        "client",
        "sort",
        "--domain=9",
        "--wait=0.1",
        "--router",
        network.endpoint,
        says=("no board answered the sort client within 0.1 s", "`reconros board`", "--domain"),
    )


SHIPPED_MAPPING = (application_folder() / "mappings" / "all_hardware.toml").read_text(encoding="utf-8")
MISTAKES = {
    "an unknown slot": (
        "slots = [0]",
        "slots = [4]",
        "The callback inverse is mapped to the unknown slot 4.",
        "Known slots: 0, 1, 2, 3.",
    ),
    "an unknown callback": (
        "[callbacks.hash]",
        "[callbacks.rash]",
        "The project has no callback 'rash'.",
        "Its callbacks: inverse, mnist, sobel, sort, hash.",
    ),
    "a callback without a place": (
        "slots = [1]",
        "software = false",
        "The callback sort is mapped to no place.",
        "Set `software = true` or list its `slots`.",
    ),
}


@pytest.mark.parametrize(("right", "wrong", "problem", "remedy"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_in_a_mapping_file(
    tmp_path: Path, right: str, wrong: str, problem: str, remedy: str
) -> None:
    mapping = tmp_path / "mine.toml"
    mapping.write_text(SHIPPED_MAPPING.replace(right, wrong), encoding="utf-8")
    assert wrong in mapping.read_text(encoding="utf-8")
    assert_refused("board", "--mapping", mapping, says=(f"{mapping}:", problem, remedy))


def test_an_unknown_mapping() -> None:
    assert_refused(
        "experiment",
        "roundtrip",
        "--mapping=some_hardware",
        says=("no mapping named 'some_hardware'", "all_hardware, all_software, mixed", ".toml"),
    )


def test_an_unknown_profile() -> None:
    assert_refused(
        "board",
        "--profile=zynq",
        says=("no profile named 'zynq'", "miniitx-zynq7100, native", ".toml"),
    )


def test_an_unknown_client() -> None:
    done = run("client", "quicksort")
    assert (done.returncode, done.stdout) == (2, "")
    for words in ("Usage:", "'quicksort'", "'sort'", "'inverse'", "'sobel'", "'mnist'", "'hash'"):
        assert words in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (("experiment", "roundtrip"), "--out"),
        (("client", "sort"), "--out"),
        (("build", application_folder()), "--out"),
    ],
    ids=["experiment", "client", "build"],
)
def test_a_folder_that_cannot_be_written(tmp_path: Path, command: tuple[object, ...], option: str) -> None:
    # Not even root can make a folder below a file.
    (tmp_path / "file").touch()
    place = tmp_path / "file" / "below"
    assert_refused(*command, option, place, says=(place, "Choose an"))


def test_a_node_that_does_not_run(network: Network) -> None:
    assert_refused(
        "map",
        "--live",
        "--router",
        network.endpoint,
        "--hardware=/nobody",
        says=("no node /nobody runs", "/sobel_node"),
    )


def test_a_mistake_in_a_graph_file(tmp_path: Path) -> None:
    graph = tmp_path / "graph.yaml"
    graph.write_text("nodes: {n1: hardware}\ntopics:\n  A: {publishers: [n2]}\n", encoding="utf-8")
    assert_refused("map", graph, says=(f"{graph}:3: ", "is the unknown node 'n2'", "Known nodes: n1."))


def test_a_damaged_bitstream(network: Network, tmp_path: Path) -> None:
    built = run("build", application_folder(), "--out", tmp_path, "--json")
    assert (built.returncode, built.stderr) == (0, "")
    bitstreams = {(b["callback"], b["slot"]): Path(b["file"]) for b in json.loads(built.stdout)["bitstreams"]}
    damaged = bitstreams["sobel", 3]
    with damaged.open("r+b") as file:
        file.seek(-1, 2)
        file.write(b"\x01")
    assert_refused(
        "board",
        "--router",
        network.endpoint,
        "--name=board1",
        "--bitstreams",
        tmp_path,
        says=(f"{damaged}: is damaged", "`reconros build`"),
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ("--hmt", "/a", "--type", "std_msgs/UInt32", "--qos-history", "all"),
            "history is 'all'. Write keep",
        ),
        (
            ("--hmt", "/a", "--type", "std_msgs/UInt32", "--qos-depth", "0"),
            "depth is 0. Write a number from 1",
        ),
        (("--qos-depth", "5"), "Add --hmt TOPIC"),
    ],
)
def test_a_qos_that_no_gateway_can_have(options: tuple[str, ...], says: str) -> None:
    assert_refused("gateway", *options, says=(says,))
