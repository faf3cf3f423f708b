"""The command line and the loop of benches that plant parts by number, fit each into a folder of its own, and score it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from processor import CLOCKS, rule_the_clock


class AskedPart(NamedTuple):
    """A part by its number with a generator of its own, its folder, the budget in seconds, and how it is seen: "mesh", or a condition of a
    scan."""

    rng: np.random.Generator
    number: int
    folder: Path
    budget: float
    condition: str


def asked_parts(about: str | None, out: Path, parts: int = 40, clouds: bool = False) -> Iterator[AskedPart]:
    """The parts that the command line asks for, which may ask for `clouds` of them."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", type=int, default=parts)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=out)
    parser.add_argument("--budget", type=float, default=60.0)
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="what tells the budget: the processor's does not mind other work")
    parser.add_argument("--only", default="", help="numbers of parts, joined by commas")
    if clouds:
        parser.add_argument("--condition", default="mesh", help="mesh, cloud, noise=0.5%%, outliers=2%%, joined by +")
    given = parser.parse_args()
    if given.clock == "processor":
        rule_the_clock()
    only = [int(n) for n in given.only.split(",") if n]
    for number in only or range(given.parts):
        rng, condition = np.random.default_rng([given.seed, number]), given.condition if clouds else "mesh"
        yield AskedPart(rng, number, given.out / f"part{number:02d}", given.budget, condition)
