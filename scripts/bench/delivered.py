"""Whether what was delivered is what was found: ``python scripts/bench/delivered.py FOLDER...``

Each FOLDER holds results of `imdim fit`, at any depth, as the folder of a benchmark does. From every `report.json`: volume IoU with the
target of the program that was found and of the one delivered, and of one with the other. The parts that lost most come first; reports that
do not tell are counted. The exit status is 1 where delivery lost more than `LOST`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

LOST = 1e-3  # of the volume IoU


@dataclass(frozen=True)
class Part:
    """Volume IoU of the program found and of the one delivered with the target, None for a cloud, and of both with each other."""

    name: str
    found: float | None
    delivered: float | None
    same: float

    @property
    def lost(self) -> float:
        """What delivery changed; of a mesh, by how much it is further from the target."""
        return 1 - self.same if self.found is None or self.delivered is None else self.found - self.delivered


def parts_in(folders: Iterable[Path]) -> Iterator[Part | None]:
    """One for each report, None for a report that does not tell."""
    for path in sorted(path for folder in folders for path in folder.rglob("report.json")):
        report = json.loads(path.read_text(encoding="utf-8"))
        found = report.get("found")
        if found is None:
            yield None
        else:
            yield Part(path.parent.name, found["volume_iou"], report["scores"]["volume_iou"], found["iou_with_delivered"])


def main(folders: Iterable[Path]) -> int:
    """Print the table; the exit status."""
    read = list(parts_in(folders))
    parts = sorted(filter(None, read), key=lambda part: part.lost, reverse=True)
    print(f"{'part':<40} {'found':>9} {'delivered':>9} {'lost':>9} {'both':>9}")
    for part in parts:
        both = " ".join(f"{'-' if iou is None else f'{iou:.5f}':>9}" for iou in (part.found, part.delivered))
        print(f"{part.name:<40} {both} {part.lost:>9.5f} {part.same:>9.5f}")
    losing = [part for part in parts if part.lost > LOST]
    worst = f", worst {parts[0].name} by {parts[0].lost:.5f}" if parts else ""
    print(f"{len(losing)} of {len(parts)} parts lost more than {LOST:g}{worst}; {len(read) - len(parts)} reports do not tell")
    return int(bool(losing))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    sys.exit(main(parser.parse_args().folders))
