"""`ShapeState`: the append-only DSL in which a policy writes programs, one token and one 10-D vector at a time.

The solid of a state is the left fold of its primitives: a positive one is united with what is there, a negative one is
cut out of it. A vector reads ``(cx, cy, cz, p0, p1, p2, rx, ry, rz, sign_raw)``:

========  =====================================================================================
kind      p0, p1, p2
========  =====================================================================================
box       sx, sy, sz
sphere    r; p1, p2 ignored, or with `ellipsoids` the two other semi-axes (both zero: a sphere)
cylinder  r, h; p2 ignored
cone      r_bottom, r_top, h
torus     r_major, r_minor; p2 ignored
========  =====================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import dropwhile
from typing import cast

from imdim.program.plain_outlines import to_simple
from imdim.program.sequence import SignedSequence, Step, flatten, to_program
from imdim.program.tree import SIZE_NAMES, Primitive, Program, Vec3

PARAM_COUNT = 10
Params = tuple[float, float, float, float, float, float, float, float, float, float]


class Token(IntEnum):
    """The vocabulary. Ids are part of data sets and checkpoints: they never change, new tokens are appended."""

    ADD_BOX = 0
    ADD_SPHERE = 1
    ADD_CYLINDER = 2
    UNDO_LAST = 3
    END = 4
    ADD_CONE = 5
    ADD_TORUS = 6


ADD_BOX, ADD_SPHERE, ADD_CYLINDER, UNDO_LAST, END, ADD_CONE, ADD_TORUS = Token
KIND_OF: Mapping[Token, str] = {
    ADD_BOX: "box",
    ADD_SPHERE: "sphere",
    ADD_CYLINDER: "cylinder",
    ADD_CONE: "cone",
    ADD_TORUS: "torus",
}
TOKEN_OF: Mapping[str, Token] = {kind: token for token, kind in KIND_OF.items()}
_SIGNS: Mapping[str, int] = {"union": 1, "difference": -1}

# A policy may emit a size of exactly zero; any other size is read as its magnitude, so positive sizes stay exact.
ZERO_SIZE = 1e-6


@dataclass(frozen=True, slots=True)
class SignedPrimitive:
    """A primitive as it was emitted: `kind` of KIND_OF and the raw vector, from which everything else is read."""

    kind: str
    raw_params: Params

    @property
    def center(self) -> Vec3:
        return self.raw_params[0:3]

    @property
    def size(self) -> Vec3:
        """(p0, p1, p2) as emitted."""
        return self.raw_params[3:6]

    @property
    def rotation(self) -> Vec3:
        """Euler degrees."""
        return self.raw_params[6:9]

    @property
    def sign(self) -> int:
        """+1 (solid) where sigmoid(sign_raw) >= 0.5, else -1 (cutout)."""
        # the sigmoid is 0.5 at 0; comparing the logit is free of rounding and the same in every float type
        return 1 if self.raw_params[9] >= 0 else -1

    def solid(self, ellipsoids: bool = False) -> Primitive:
        """The primitive of the tree, sign aside. Every finite vector reads as a proper solid: sizes by magnitude, torus radii in order."""
        kind, size = _read_size(self.kind, self.size, ellipsoids)
        return Primitive(kind, size, self.center, self.rotation)


@dataclass
class ShapeState:
    """A program in the making: the primitives in order, and whether END was applied.

    `ellipsoids` chooses the reading of a sphere's p1 and p2. A state changes in place; `copy` branches it.
    """

    primitives: list[SignedPrimitive] = field(default_factory=list)
    done: bool = False
    ellipsoids: bool = False

    def apply_action(self, token: int, params: Iterable[float] | None = None) -> ShapeState:
        """Apply one token in place and return this state. `params` (ten finite numbers) is read by ADD_* tokens only.

        UNDO_LAST on an empty state changes nothing. Raises ValueError after END, for an unknown token and for a bad vector.
        """
        if self.done:
            raise ValueError(f"token {token} after END")
        if token == UNDO_LAST:
            del self.primitives[-1:]
        elif token == END:
            self.done = True
        elif token in KIND_OF:
            self.primitives.append(SignedPrimitive(KIND_OF[Token(token)], _check_params(params)))
        else:
            raise ValueError(f"unknown token {token}; known are 0 to {len(Token) - 1}")
        return self

    def action_mask(self, mask_empty_end: bool = True, vocabulary: int = len(Token)) -> tuple[bool, ...]:
        """Which of the first `vocabulary` tokens may come next.

        UNDO_LAST is masked while there is no primitive, and so is END if `mask_empty_end`, which makes every finished
        state hold at least one primitive. After END everything is masked.
        """
        if self.done:
            return (False,) * vocabulary
        masked = set() if self.primitives else ({UNDO_LAST, END} if mask_empty_end else {UNDO_LAST})
        return tuple(token not in masked for token in range(vocabulary))

    def to_primitives(self) -> list[SignedPrimitive]:
        """The primitives in order, for a geometry backend."""
        return list(self.primitives)

    def actions(self) -> Iterator[tuple[Token, Params]]:
        """The shortest token sequence that leads here; UNDO_LAST does not occur, END carries zeros."""
        for primitive in self.primitives:
            yield TOKEN_OF[primitive.kind], primitive.raw_params
        if self.done:
            yield END, _check_params((0.0,) * PARAM_COUNT)

    def copy(self) -> ShapeState:
        return ShapeState(list(self.primitives), self.done, self.ellipsoids)

    def to_sequence(self) -> SignedSequence[Primitive]:
        """The steps from the first positive primitive on: negative ones before it cut nothing and do not appear."""
        solids = (Step("union" if p.sign > 0 else "difference", p.solid(self.ellipsoids)) for p in self.primitives)
        return tuple(dropwhile(lambda step: not step.positive, solids))

    def to_program(self) -> Program | None:
        """Lift to the tree; None if nothing positive is there."""
        sequence = self.to_sequence()
        return to_program(sequence) if sequence else None

    @classmethod
    def from_sequence(cls, sequence: SignedSequence[Primitive]) -> ShapeState:
        """The state that writes unions and differences of primitives, done. KeyError for an intersection, ValueError for an outline."""
        ellipsoids = any(p.kind == "ellipsoid" for _, p in sequence)
        return cls([_emit(p, _SIGNS[op]) for op, p in sequence], True, ellipsoids)

    @classmethod
    def from_program(cls, program: Program) -> ShapeState:
        """Lower a program whose solid is a signed sequence of its own primitives (see `flatten`, which raises ValueError for others).

        A left fold of unions and differences comes back from `to_program` as the same tree; other nestings keep the solid.
        """
        return cls.from_sequence(flatten(program))


def _emit(primitive: Primitive, sign: int) -> SignedPrimitive:
    simple = to_simple(primitive)
    if simple is None:
        raise ValueError(f"a state knows no outlines: {primitive.kind} is lowered only where it is a box, a cylinder or a torus")
    primitive = simple
    kind = "sphere" if primitive.kind == "ellipsoid" else primitive.kind
    size = primitive.size + (0.0,) * (3 - len(primitive.size))
    return SignedPrimitive(kind, _check_params((*primitive.center, *size, *primitive.rotation, float(sign))))


def _read_size(kind: str, raw: Sequence[float], ellipsoids: bool) -> tuple[str, tuple[float, ...]]:
    if kind == "sphere" and ellipsoids and (raw[1] or raw[2]):
        kind = "ellipsoid"
    size = [abs(v) for v in raw[: len(SIZE_NAMES[kind])]]
    if kind == "cone":
        radii = size[:2] if any(size[:2]) else [ZERO_SIZE, 0.0]
        return kind, (*radii, size[2] or ZERO_SIZE)
    size = [v or ZERO_SIZE for v in size]
    return kind, tuple(sorted(size, reverse=True)) if kind == "torus" else tuple(size)


def _check_params(params: Iterable[float] | None) -> Params:
    values = () if params is None else tuple(float(v) for v in params)
    if len(values) != PARAM_COUNT:
        raise ValueError(f"a primitive needs {PARAM_COUNT} parameters, got {len(values)}")
    for i, value in enumerate(values):
        if not math.isfinite(value):
            raise ValueError(f"a primitive needs finite parameters, got {value} at index {i}")
    return cast(Params, values)
