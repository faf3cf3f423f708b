"""A primitive as choices among places: what `policy_net` predicts instead of ten raw numbers.

The box of the target's cloud is the ruler. Along each of its three axes a place is one of `STEPS` + 1 marks from face to face, some marks
further out, or "beyond". A primitive is its `turn` (the axis of a cylinder, or a free rotation) and the low and high ends of its own
axis-parallel box, so that faces of boxes and ends of cylinders stand where the cloud shows them. Only what is turned freely needs more: two
columns of its rotation (or another of the `ROTATION_CODES`) and the logarithms of its sizes. Cones, tori and what is turned stand in the
cylinders that hold them, ellipsoids and what is extruded in boxes; a cone has its taper beside, which tells how much its ends differ, an
outline its form and the shares of its box.

Ends of cutters outside of the cloud's box are one choice: where a cut leaves the solid, its length is nobody's to know.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from imdim.data.canonical import shortest_from_z
from imdim.data.outlines import NO_FORM, SHARES, Family, family_of, mask_shares
from imdim.data.solids import BOX, CONE, CYLINDER, EXTRUDE, REVOLVE, SPHERE, TORUS, Solids
from imdim.learn.rotations import ROTATION_CODES

STEPS, OUTSIDE = 40, 20
PLACES = STEPS + 1 + 2 * OUTSIDE + 2  # beyond low, OUTSIDE marks, the marks of the box, OUTSIDE marks, beyond high
FIRST = OUTSIDE + 1  # the place of the box's low face
FREE, TURNS = 3, 4  # the turn of what no coordinate axis describes; 0 to 2: along x, y, z
OVAL = 1  # the turn of a sphere that is an ellipsoid along the axes; 0: a ball
BINS = 41
ENDS, NUMBERS, TAPER = 6, 10 + SHARES, 9
SIGNS = 3  # cut, united, intersected with
COMMON = 2
HIDDEN, BEYOND = 0.02, 0.1  # of an edge: a cutter's end further out is not seen, and where a network is told it is
THROUGH = 1.0  # of the longest edge: where such an end is put
ALIGNED = math.cos(math.radians(2.5))
SMALLEST = 1e-3
LEAST_BAR, MOST_SHARE, MOST_WALL = 0.02, 0.96, 0.46  # of an outline's box: how thick its bars may be, and each wall of a U
LOG_LOW, LOG_HIGH = math.log(0.005), math.log(1.3)


@dataclass(frozen=True)
class Choices:
    """`turn` and `form` [b], `places` [b, 6] (x low, x high, y low, ...) and `bins` [b, 13] (z axis, x axis, sizes, taper, shares of the
    outline's box), int64; `offsets` [b, 19] from the mark or bin, in steps, -0.5 to 0.5."""

    turn: Tensor
    form: Tensor
    places: Tensor
    bins: Tensor
    offsets: Tensor

    def shares(self) -> Tensor:
        """The ends [b, 6] in shares of the box's edges; what is beyond stands a little outside."""
        ends = (self.places - FIRST + self.offsets[:, :ENDS]) / STEPS
        ends = torch.where(self.places == 0, -BEYOND, ends)
        return torch.where(self.places == PLACES - 1, 1 + BEYOND, ends)

    def values(self) -> Tensor:
        """What places, bins and offsets stand for: ends in shares, numbers of 0 to 1, [b, ENDS + NUMBERS]."""
        return torch.cat([self.shares(), (self.bins + self.offsets[:, ENDS:]) / (BINS - 1)], 1)

    def mask_used_bins(self, kinds: Tensor, code: str = "columns") -> Tensor:
        """Which of the bins mean something, bool [b, NUMBERS], for tokens `kinds` [b]; `code` is of the rotation."""
        cornered, turn = ((kinds == BOX) | (kinds == SPHERE) | (kinds == EXTRUDE))[:, None], ROTATION_CODES[code]
        needed = torch.where(cornered, turn.box, turn.cylinder) > torch.arange(6, device=kinds.device)
        always = torch.ones_like(cornered)
        free = (self.turn == FREE)[:, None] & torch.cat([needed, always, always, cornered], 1)
        form = torch.where(kinds >= EXTRUDE, self.form, NO_FORM)
        return torch.cat([free, (kinds == CONE)[:, None], mask_shares(form, kinds == REVOLVE)], 1)

    def as_drawn(self) -> Choices:
        """Zero where the turn leaves nothing to choose: the bins of rotations and sizes along the axes."""
        drawn = (self.turn == FREE)[:, None] | (torch.arange(NUMBERS, device=self.turn.device) >= TAPER)
        return replace(self, bins=self.bins * drawn)


def numbers_of(solids: Solids, low: Tensor, edges: Tensor, code: str = "columns") -> Tensor:
    """What `encode` chooses for canonical `solids` [b, t], unrounded, as numbers [b, t, ENDS + NUMBERS + TURNS] for a network to read."""
    b, t = solids.kinds.shape
    flat = Solids(*(getattr(solids, f.name).flatten(0, 1)[:, None] for f in fields(Solids)))
    each_low, each_edges = (v[:, None].expand(b, t, 3).flatten(0, 1) for v in (low, edges))
    choices = encode(flat, each_low, each_edges, code)
    return torch.cat([choices.values(), one_hot(choices.turn, TURNS)], -1).view(b, t, -1) * solids.present[..., None]


def ruler(gt_points: Tensor) -> tuple[Tensor, Tensor]:
    """Lower corner and edges [b, 3] of the boxes of clouds [b, n, 3]."""
    low, high = gt_points.amin(1), gt_points.amax(1)
    return low, (high - low).clamp_min(SMALLEST)


def encode(part: Solids, low: Tensor, edges: Tensor, code: str = "columns") -> Choices:
    """The choices that describe canonical primitives `part` [b, 1] by the ruler `low`, `edges` [b, 3]."""
    kinds, rotation, sizes = part.kinds[:, 0], part.rotations[:, 0], to_hulls(part)[:, 0]
    axis = rotation[..., 2].abs()
    along = axis.argmax(-1)
    oval, turning = part.ellipsoids[:, 0], _is_turned(kinds) | (kinds == EXTRUDE)
    straight = torch.where(turning, axis.amax(-1), rotation.diagonal(dim1=-2, dim2=-1).amin(-1)) > ALIGNED
    turn = torch.where(straight, torch.where(turning, along, torch.where(oval, OVAL, 0)), FREE)
    turn = torch.where((kinds == SPHERE) & ~oval, 0, turn)
    spun = (shortest_from_z(part.rotations[:, 0, :, 2]).mT @ rotation[..., :1])[..., 0, 0] < ALIGNED
    turn = torch.where((kinds == EXTRUDE) & spun, FREE, turn)
    half, middle = half_extents(kinds, rotation, sizes, turn), part.centers[:, 0] - low
    # of what is turned freely the ends say the middle alone: where they are further out than marks go they move in by as much each
    room = torch.minimum(middle, edges - middle) + edges * (OUTSIDE / STEPS)
    half = torch.where((turn == FREE)[:, None], torch.minimum(half, room.clamp_min(0.0)), half)
    ends = torch.stack([middle - half, middle + half], -1) / edges[..., None]
    has_ends = (kinds == CYLINDER) | (kinds == EXTRUDE)
    flat = ((kinds == BOX)[:, None] | (has_ends[:, None] & one_hot(along, 3).bool())) & (turn != FREE)[:, None]
    unseen = (flat & ~part.positive)[..., None] & ((ends < -HIDDEN) | (ends > 1 + HIDDEN))
    places, shift = to_places(ends.flatten(1), unseen.flatten(1))
    scaled = (torch.log(sizes.clamp_min(SMALLEST)) - LOG_LOW) / (LOG_HIGH - LOG_LOW)
    taper = (to_taper(part) + 1) / 2
    bins, moved = to_bins(torch.cat([ROTATION_CODES[code].numbers(rotation), scaled, taper, part.shares[:, 0]], -1))
    return Choices(turn, part.forms[:, 0], places, bins, torch.cat([shift, moved], -1))


def encode_signs(part: Solids) -> Tensor:
    """0 for what is cut, 1 for what is united, COMMON for what is intersected with, [b], of `part` [b, 1]."""
    return torch.where(part.common[:, 0], COMMON, part.positive[:, 0].long())


def decode(kinds: Tensor, signs: Tensor, choices: Choices, low: Tensor, edges: Tensor, code: str = "columns") -> Solids:
    """Primitives [b, 1] of kinds [b] (tokens ADD_*) and signs [b] (see `encode_signs`) that `choices` describe."""
    ends = choices.shares().view(-1, 3, 2) * edges[..., None] + low[..., None]
    # a cutter may have to remove what a positive primitive left far outside
    far = edges.amax(-1)[:, None] * THROUGH
    places = choices.places.view(-1, 3, 2)
    ends = torch.where(places == 0, (low - far)[..., None], torch.where(places == PLACES - 1, (low + edges + far)[..., None], ends))
    known = (places != 0) & (places != PLACES - 1)
    turned = one_hot(choices.turn.clamp_max(2), 3).bool()
    free = choices.turn == FREE
    turning, ball = _is_turned(kinds), (kinds == SPHERE) & (choices.turn == 0)
    # the axes along which the primitive is as wide as its radius
    across = (ball[:, None] | (turning[:, None] & ~turned)) & ~free[:, None]
    radius, middle = _radius_and_middle(ends, known, across)
    edge = (ends[..., 1] - ends[..., 0]).abs()
    height = (edge * turned).sum(-1)
    zero = torch.zeros_like(radius)
    round_sizes = torch.stack([radius, height, zero], -1)
    numbers = choices.values()[:, ENDS:]
    free_sizes = torch.exp(LOG_LOW + numbers[:, 6:TAPER] * (LOG_HIGH - LOG_LOW))
    hulls = torch.where(free[:, None], free_sizes, torch.where((turning | ball)[:, None], round_sizes, edge)).clamp_min(SMALLEST)
    eye = torch.eye(3, device=kinds.device)
    has_axis = turning | (kinds == EXTRUDE)
    straight = torch.where(has_axis[:, None, None], shortest_from_z(eye[choices.turn.clamp_max(2)]), eye)
    rotation = torch.where(free[:, None, None], ROTATION_CODES[code].rotations(numbers[:, :6]), straight)
    # the box of what is extruded has its height along z
    local = (straight.abs().mT @ hulls[..., None])[..., 0]
    hulls = torch.where(((kinds == EXTRUDE) & ~free)[:, None], local, hulls)
    sizes = from_hulls(kinds, hulls, 2 * numbers[:, TAPER] - 1, ball)
    drawn = kinds >= EXTRUDE
    # an outline needs a form
    form = torch.where(drawn, choices.form.clamp_min(1), NO_FORM)
    shares = torch.where(mask_shares(form, kinds == REVOLVE), numbers[:, TAPER + 1 :].clamp(0, MOST_SHARE), 0.0)
    bars = (family_of(form) >= Family.ELL)[:, None] & (torch.arange(SHARES, device=kinds.device) < 2)
    shares = torch.where(bars, shares.clamp_min(LEAST_BAR), shares)
    family = family_of(form)
    polygon = (kinds == EXTRUDE) & (family >= Family.TRIANGLE) & (family <= Family.OCTAGON)
    sizes = torch.where(polygon[:, None] & (torch.arange(3, device=kinds.device) < 2), sizes[:, :2].amax(1, keepdim=True), sizes)
    thin = torch.where(family == Family.CHANNEL, MOST_WALL, MOST_SHARE)
    shares = torch.cat([torch.where(family == Family.ROUNDED, shares[:, 0], torch.minimum(shares[:, 0], thin))[:, None], shares[:, 1:]], 1)
    columns = (kinds, signs == 1, middle, sizes, rotation, form, shares, signs == COMMON)
    return Solids(*(column[:, None] for column in columns))


def _is_turned(kinds: Tensor) -> Tensor:
    """Which kinds are round about their axis and no balls."""
    return (kinds == CYLINDER) | (kinds == CONE) | (kinds == TORUS) | (kinds == REVOLVE)


def to_hulls(part: Solids) -> Tensor:
    """Sizes [b, t, 3] of what holds the primitives most tightly: edges of boxes, radius and height of cylinders, radius of balls."""
    a, b, c = part.sizes.unbind(-1)
    zero, kinds = torch.zeros_like(a), part.kinds[..., None]
    cone, ring = torch.stack([torch.maximum(a, b), c, zero], -1), torch.stack([a + b, 2 * b, zero], -1)
    hulls = torch.where(part.ellipsoids[..., None], 2 * part.sizes, part.sizes)
    return torch.where(kinds == CONE, cone, torch.where(kinds == TORUS, ring, hulls))


def to_taper(part: Solids) -> Tensor:
    """By how much the top of cones [b, t] is wider than the bottom, -1 (a tip at the top) to 1, as a share of the wider one; else 0."""
    bottom, top, _ = part.sizes.unbind(-1)
    taper = (top - bottom) / torch.maximum(top, bottom).clamp_min(SMALLEST)
    return torch.where(part.kinds == CONE, taper.clamp(-1, 1), 0.0)


def from_hulls(kinds: Tensor, hulls: Tensor, taper: Tensor, ball: Tensor) -> Tensor:
    """Sizes [b, 3] of primitives `kinds` [b] that are held by `hulls` [b, 3]; of spheres those that are a `ball`, bool [b]."""
    wide, tall, _ = hulls.unbind(-1)
    zero = torch.zeros_like(wide)
    narrow = wide * (1 - taper.abs())
    cone = torch.stack([torch.where(taper > 0, narrow, wide), torch.where(taper > 0, wide, narrow), tall], -1)
    minor = torch.minimum(tall, wide) / 2
    ring, cylinder = torch.stack([wide - minor, minor, zero], -1), torch.stack([wide, tall, zero], -1)
    sphere = torch.where(ball[:, None], torch.stack([wide, zero, zero], -1), hulls / 2)
    kinds = kinds[:, None]
    sizes = torch.where(kinds == CONE, cone, torch.where(kinds == TORUS, ring, torch.where(kinds == CYLINDER, cylinder, hulls)))
    return torch.where(kinds == SPHERE, sphere, sizes)


def half_extents(kinds: Tensor, rotation: Tensor, sizes: Tensor, turn: Tensor) -> Tensor:
    """Half the edges [b, 3] of the axis-parallel boxes of hulls of `sizes` [b, 3] (see `to_hulls`); nearly straight ones are straight."""
    free, straight = (turn == FREE)[:, None], one_hot(turn.clamp_max(2), 3).to(sizes)
    axis = torch.where(free, rotation[..., 2].abs(), straight)
    along = torch.where((kinds == EXTRUDE)[:, None], (shortest_from_z(straight).abs() @ sizes[..., None])[..., 0], sizes)
    box = torch.where(free, (rotation.abs() @ sizes[..., None])[..., 0], along) / 2
    radius, height = sizes[:, :1], sizes[:, 1:2]
    cylinder = height / 2 * axis + radius * torch.sqrt((1 - axis.square()).clamp_min(0.0))
    cornered = (kinds == BOX) | (kinds == EXTRUDE) | ((kinds == SPHERE) & (turn != 0))
    return torch.where(cornered[:, None], box, torch.where(_is_turned(kinds)[:, None], cylinder, radius))


def to_places(ends: Tensor, unseen: Tensor) -> tuple[Tensor, Tensor]:
    """Places int64 and offsets of `ends` in shares; those `unseen` and those too far out are beyond."""
    mark = (ends * STEPS).round()
    below = (mark < -OUTSIDE) | (unseen & (ends < 0.5))
    above = (mark > STEPS + OUTSIDE) | (unseen & (ends > 0.5))
    place = torch.where(below, 0, torch.where(above, PLACES - 1, mark + FIRST))
    return place.long(), torch.where(below | above, 0.0, ends * STEPS - mark)


def to_bins(numbers: Tensor) -> tuple[Tensor, Tensor]:
    """Bins int64 and offsets of `numbers` of 0 to 1."""
    position = numbers * (BINS - 1)
    bins = position.round().clamp(0, BINS - 1)
    return bins.long(), (position - bins).clamp(-0.5, 0.5)


def _radius_and_middle(ends: Tensor, known: Tensor, across: Tensor) -> tuple[Tensor, Tensor]:
    """Radius [b] by the axes `across` [b, 3] that show both ends, and centres [b, 3]; one known end and the radius give a centre too."""
    both = known.all(-1) & across
    half = (ends[..., 1] - ends[..., 0]).abs() / 2
    some = both.any(-1)
    counted = torch.where(some[:, None], both, across)
    radius = (half * counted).sum(-1) / counted.sum(-1).clamp_min(1)
    middle = ends.mean(-1)
    one = across & (known[..., 0] != known[..., 1]) & some[:, None]
    from_end = torch.where(known[..., 0], ends[..., 0] + radius[:, None], ends[..., 1] - radius[:, None])
    return radius, torch.where(one, from_end, middle)


def relative(points: Tensor, low: Tensor, edges: Tensor) -> Tensor:
    """Points [b, n, 3] in shares of the box: 0 at its low faces, 1 at its high ones."""
    return (points - low[:, None]) / edges[:, None]
