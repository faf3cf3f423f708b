"""Find primitives that stand for a chamfer or a fillet: ``python scripts/bench/standins.py RESULTS``

RESULTS holds results folders. A box, a cone or a plain prism (an extruded drawing of at most four lines) stands for a blend if all that it
does to the part is slivers along edges. `reconstruction/stand_ins.py` says what these are, and replaces what it can. Exit status 1 where
there is one.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from imdim.program import codec
from imdim.reconstruction.stand_ins import find_stand_ins


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    documents = sorted(parser.parse_args().results.glob("*/program.json"))
    if not documents:
        print("no folder there has a program.json", file=sys.stderr)
        return 2
    total = 0
    for path in documents:
        found = list(find_stand_ins(codec.from_json(codec.parse(path.read_bytes()))))
        total += len(found)
        told = ", ".join(f"{s.number} ({s.kind}, {s.width:.2g} wide, {s.share:.1e} of the volume)" for s in found)
        print(f"{path.parent.name}: {told or 'none'}", flush=True)
    print(f"{len(documents)} parts: {total} primitives stand for a chamfer or a fillet")
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
