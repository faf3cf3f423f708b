"""What became of each region of a target's surface: it is exact, approximated or left out; and whether the program explains a cloud.

Exact is what lies no farther from the delivered solid than the target itself leaves open: the noise of a cloud, the chords of a mesh. The
rest is approximated where the solid runs beside it at a small share of its own width, and left out where the solid runs elsewhere: a
missing wall, hole, tooth or letter has nothing beside it that faces its way.

Of a cloud, distances say nothing of the inside. Where the program does not explain it (`explanation`), no surface is exact only for lying
near. A scan's surface may leave the program as real things leave what was drawn, and no farther.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import KDTree

from imdim.delivery.explanation import Explanation, explain, share_borne_out
from imdim.delivery.region_kind import Recognised, find_double_bends, find_teeth, find_text, find_thread_regions, is_freeform
from imdim.delivery.surface_elements import SurfaceElements, elements_of
from imdim.detection.mesh_noise import DEVIATION
from imdim.detection.noise import MeasuredNoise
from imdim.export.surface_colours import VERDICTS, ColouredTarget
from imdim.geometry.components import components
from imdim.geometry.solid import SEGMENTS
from imdim.geometry.triangles import TriangleTree, distances, triangle_tree
from imdim.program.tree import Program
from imdim.target.target import Target

EXACT, APPROXIMATED, LEFT_OUT = range(3)
FOLLOWS = 0.1  # of its own width, by which a piece may lie off a surface that stands for it
ALONG = 0.5  # cosine between a normal and the way to the result: it runs beside the element, not across
STEP = 0.25  # of the tolerance: what the slope of the distance is measured over
WHOLE = 0.99  # share of the surface that is exact, from which a part is
MOSTLY = 0.5  # share that is left out, from which a result is none; that is blurred, from which its inside is a guess
ONE_SIDE = 0.4  # share of a result that no scanner could see, from which it is one in part: from one side that is about half
BORNE_OUT = 0.9  # share of a scan's surface that a program must run along; what it leaves out else is more than dents and bulges
LOST = 0.1  # share of a scan's surface that is left out, from which a result is one in part
BARE = 0.05  # share of a result's surface that no point is near, from which it is a result in part
LEAST_LISTED = 1e-4  # share of the surface: a smaller region is not listed
MOST_LISTED = 40  # regions
ROUNDING = 1e-9
FACES_ONE_WAY = 0.8  # length of the mean normal of a region that lies on one side of the part


@dataclass(frozen=True)
class JudgedRegion:
    """A connected piece of the target's surface with one verdict, or pieces that make one thing, such as teeth.

    `share` of the target's surface; `low` and `high` corners of its box; `furthest` from the result, all in model units. `kind` is thread,
    teeth, text, freeform or empty where it could not be told. In words: `what` it is, of which size, and `where`.
    """

    verdict: str
    kind: str
    share: float
    low: tuple[float, ...]
    high: tuple[float, ...]
    furthest: float
    what: str
    where: str


@dataclass(frozen=True, eq=False)
class SurfaceVerdict:
    """`shares` of the surface by verdict; `tolerance`, its median over the surface, in model units; `regions` that are not exact, the
    largest first; `codes` [n], places in VERDICTS, of the `elements`. `explanation` is how the program explains a cloud, `borne_out` the
    share of a scanned mesh that runs along it, where that was asked."""

    shares: Mapping[str, float]
    tolerance: float
    regions: tuple[JudgedRegion, ...]
    elements: SurfaceElements
    codes: np.ndarray
    explanation: Explanation | None = None
    borne_out: float | None = None

    @property
    def overall(self) -> str:
        """One word for the part: "left out" where most of it is, "not explained" where the program tells a cloud's points worse than their
        neighbours do or runs along less than half of a scan, "partial" where too much of its own surface has no points or is on walls
        thinner than the noise, or too much of a scan runs elsewhere, "exact" where nearly all of the part is."""
        if self.shares["left out"] > MOSTLY:
            return "left out"
        explanation, borne_out = self.explanation, 1.0 if self.borne_out is None else self.borne_out
        if borne_out < MOSTLY or (explanation is not None and explanation.is_shown_worse):
            return "not explained"
        guessed = explanation is not None and (explanation.bare > BARE or explanation.blurred > MOSTLY or explanation.unseen > ONE_SIDE)
        if borne_out < BORNE_OUT or self._is_lost or guessed or (explanation is not None and explanation.is_worse):
            return "partial"
        whole = self.shares["exact"] >= WHOLE and (explanation is None or explanation.bare + explanation.unseen <= 1 - WHOLE)
        return "exact" if whole else "approximated"

    @property
    def _is_lost(self) -> bool:
        """Whether more of a scan is left out than dents and bulges, near though the program runs."""
        return self.borne_out is not None and self.shares["left out"] > LOST

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against a program of a cloud or a scan, a sentence each."""
        doubts = [] if self.explanation is None else [*_doubts(self.explanation)]
        if self.borne_out is not None and self.borne_out < BORNE_OUT:
            doubts.append(f"the program runs along {percent(self.borne_out)} of the scan: what it leaves is more than dents and bulges")
        elif self._is_lost:
            doubts.append(f"{percent(self.shares['left out'])} of the scan is left out: its surface runs elsewhere than the program's")
        return tuple(doubts)

    def colour(self, target: Target) -> ColouredTarget:
        """`target`, which the verdict is on, as pictures draw it."""
        elements, codes = self.elements, self.codes
        if elements.mesh is None:
            codes = codes[KDTree(elements.points).query(target.points)[1]]
        return ColouredTarget(elements.mesh, codes, {name: percent(share) for name, share in self.shares.items()})


