"""Numbers written as text, many at once."""

from __future__ import annotations

import warnings

import numpy as np


def read_numbers(text: bytes, kind: type) -> np.ndarray:
    """All numbers [n] of `kind` in a text of blanks and lines; raises ValueError where something else is written."""
    if not text.strip():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy warns of what is no number, and stops there
        try:
            return np.fromstring(text.decode("ascii"), kind, sep=" ")
        except DeprecationWarning as error:
            raise ValueError("something is written where a number is expected") from error
