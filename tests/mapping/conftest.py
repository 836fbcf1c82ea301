from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

# Mapping and Optimizing, Section 4, in units of the time that 10 kB take at 346 MB/s.
SECTIONS = """
[model.topics]
publish = { value = 176.88, unit = "us", basis = "calibrated" }
notify_hardware = { value = 7.2254, unit = "us", basis = "calibrated" }
notify_software = { value = 6.3873, unit = "us", basis = "calibrated" }
copy_in = { value = 4.3613, unit = "ns/B", basis = "calibrated" }
copy_out = { value = 0.76879, unit = "ns/B", basis = "calibrated" }

[model.gateway]
cancel = { value = 227.46, unit = "us", basis = "calibrated" }

[model.hmt]
overhead = { value = 211.27, unit = "us", basis = "calibrated" }
bandwidth = { value = 346, unit = "MB/s", basis = "calibrated" }
"""


@pytest.fixture
def profile_file(tmp_path: Path) -> Path:
    """A profile with the transfer times of the ZCU104; the rest of it is another board's."""
    shipped = files("reconros_zenoh.board") / "profiles" / "miniitx-zynq7100.toml"
    text = shipped.read_text(encoding="utf-8")
    for old, new in (('name = "miniitx-zynq7100"', 'name = "transfers"'), ("value = 400", "value = 346")):
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = tmp_path / "transfers.toml"
    path.write_text(text + SECTIONS, encoding="utf-8")
    return path
