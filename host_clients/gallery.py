"""The filtered pictures as files: the first, the last, and all of them as an animation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
from PIL import Image

from reconros_zenoh.errors import UsageError

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

_KEPT = 300
_SMALL = (320, 240)


class Gallery:
    """Keeps the first and the last picture, and smaller grey ones of the first 300 for the animation."""

    def __init__(self) -> None:
        self._whole: dict[str, NDArray[np.uint8]] = {}
        self._small: list[NDArray[Any]] = []

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Keep a picture, uint8[height, width, 3] in the order blue, green, red."""
        self._whole.setdefault("first", picture)
        self._whole["last"] = picture
        if len(self._small) < _KEPT:
            grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
            self._small.append(cv2.resize(grey, _SMALL, interpolation=cv2.INTER_AREA))

    def write(self, folder: Path, rate_hz: float) -> None:
        """Write first.png and last.png, as they came, and filtered.gif; nothing when no picture has come.

        Raises UsageError when that fails.
        """
        if not self._whole:
            return
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for name, picture in self._whole.items():
                _, png = cv2.imencode(".png", picture)
                (folder / f"{name}.png").write_bytes(png.tobytes())
            first, *others = (Image.fromarray(frame) for frame in self._small)
            first.save(
                folder / "filtered.gif",
                save_all=True,
                append_images=others,
                duration=round(1000 / rate_hz),
                loop=0,
            )
        except OSError as error:
            raise UsageError(
                f"{folder} cannot be written ({error.strerror}). Choose another folder with --out."
            ) from None