def judge(
    target: Target,
    result: trimesh.Trimesh,
    segments: int = SEGMENTS,
    program: Program | None = None,
    scanned: bool = False,
    noise: MeasuredNoise | None = None,
) -> SurfaceVerdict:
    """The verdict on each region of `target`, by the surface of a result that has `segments` edges per circle; all of it is left out where
    that is empty. With the `program` of the result, it is asked too whether that explains a cloud, or a mesh that was `scanned`.
    The target's `noise` is measured where the run that found the result did not.
    """
    elements = elements_of(target, segments, noise)
    tree = triangle_tree(result) if len(result.faces) else None
    if tree is not None:
        far = distances(tree, elements.points)
        codes = _judge_elements(elements, far, tree)
    else:
        far, codes = np.full(len(elements.points), np.inf), np.full(len(elements.points), LEFT_OUT)
    explanation = None if program is None or elements.noise is None else explain(program, elements.points, elements.noise, target.scanners)
    borne_out = None
    bulging = elements.noise.sigma if elements.noise is not None and elements.noise.bulges else 0.0
    if program is not None and scanned and (elements.mesh is not None or bulging):
        deviation = bulging or DEVIATION * elements.diagonal
        surface = elements.points, elements.normals, elements.areas
        borne_out = share_borne_out(program, *surface, deviation, elements.oriented)
    if explanation is not None:
        codes = np.where((codes == EXACT) & _doubted(explanation, elements.points), APPROXIMATED, codes)
    found = list(_recognise(elements, codes != EXACT))
    for one in found:
        # teeth that are not followed are left out as a whole, tips and roots with the flanks
        codes[one.chosen] = _most_of(elements, codes, one.chosen)
    areas = np.bincount(codes, elements.areas, len(VERDICTS))
    share_of = areas / areas.sum()
    regions = sorted(_regions(elements, codes, _furthest(elements, codes, far, tree), found), key=lambda r: -r.share)[:MOST_LISTED]
    shares: dict[str, float] = dict(zip(VERDICTS, share_of.tolist(), strict=True))
    return SurfaceVerdict(shares, float(np.median(elements.tolerance)), tuple(regions), elements, codes, explanation, borne_out)


