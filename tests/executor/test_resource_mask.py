"""Where a callback may run."""

from __future__ import annotations

import pytest

from reconros_zenoh.executor.resource_mask import SOFTWARE, ResourceMask


def test_a_resource_is_in_the_mask_when_its_field_is_filled() -> None:
    mask = ResourceMask.of(slots={1: "a.bit"})
    assert 1 in mask
    assert 0 not in mask
    assert SOFTWARE not in mask


def test_each_field_holds_the_implementation_for_its_resource() -> None:
    mask = ResourceMask.of(software="function", slots={0: "a.bit", 3: "b.bit"})
    assert mask.implementations == {SOFTWARE: "function", 0: "a.bit", 3: "b.bit"}


def test_software_is_no_slot() -> None:
    with pytest.raises(ValueError, match="slots are numbered from 0"):
        ResourceMask.of(slots={SOFTWARE: "a.bit"})


def test_a_mask_does_not_change_with_the_slots_it_was_made_from() -> None:
    slots = {0: "a.bit"}
    mask = ResourceMask.of(slots=slots)
    slots[1] = "b.bit"
    assert 1 not in mask
