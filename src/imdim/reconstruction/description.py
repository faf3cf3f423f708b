"""The description length of a program in bits: each thing that occurs in it at the price counted in a corpus of designs.

What occurs at a share p of the places where it might costs -log2 p (Rissanen 1978): common shapes, faces that are seen and whole
millimetres cost little; walls in the air, hidden ends, radii beyond the part and odd numbers cost much. `scripts/corpus/count_prices.py`
counts them in designs that it makes itself, and in no part of a benchmark.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from imdim.program.tree import Program
from imdim.reconstruction.design_events import GROUPS, Event, PartBox, Reading, read_events

COUNTS = Path(__file__).with_name("design_counts.json")


def describe_bits(program: Program, part: PartBox) -> float:
    """How many bits the program of a part takes."""
    return price_reading(read_events(program, part), _counted_prices())


def price_reading(reading: Reading, prices: Mapping[Event, float]) -> float:
    """Bits of what was read."""
    return reading.bits + sum(count * prices[event] for event, count in reading.events.items())


def price_events(counts: Mapping[str, Mapping[str, int]]) -> dict[Event, float]:
    """Bits of each event, by how often those of its group occurred; one more of each, so that what never did has a price (Laplace)."""
    prices: dict[Event, float] = {}
    for group, events in GROUPS.items():
        seen = {event: counts.get(group, {}).get(event, 0) + 1 for event in events}
        prices |= {(group, event): -math.log2(count / sum(seen.values())) for event, count in seen.items()}
    return prices


@cache
def _counted_prices() -> dict[Event, float]:
    return price_events(json.loads(COUNTS.read_text("utf-8"))["counts"])