def _doubted(explanation: Explanation, points: np.ndarray) -> np.ndarray:
    """Which of the points [n, 3] of a cloud show the program no more than something else that runs past them."""
    thin = explanation.is_blurred(points)
    return thin | explanation.is_explained_worse(points) if explanation.is_shown_worse else thin


def _doubts(explanation: Explanation) -> Iterator[str]:
    if explanation.is_shown_worse:
        yield "the program does not explain the points: a smooth sheet through their neighbours tells them better than its surface does"
    if explanation.bare > 1 - WHOLE:
        seen = "a scanner would have seen it" if explanation.unseen else "nobody saw it, or it is not there"
        yield f"no point is near {percent(explanation.bare)} of the program's surface: {seen}"
    if explanation.unseen > 1 - WHOLE:
        yield f"no scanner could see {percent(explanation.unseen)} of the program's surface: it closes what was seen in the shortest way"
    if explanation.blurred > 1 - WHOLE:
        yield f"{percent(explanation.blurred)} of the program's surface is on walls thinner than the noise: their thickness is not known"


def _judge_elements(elements: SurfaceElements, far: np.ndarray, tree: TriangleTree) -> np.ndarray:
    """The verdict [n] on each element; the smooth pieces of what lies off, each on one side of the result, are judged as one."""
    if elements.mesh is None:
        far = _calm(elements, far)
    off = far > elements.tolerance
    side = np.zeros(len(far), np.int64)
    side[off] = _sides(elements, off, tree)
    a, b = elements.links.T
    together = off[a] & off[b] & (side[a] == side[b]) & elements.smooth
    count, piece = components(a[together], b[together], len(far))
    cut = piece[a] != piece[b]
    ends, lengths = np.concatenate([a[cut], b[cut]]), np.tile(elements.lengths[cut], 2)
    area, around = np.bincount(piece, elements.areas, count), np.bincount(piece[ends], lengths, count)
    width = 4 * area / np.maximum(around, 1e-300)  # of a disc its diameter, of a strip twice its width
    mean = np.bincount(piece, far * elements.areas, count) / np.maximum(area, 1e-300)
    follows = (mean <= FOLLOWS * width)[piece] & (side != 0)
    return np.where(~off, EXACT, np.where(follows, APPROXIMATED, LEFT_OUT))


def _furthest(elements: SurfaceElements, codes: np.ndarray, far: np.ndarray, tree: TriangleTree | None) -> np.ndarray:
    """The largest distance [n] within each element that is not exact, its corners included."""
    if elements.mesh is None or tree is None:
        return far
    off = np.flatnonzero(codes != EXACT)
    corners, place = np.unique(np.asarray(elements.mesh.faces)[off], return_inverse=True)
    out = far.copy()
    out[off] = np.maximum(far[off], distances(tree, elements.mesh.vertices[corners])[place.reshape(-1, 3)].max(1, initial=0.0))
    return out


