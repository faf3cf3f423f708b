"""Parameters as OpenSCAD's Customizer shows them: in sections ``/* [Plate] */``, with sliders ``// [4 : 0.1 : 16]`` behind their values.

A slider snaps to its steps, so the value itself has to lie on one: steps are powers of ten that the value is a whole number of.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from decimal import Decimal

from imdim.export.inches import inch_fractions
from imdim.export.parameters import Parameters, is_count
from imdim.program.edges import EDGE_KINDS
from imdim.program.tree import FULL_TURN

FEWEST, MOST = 20, 10_000  # steps of a slider; a number that needs more has none
LEAST_SIDES, LEAST_COUNT = 3, 2
EDGES = "edges"  # the section of fillets and chamfers


def customizer_head(named: Parameters, number: Callable[[float], str], counted: bool = True) -> list[str]:
    """As `Parameters.head` for OpenSCAD, with a line above each section and each fraction of an inch, and a slider behind each
    value that can have one."""
    out: list[str] = []
    fractions = inch_fractions(named)
    section, labels = "", set(named.labels)
    for line in named.head(number, end=";", counted=counted):
        name, _, text = line.removesuffix(";").partition(" = ")
        if line and (found := _section(name, labels) or section) != section:
            section = found
            out.append(f"/* [{section.replace('_', ' ').capitalize()}] */")
        out += [f"// {fractions[name]}"] if name in fractions else []
        out.append(line + slider(name, text, is_copies=name in named.counts) if line else line)
    return out


def slider(name: str, text: str, is_copies: bool = False) -> str:
    """The comment behind a value, from half of it to twice; empty where that is no use. Counts are whole, and angles end at a full turn."""
    value = Decimal(text)
    if is_copies or is_count(name):
        low, high = max(LEAST_COUNT if is_copies else LEAST_SIDES, math.ceil(value / 2)), 2 * value
        return _comment(Decimal(low), Decimal(1), high) if low <= value == int(value) else ""
    if not value:
        return ""
    step = Decimal(1).scaleb(min(int(value.normalize().as_tuple().exponent), 0))
    while abs(value) * 3 / 2 < FEWEST * step:
        step /= 10
    if abs(value) * 3 / 2 > MOST * step:
        return ""
    near, far = (value / 2 / step).to_integral_value() * step, 2 * value
    if "angle" in name.split("_"):
        far = max(min(far, Decimal(FULL_TURN)), -Decimal(FULL_TURN))
    return _comment(min(near, far), step, max(near, far))


def _comment(low: Decimal, step: Decimal, high: Decimal) -> str:
    return f" // [{':'.join(_plain(number) for number in (low, step, high))}]"


def _plain(number: Decimal) -> str:
    text = format(number, "f")
    return text.rstrip("0").rstrip(".") if "." in text else text


def _section(name: str, labels: Collection[str]) -> str:
    """The longest label that a name begins with, empty where it begins with none."""
    words = name.split("_")
    begins = ("_".join(words[:count]) for count in range(len(words) - 1, 0, -1))
    label = next((begin for begin in begins if begin in labels), "")
    return max(label, EDGES if name.startswith(tuple(EDGE_KINDS)) else "", key=len)
