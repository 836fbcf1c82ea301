"""The forms of the fields of messages, as rosbags has them: which are strings, which are numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rosbags.interfaces import Nodetype

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc


def number(form: FieldDesc) -> np.dtype[np.generic]:
    """Return the dtype of a number in memory, little endian: the very object that most arrays have."""
    name = str(form[1][0])
    return np.dtype(np.dtype("u1" if name == "byte" else name).newbyteorder("<").str)


def is_number(form: FieldDesc) -> bool:
    """Tell whether a field of this form is one number."""
    return form[0] == Nodetype.BASE and not is_string(form)


def is_string(form: FieldDesc) -> bool:
    """Tell whether a field of this form is one string."""
    return bool(form[0] == Nodetype.BASE and form[1][0] == "string")