def _calm(elements: SurfaceElements, far: np.ndarray) -> np.ndarray:
    """Distances [n] of points of a cloud as the medians around each: a stray shows no region."""
    a, b = elements.links.T
    ends = np.concatenate([np.arange(len(far)), a, b])
    values = far[np.concatenate([np.arange(len(far)), b, a])]
    order = np.lexsort((values, ends))
    starts = np.searchsorted(ends[order], np.arange(len(far)))
    counts = np.bincount(ends, minlength=len(far))
    return values[order][starts + (counts - 1) // 2]


def _sides(elements: SurfaceElements, chosen: np.ndarray, tree: TriangleTree) -> np.ndarray:
    """+1 [k] where a chosen element lies outside of a result that runs beside it, -1 where inside, 0 where the result runs elsewhere."""
    points, normals = elements.points[chosen], elements.normals[chosen]
    step = STEP * elements.tolerance[chosen]
    ahead, behind = (distances(tree, points + (sign * step)[:, None] * normals) for sign in (1, -1))
    slope = (ahead - behind) / (2 * step)
    side = np.where(slope > 0, 1, -1) if elements.oriented else np.ones(len(slope), np.int64)
    return np.where(np.abs(slope) >= ALONG, side, 0)


def _recognise(elements: SurfaceElements, off: np.ndarray) -> Iterator[Recognised]:
    """Threads, teeth among what is left then, and text."""
    if elements.facets is None or not off.any():
        return
    for find in (find_thread_regions, find_teeth, find_text):
        for one in find(elements, elements.facets, off):
            off = off & ~one.chosen
            yield one


def _most_of(elements: SurfaceElements, codes: np.ndarray, chosen: np.ndarray) -> int:
    return int(np.bincount(codes[chosen], elements.areas[chosen], len(VERDICTS)).argmax())


def _regions(elements: SurfaceElements, codes: np.ndarray, far: np.ndarray, found: Sequence[Recognised]) -> Iterator[JudgedRegion]:
    """What was recognised, and the connected rest of one verdict each."""
    total = elements.areas.sum()
    rest = codes != EXACT
    for one in found:
        rest &= ~one.chosen
        yield _region(elements, one.chosen, int(codes[one.chosen][0]), one.kind, one.says, far, total)
    a, b = elements.links.T
    joined = rest[a] & rest[b] & (codes[a] == codes[b])
    count, label = components(a[joined], b[joined], len(codes))
    areas = np.bincount(label, elements.areas * rest, count)
    bent = None if elements.facets is None else find_double_bends(elements.facets)
    for number in np.argsort(-areas, kind="stable")[:MOST_LISTED]:
        if areas[number] >= LEAST_LISTED * total:
            chosen = label == number
            free = bent is not None and elements.facets is not None and is_freeform(elements, elements.facets, bent, chosen)
            kind = "freeform" if free else ""
            yield _region(elements, chosen, int(codes[chosen][0]), kind, kind, far, total)


def _region(elements: SurfaceElements, chosen: np.ndarray, code: int, kind: str, what: str, far: np.ndarray, total: float) -> JudgedRegion:
    areas, corners = elements.areas[chosen], elements.corners(chosen)
    low, high, share = corners.min(0), corners.max(0), float(areas.sum() / total)
    facing = areas @ elements.normals[chosen] / areas.sum() if elements.oriented else np.zeros(3)
    size, where = place_region(corners, facing, elements.diagonal)
    furthest = float(far[chosen].max())
    what = f"{what}, {size}" if what else size
    return JudgedRegion(VERDICTS[code], kind, share, tuple(low.tolist()), tuple(high.tolist()), furthest, what, where)


def place_region(corners: np.ndarray, facing: np.ndarray, diagonal: float) -> tuple[str, str]:
    """Of which size a region with these `corners` [n, 3] is, and where it lies, in words, to a thousandth of the part's `diagonal`; which
    side it faces by the mean `facing` [3] of its normals, 0 where nobody knows."""
    low, high, axis = corners.min(0), corners.max(0), int(np.abs(facing).argmax())
    side = f" on the {'+' if facing[axis] > 0 else '-'}{'xyz'[axis]} side" if abs(facing[axis]) >= FACES_ONE_WAY else ""
    digits = 3 - math.floor(math.log10(diagonal))
    size, at = (", ".join(f"{round(v, digits) + 0.0:.6g}" for v in values) for values in (high - low, (low + high) / 2))
    return size.replace(", ", " x "), f"at ({at}){side}"


def percent(share: float) -> str:
    """A share in words: what is not all is never told as 100 %, nor what is something as 0 %."""
    text = f"{100 * share:.1f} %"
    if text in ("0.0 %", "100.0 %"):
        whole = round(share)
        return f"{100 * whole} %" if abs(share - whole) < ROUNDING else "over 99.9 %" if whole else "under 0.1 %"
    return text


def describe_shares(verdict: SurfaceVerdict) -> str:
    """How much of the surface is exact, within which tolerance, and what became of the rest."""
    exact, approximated, left = (percent(verdict.shares[name]) for name in VERDICTS)
    return f"{exact} of the surface is exact (within {verdict.tolerance:.2g}), {approximated} approximated, {left} left out"
