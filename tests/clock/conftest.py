"""Time that passes when a test says so, in place of the monotonic clock."""

from __future__ import annotations

import pytest
from made_up_time import MadeUpTime

from reconros_zenoh.clock import wall


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> MadeUpTime:
    time = MadeUpTime()
    monkeypatch.setattr(wall, "time", time)
    return time
