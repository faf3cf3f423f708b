"""Flags packed into 64-bit words, flag i being bit i % 64 of word i // 64."""

from __future__ import annotations

import numpy as np


def pack_words(flags: np.ndarray) -> np.ndarray:
    """Bool [..., n] as words [..., ceil(n / 64)]."""
    padded = np.concatenate([flags, np.zeros((*flags.shape[:-1], -flags.shape[-1] % 64), bool)], axis=-1)
    return np.packbits(padded, axis=-1, bitorder="little").view(np.uint64)


def unpack_words(words: np.ndarray, n: int) -> np.ndarray:
    """Words [..., w] as bool [..., n]."""
    return np.unpackbits(np.ascontiguousarray(words).view(np.uint8), axis=-1, count=n, bitorder="little").view(bool)
