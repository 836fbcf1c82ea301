"""The errors of the project."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from reconros_zenoh import errors
from reconros_zenoh.errors import ReconrosError

ERRORS = [
    errors.ReconrosError("what is wrong"),
    errors.UsageError("what is wrong"),
    errors.FileError(Path("main.py"), 7, "is wrong.", "Correct it."),
    errors.BitstreamError("a.bit", None, "is damaged."),
    errors.GraphError(("topics", "A", 1), "is wrong.", "Correct it."),
    errors.TransportError("what is wrong"),
    errors.BadMessageError("leg", "7 is no leg"),
    errors.CallbackError("what is wrong"),
    errors.PageFaultError("sort", 0, "read", 0x100, 4),
    errors.CallbackLimitError("sort", 50_000_000),
    errors.ExperimentError("what is wrong"),
]


def subclasses(cls: type[ReconrosError]) -> set[type[ReconrosError]]:
    return {cls}.union(*map(subclasses, cls.__subclasses__()))


def test_there_is_one_of_every_class() -> None:
    assert {type(error) for error in ERRORS} == subclasses(ReconrosError)


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_comes_from_another_process_as_it_was(error: ReconrosError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert again.args == error.args
    assert vars(again) == vars(error)
