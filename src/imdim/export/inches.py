"""What the lengths of a part in inches are called on its drawing: "3/8 in"."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from imdim.export.parameters import Parameters, is_count
from imdim.numbers.design_values import INCH
from imdim.numbers.inches import tell_inches

WRITTEN = 1e-8  # of the largest length: what nine digits leave of others
FINEST = 64


def inch_fractions(named: Parameters) -> dict[str, str]:
    """By their names the lengths that are whole 64ths of an inch, in words; none of a part whose lengths tell of millimetres."""
    lengths = {name: value for name, value in named.values.items() if name not in named.angles and not is_count(name)}
    if not tell_inches(np.array(list(lengths.values())), WRITTEN):
        return {}
    slack = WRITTEN * max(map(abs, lengths.values()))
    return {name: words for name, value in lengths.items() if (words := _in_words(value, slack))}


def _in_words(millimetres: float, slack: float) -> str:
    """ "1 3/8 in"; empty for what is no whole 64th, and for nothing."""
    parts = round(millimetres / INCH * FINEST)
    if not parts or abs(parts * INCH / FINEST - millimetres) > slack:
        return ""
    whole, rest = divmod(abs(parts), FINEST)
    words = [str(whole)] * (whole > 0) + [str(Fraction(rest, FINEST))] * (rest > 0)
    return f"{'-' * (parts < 0)}{' '.join(words)} in"
