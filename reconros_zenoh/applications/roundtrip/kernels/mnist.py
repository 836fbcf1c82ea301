"""MNIST classifier: the digit in a 28 x 28 image (ReconROS Executor, Section V-A).

The network (model/mnist.onnx: three convolution, three pooling and two fully connected layers) is trained by
training/train.py and run by OpenCV.
"""

from __future__ import annotations

import functools
import threading
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from reconros_zenoh.errors import FileError
from reconros_zenoh.text_file import check_file

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIDE = 28
_LIMIT_BYTES = 1_000_000_000
MODEL = Path(__file__).parents[1] / "model" / "mnist.onnx"


class Classifier:
    """The network, loaded once; `classify` may be called from any thread.

    An OpenCV network keeps its input and output inside itself, so one call at a time may use it. A lock
    guards it instead of one network per thread: a call takes a fraction of a millisecond, less than loading
    another network does, and OpenCV releases the GIL meanwhile.

    OpenCV may split a call over its own threads. One does better for so small a network, but their number can
    only be set for the whole process, which is for the process to decide: daemons do (`tune_process`).
    """

    def __init__(self, model: Path = MODEL) -> None:
        try:
            self._net = cv2.dnn.readNetFromONNX(np.frombuffer(model.read_bytes(), np.uint8))
        except (OSError, cv2.error) as error:
            remedy = "Install the package again; training/train.py makes the file."
            raise FileError(model, None, "the network cannot be read.", remedy) from error
        self._lock = threading.Lock()

    def classify(self, image: NDArray[np.uint8]) -> int:
        """Return the digit 0..9 that `image` (uint8[28, 28], mono8, bright ink) shows; else ValueError."""
        if image.shape != (SIDE, SIDE) or image.dtype != np.uint8:
            raise ValueError(
                f"an image of uint8[{SIDE}, {SIDE}] is needed, not {image.dtype}{[*image.shape]}"
            )
        blob = cv2.dnn.blobFromImage(image, scalefactor=1 / 255)
        with self._lock:
            self._net.setInput(blob)
            scores = self._net.forward()
        return int(np.argmax(scores))


@functools.cache
def shipped_classifier() -> Classifier:
    """Return the shipped network, loaded once for all boards and clients of a process."""
    return Classifier()


def accuracy(images: NDArray[np.uint8], labels: NDArray[np.uint8], model: Path = MODEL) -> float:
    """Return the share (0..1) of `images` (uint8[count, 28, 28]) whose class is its label (uint8[count])."""
    classifier = Classifier(model)
    right = sum(classifier.classify(image) == label for image, label in zip(images, labels, strict=True))
    return float(right / len(labels))


def load_digits(path: Path) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return `images` (uint8[count, 28, 28]) and `labels` (uint8[count], 0 to 9) of an npz file.

    FileError for any other file. Pickled objects are refused, so a file from elsewhere cannot run code.
    """
    remedy = (
        f"Give an npz file with the arrays images (uint8[count, {SIDE}, {SIDE}]) and labels "
        "(uint8[count], 0 to 9); training/train.py writes one."
    )
    try:
        check_file(path, remedy, _LIMIT_BYTES)
        with path.open("rb") as file:
            with zipfile.ZipFile(file) as packed:
                _check_unpacked(path, packed, remedy)
            file.seek(0)
            arrays = np.load(file, allow_pickle=False)
            images, labels = arrays["images"], arrays["labels"]
    except FileError:
        raise
    except OSError as error:
        raise FileError(path, None, f"cannot be read: {error.strerror or error}.", remedy) from error
    except KeyError as error:
        raise FileError(path, None, f"{error.args[0]}.", remedy) from error
    except Exception as error:  # numpy, zipfile and zlib document no common error for damaged files
        raise FileError(path, None, "is not an npz file of plain arrays.", remedy) from error
    if images.ndim != 3 or images.shape[1:] != (SIDE, SIDE) or images.dtype != np.uint8 or len(images) == 0:
        raise FileError(path, None, f"images is {images.dtype}{[*images.shape]}.", remedy)
    if labels.shape != images.shape[:1] or labels.dtype != np.uint8:
        raise FileError(
            path, None, f"labels is {labels.dtype}{[*labels.shape]} beside {len(images)} images.", remedy
        )
    if labels.max() > 9:
        raise FileError(path, None, f"labels holds {labels.max()}.", remedy)
    return images, labels


def _check_unpacked(path: Path, packed: zipfile.ZipFile, remedy: str) -> None:
    size = sum(member.file_size for member in packed.infolist())
    if size > _LIMIT_BYTES:
        raise FileError(path, None, f"unpacks to {size / 1e6:.0f} MB.", remedy)
