"""Relations as a person would say them: "hole (3, 4) have equal diameter", "boss and hole share one axis"."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from imdim.export.feature_names import name_leaves
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.constraints import AXES_OF, WORLD, Constraint, Ref
from imdim.program.tree import Primitive

_SIZES: Mapping[str, str] = {
    "sx": "length along x",
    "sy": "length along y",
    "sz": "length along z",
    "r": "diameter",
    "h": "height",
    "r_bottom": "diameter at the bottom",
    "r_top": "diameter at the top",
    "r_major": "ring radius",
    "r_minor": "tube radius",
    "rx": "radius along x",
    "ry": "radius along y",
    "rz": "radius along z",
}

_SIDES = (("left", "right"), ("front", "back"), ("bottom", "top"))  # by axis, of what looks down it and up it
UPRIGHT = 1 - 1e-9  # cosine
ROUND_SIZES = frozenset(name for name, word in _SIZES.items() if "diameter" in word)  # of which twice is said


def join_words(words: Sequence[str]) -> str:
    """ "a", "a and b", "a, b and c"."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1]))) if words else "nothing"


def name_side(part: Primitive, ref: Ref) -> str:
    """A plane face by where it looks, as in the standard views: "top", "left"; by its axis where it is tilted."""
    outward = ref.side * matrix_from_euler(part.rotation)[:, ref.axis]
    axis = int(np.argmax(np.abs(outward)))
    return _SIDES[axis][bool(outward[axis] > 0)] if abs(outward[axis]) > UPRIGHT else ref.feature


def say_relation(constraint: Constraint, labels: Sequence[str], parts: Sequence[Primitive], unit: str) -> str:
    """What a constraint says of primitives `parts` that are called by `labels`, lengths in `unit`."""
    return _SAY[constraint.kind](constraint, _Speaker(labels, parts, unit))


class _Speaker:
    """The words for features of some primitives."""

    def __init__(self, labels: Sequence[str], parts: Sequence[Primitive], unit: str) -> None:
        self._labels, self._parts, self._unit = labels, parts, unit

    def things(self, refs: Iterable[Ref]) -> list[str]:
        return name_leaves((ref.leaf for ref in refs if ref.leaf != WORLD), self._labels)

    def thing(self, ref: Ref) -> str:
        """A feature: a primitive for its centre or its only axis, "the top face of plate", "the x axis of plate", "the z axis"."""
        if ref.leaf == WORLD:
            return f"the {ref.feature} axis"
        whole = self.things([ref])[0]
        if ref.side:
            return f"the {name_side(self._parts[ref.leaf], ref)} face of {whole}"
        return whole if not ref.feature or len(AXES_OF[self._parts[ref.leaf].kind]) == 1 else f"the {ref.feature} axis of {whole}"

    def each(self, refs: Iterable[Ref]) -> list[str]:
        return list(dict.fromkeys(map(self.thing, refs)))

    def length(self, value: float) -> str:
        return f"{value:.5g} {self._unit}".strip()


def _say_equal(c: Constraint, s: _Speaker) -> str:
    by_word: dict[str, list[Ref]] = {}
    for ref in c.of:
        by_word.setdefault(_SIZES[ref.feature], []).append(ref)
    if len(by_word) == 1:
        return f"{join_words(s.things(c.of))} have equal {next(iter(by_word))}"
    return f"{join_words([f'{word} of {join_words(s.things(of))}' for word, of in by_word.items()])} are equal"


def _say_value(c: Constraint, s: _Speaker) -> str:
    twice = 2 if c.of[0].feature in ROUND_SIZES else 1
    return f"{_SIZES[c.of[0].feature]} of {s.thing(Ref(c.of[0].leaf))} is {s.length(twice * c.value)}"


def _say_parallel(c: Constraint, s: _Speaker) -> str:
    frame = [ref for ref in c.of if ref.leaf == WORLD]
    own = [ref for ref in c.of if ref.leaf != WORLD]
    single = all(len(s.each([ref])) == 1 and "axis of" not in s.thing(ref) for ref in own)
    who = s.things(own) if single else s.each(own)
    if not frame:
        return f"{join_words(who)} are parallel"
    return f"{join_words(who)} {_are(own)} parallel to {join_words(s.each(frame))}"


def _say_apart(c: Constraint, s: _Speaker) -> str:
    """Faces in one plane, or so far apart."""
    who = join_words(s.each(c.of))
    return f"{who} are {s.length(abs(c.value))} apart" if c.value else f"{who} are flush"


def _say_aligned(c: Constraint, s: _Speaker) -> str:
    assert c.about is not None
    who = join_words([s.thing(ref) for ref in c.of])
    along = f"along {s.thing(c.about)}"
    return f"{who} are {s.length(abs(c.value))} apart {along}" if c.value else f"{who} are level {along}"


def _say_tangent(c: Constraint, s: _Speaker) -> str:
    one, two = (s.thing(ref if ref.side else Ref(ref.leaf)) for ref in c.of)
    return f"{one} is tangent to {two}"


def _say_symmetric(c: Constraint, s: _Speaker) -> str:
    assert c.about is not None
    one, two, middle = (s.thing(ref) for ref in c.of)
    return f"{middle} is midway between {one} and {two} along {s.thing(c.about)}"


def _say_circular(c: Constraint, s: _Speaker) -> str:
    assert c.about is not None
    is_free = c.about.leaf in {ref.leaf for ref in c.of}
    around = "on a circle" if is_free else f"around {s.thing(c.about)}"
    return f"{join_words(s.things(c.of))} are spaced evenly {around}"


def _are(refs: Sequence[Ref]) -> str:
    return "is" if len({ref.leaf for ref in refs}) == 1 else "are"


_SAY: Mapping[str, Callable[[Constraint, _Speaker], str]] = {
    "equal": _say_equal,
    "value": _say_value,
    "parallel": _say_parallel,
    "perpendicular": lambda c, s: f"{join_words(s.each(c.of))} are at a right angle",
    "coplanar": _say_apart,
    "aligned": _say_aligned,
    "coaxial": lambda c, s: f"{join_words(s.things(c.of))} share one axis",
    "concentric": lambda c, s: f"{join_words(s.things(c.of))} share one centre",
    "tangent": _say_tangent,
    "symmetric": _say_symmetric,
    "linear": lambda c, s: f"{join_words(s.things(c.of))} stand in a row with equal steps",
    "circular": _say_circular,
}
