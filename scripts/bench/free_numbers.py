"""Which outlines have numbers that are neither names nor follow from names: ``python scripts/bench/free_numbers.py RESULTS``.

Counted are coordinates of vertices and of centres, radii, and the angles of arcs but for quarters, halves and so on of a turn. What is 0
within the slack of outlines counts as that. How many changes of names `imdim edit` accepts is told by `edits.py`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from imdim.export.parameters import parametrise
from imdim.program.codec import constraints_of, from_json, parse, read_folded
from imdim.program.repeats import repeats
from imdim.program.tree import leaves, longest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    given = parser.parse_args()
    documents = sorted(given.results.glob("*/program.json"))
    if not documents:
        print(f"{given.results}: no folder in it has a program.json", file=sys.stderr)
        return 2
    all_free: list[int] = []
    print("| part | outlines | without free numbers | free numbers |\n| --- | --- | --- | --- |")
    for path in documents:
        free = _free_numbers(path)
        all_free += free
        print(f"| {path.parent.name} | {len(free)} | {free.count(0)} | {sum(free)} |")
    print(f"| all {len(documents)} | {len(all_free)} | {all_free.count(0)} | {sum(all_free)} |")
    return 0


def _free_numbers(path: Path) -> list[int]:
    """How many numbers of each outline follow no name."""
    document = parse(path.read_bytes())
    program, folded = from_json(document), read_folded(document)
    named = parametrise(program, constraints_of(document), program, folded if any(repeats(folded)) else None)
    return named.free_numbers(longest(leaves(program)))


if __name__ == "__main__":
    sys.exit(main())
