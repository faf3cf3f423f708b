"""Counts in a corpus of designs what occurs in a designer's program, for the prices of `imdim.reconstruction.description`.

python scripts/corpus/count_prices.py            # writes src/imdim/reconstruction/design_counts.json anew, and prints the prices
The corpus is made here: 45 kinds of designs (`plates.py`, `rounds.py`, `profiles.py`), so many of each, whose numbers and choices are drawn
from a generator. Only designs in one piece count.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator

import numpy as np
from features import Draw
from plates import PLATES
from profiles import PROFILES
from rounds import ROUNDS

from imdim.geometry.solid import to_manifold
from imdim.program.tree import Program
from imdim.reconstruction.description import COUNTS, price_events, price_reading
from imdim.reconstruction.design_events import COPIES, GROUPS, Event, PartBox, read_events, read_features

EACH = 10
TRIES = 20  # numbers that are drawn for a design at most, until it is in one piece


def make_designs(each: int) -> Iterator[tuple[Program, PartBox]]:
    """The corpus: programs in millimetres, and the boxes that they fill. Raises ValueError for a design that is never in one piece."""
    for kind, design in enumerate((*PLATES, *ROUNDS, *PROFILES)):
        for number in range(each):
            for attempt in range(TRIES):
                program = design(Draw(np.random.default_rng([kind, number, attempt])))
                solid = to_manifold(program)
                if len(solid.decompose()) == 1:
                    low, high = np.reshape(solid.bounding_box(), (2, 3))
                    yield program, PartBox(low, high)
                    break
            else:
                raise ValueError(f"{design.__name__} {number} is in pieces {TRIES} times")


def count_events(each: int) -> dict[str, dict[str, int]]:
    """How often each event occurs in the corpus, by its group."""
    total: Counter[Event] = Counter()
    for program, part in make_designs(each):
        total += read_events(program, part).events
    return {group: {event: total[group, event] for event in events} for group, events in GROUPS.items()}


def relative_prices(counts: dict[str, dict[str, int]], each: int) -> dict[str, float]:
    """What a further curve of an outline, and a way in which copies go on, cost of a plain feature."""
    prices, plain, curves, drawn = price_events(counts), list[float](), list[int](), list[float]()
    for program, part in make_designs(each):
        for feature in read_features(program, part)[0]:
            bits = price_reading(feature.own, prices) + price_reading(feature.drawn, prices)
            if feature.leaf.outline is None:
                plain.append(bits)
            else:
                curves.append(feature.leaf.outline.curve_count)
                drawn.append(bits)
    mean = sum(plain) / len(plain)
    # the least squares line: what a drawing takes at all is not its curves'
    slope, _ = np.polyfit(curves, drawn, 1)
    return {"a further curve": float(slope) / mean, "a way": (prices["copies", "more"] + COPIES) / mean}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=EACH, help="designs of each kind")
    given = parser.parse_args()
    counts = count_events(given.each)
    document = {"made by": "scripts/corpus/count_prices.py", "designs of each kind": given.each, "counts": counts}
    COUNTS.write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    prices = price_events(counts)
    print("of a plain feature: " + ", ".join(f"{what} {share:.2f}" for what, share in relative_prices(counts, given.each).items()))
    for group, events in counts.items():
        print(f"{group}: " + ", ".join(f"{event} {prices[group, event]:.1f} bits ({count})" for event, count in events.items() if count))


if __name__ == "__main__":
    main()
