"""A router and a board as processes, and a session of the test process with them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import pytest
from processes import Process

from reconros_zenoh.experiments.endpoints import free_endpoint
from reconros_zenoh.experiments.roundtrip import application_folder
from reconros_zenoh.project.loader import load_project
from reconros_zenoh.transport.zenoh import ZenohTransport

if TYPE_CHECKING:
    from collections.abc import Iterator

    from reconros_zenoh.ros.type_registry import TypeRegistry


class Network(NamedTuple):
    """A router that listens at `endpoint`, the board `board0`, and a session of the test process."""

    endpoint: str
    router: Process
    board: Process
    transport: ZenohTransport


@pytest.fixture
def endpoint() -> str:
    """Return an endpoint at which nothing listens."""
    return free_endpoint()


@pytest.fixture(scope="session")
def network() -> Iterator[Network]:
    endpoint = free_endpoint()
    with (
        Process("router", "--listen", endpoint) as router,
        Process("--router", endpoint, program=("-m", "board_daemon")) as board,
    ):
        router.wait_for("router listens on", endpoint)
        board.wait_for("board board0 serves roundtrip")
        with ZenohTransport.open(endpoint) as transport:
            yield Network(endpoint, router, board, transport)


@pytest.fixture(scope="session")
def types() -> TypeRegistry:
    return load_project(application_folder()).types()
