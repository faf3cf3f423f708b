"""Units of length, by the words of 3MF and by those of settings."""

from __future__ import annotations

from collections.abc import Mapping

UNSPECIFIED = "unspecified"
MILLIMETRES: Mapping[str, float] = {  # each
    "micron": 0.001,
    "millimeter": 1.0,
    "centimeter": 10.0,
    "meter": 1000.0,
    "inch": 25.4,
    "foot": 304.8,
}
WORDS: Mapping[str, str] = {"mm": "millimeter", "cm": "centimeter", "m": "meter", "inch": "inch"}
SPOKEN: Mapping[str, str] = {"mm": "millimetres", "cm": "centimetres", "m": "metres", "inch": "inches"}
READ_AS = ("auto", *WORDS)  # the setting `units`
ORIGINS = ("keep", "base", "center")  # the setting `origin`


def to_millimetres(units: str) -> float:
    """How many millimetres a length of 1 is; what is unspecified is taken for millimetres, as printers and CAD systems do."""
    return 1.0 if units == UNSPECIFIED else MILLIMETRES[units]
