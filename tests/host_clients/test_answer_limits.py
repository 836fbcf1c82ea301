from __future__ import annotations

import inspect

import pytest

from host_clients.daemon import ClientOptions
from reconros_zenoh.board.profile import read_profile
from reconros_zenoh.cli.daemons import client
from reconros_zenoh.virtual_board import VirtualDesktop


@pytest.mark.parametrize("name", ["miniitx-zynq7100", "zcu104"])
def test_what_the_modelled_stack_repairs_does_not_count_as_lost(name: str) -> None:
    model = read_profile(name).model
    assert model is not None
    there_and_back_s = 2 * model.dds.heartbeat_period.ns / 1e9
    limits_s = (
        ClientOptions("sobel", "", 1).limit_s,
        inspect.signature(client).parameters["limit"].default,
        inspect.signature(VirtualDesktop.round_trips).parameters["limit_s"].default,
    )
    assert min(limits_s) > there_and_back_s
