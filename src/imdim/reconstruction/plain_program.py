"""Whether a part is told by drawings or by primitives alone.

One outline may stand for a dozen primitives, and a search that counts features always draws. But a plate with two holes is a box and two
cylinders to those who edit it: each has its own numbers, and moves by itself. So a short program of primitives is taken where there is
hardly more to read in it, and the part is the same. What is to read is counted as in a minimum description length (Rissanen 1978), with
one for each feature and number and half of one for the kind of a curve.
"""

from __future__ import annotations

from imdim.program.cost import count, reading_length
from imdim.program.tree import Program
from imdim.reconstruction.observation import Observation

MOST_CURVES = 40  # of drawings: so many are no dozen primitives
MOST_PRIMITIVES = 12  # of a program that is read primitive by primitive
MORE = 1.4  # times as much to read as in the drawings, that primitives may be
SAME = 0.8  # of a primitive's price: by how much less of the part they may be


def may_be_plain(drawn: Program) -> bool:
    """Whether a program has outlines, and so few curves that primitives may tell the part."""
    return 0 < count(drawn).curves <= MOST_CURVES


def is_plainer(plain: Program, drawn: Program, seen: Observation) -> bool:
    """Whether primitives are to be preferred to drawings."""
    counts = count(plain)
    if counts.curves or counts.primitives > MOST_PRIMITIVES or reading_length(plain) > MORE * reading_length(drawn):
        return False
    have, before = seen.iou(plain), seen.iou(drawn)
    return have is not None and before is not None and have >= before - SAME * seen.size_weight
