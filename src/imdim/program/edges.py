"""Edge features: fillets and chamfers, each of some edges of a program's solid.

An edge is named by the two faces that meet in it, and a face by its primitive and its name there, so that it survives changes of numbers:

==================  ==========================================================================================
primitive           names of its faces
==================  ==========================================================================================
box                 ``+x``, ``-x``, ``+y``, ``-y``, ``+z``, ``-z``
cylinder, cone      ``+z``, ``-z`` and ``side``
extrude             ``+z``, ``-z`` and, for curve k of loop i, ``wall[i][k]``; none for an ellipse
drafted             as extrude
revolve             for curve k of loop i ``wall[i][k]``; none for an ellipse
sphere, torus, ...  ``side``
==================  ==========================================================================================

The faces are those of the sharp program; wherever two of them meet in an edge of its solid, the feature applies.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Literal, NamedTuple

from imdim.program.ellipse import Ellipse
from imdim.program.fields import shorten
from imdim.program.outline import Curve, loop_curves
from imdim.program.tree import Primitive

EdgeKind = Literal["fillet", "chamfer"]
EDGE_KINDS: tuple[EdgeKind, ...] = ("fillet", "chamfer")
SIZES_OF: Mapping[str, tuple[str, ...]] = {"fillet": ("radius",), "chamfer": ("distance", "second")}

_FACE = re.compile(r"(\d{1,9})\.([+-][xyz]|side|wall\[\d{1,4}\]\[\d{1,4}\])")
_WALL = re.compile(r"wall\[(\d+)\]\[(\d+)\]")
_PLANES = {"box": "xyz", "cylinder": "z", "cone": "z", "extrude": "z", "drafted": "z"}


EdgeNumber = tuple[int, int]  # of the feature, and of the edge there


class Blending(NamedTuple):
    """The edges of features that were to be blended in a solid, and those of them that stayed sharp."""

    edges: tuple[EdgeNumber, ...] = ()
    sharp: tuple[EdgeNumber, ...] = ()


class Face(NamedTuple):
    """A face of leaf number `leaf`, by its name; see the module's table."""

    leaf: int
    name: str

    def __str__(self) -> str:
        return f"{self.leaf}.{self.name}"


@dataclass(frozen=True, slots=True)
class EdgeFeature:
    """A fillet of one radius, or a chamfer of one distance or of two, the first along the first face of each of its `edges`.

    `name` is what texts call it, and may be empty.
    """

    kind: EdgeKind
    sizes: tuple[float, ...]
    edges: tuple[tuple[Face, Face], ...]
    name: str = ""

    @property
    def size_names(self) -> tuple[str, ...]:
        """What texts call its sizes."""
        return tuple(f"{self.name or self.kind}_{what}" for what in SIZES_OF[self.kind][: len(self.sizes)])

    def __post_init__(self) -> None:
        if self.kind not in EDGE_KINDS:
            raise ValueError(f"unknown edge feature {self.kind!r}; known are {', '.join(EDGE_KINDS)}")
        most = 1 if self.kind == "fillet" else 2
        if not 1 <= len(self.sizes) <= most:
            raise ValueError(f"a {self.kind} needs {'one size' if most == 1 else 'one size or two'}, got {len(self.sizes)}")
        for size in self.sizes:
            if not math.isfinite(size) or size <= 0:
                raise ValueError(f"a {self.kind} needs a positive {'radius' if most == 1 else 'distance'}, got {size}")
        if not self.edges:
            raise ValueError(f"a {self.kind} needs at least one edge")


def read_face(text: object) -> Face:
    """The face that a text like ``3.wall[0][2]`` names; ValueError for any other."""
    match = _FACE.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise ValueError("expected a face like 0.+z, 1.side or 2.wall[0][3]")
    return Face(int(match[1]), match[2])


def wall_curve(leaf: Primitive, name: str) -> Curve | None:
    """The line or arc of an outline that a name like ``wall[0][3]`` means, None where there is none: blends of the walls of ellipses are
    not known."""
    if _WALL.fullmatch(name) is None or leaf.outline is None:
        return None
    loops, (i, k) = leaf.outline.loops, wall_place(name)
    curve = loop_curves(loops[i])[k] if i < len(loops) and k < len(loops[i]) else None
    return None if isinstance(curve, Ellipse) else curve


def wall_place(name: str) -> tuple[int, int]:
    """Loop and curve that a name like ``wall[0][3]`` means; ValueError for any other."""
    match = _WALL.fullmatch(name)
    if match is None:
        raise ValueError(f"expected a wall like wall[0][3], got {name!r}")
    return int(match[1]), int(match[2])


def faces_of(leaf: Primitive) -> list[str]:
    """The names of a primitive's faces."""
    planes = [sign + axis for axis in _PLANES.get(leaf.kind, "") for sign in "+-"]
    if leaf.outline is not None:
        rings = [(i, loop) for i, loop in enumerate(leaf.outline.loops) if not isinstance(loop, Ellipse)]
        return planes + [f"wall[{i}][{k}]" for i, loop in rings for k in range(len(loop))]
    return planes if leaf.kind == "box" else [*planes, "side"]


def check_edges(features: Sequence[EdgeFeature], parts: Sequence[Primitive]) -> None:
    """Raise ValueError, a line that names it, for the first face that the program `parts` are the leaves of does not have."""
    for number, feature in enumerate(features):
        for face in (face for edge in feature.edges for face in edge):
            if face.leaf >= len(parts):
                raise ValueError(f"edges[{number}]: {face} is a face of primitive {face.leaf}, but there are {len(parts)}")
            if face.name not in faces_of(parts[face.leaf]):
                raise ValueError(f"edges[{number}]: {parts[face.leaf].kind} {face.leaf} has no face {shorten(face.name)}")


def renumber_edges(features: Sequence[EdgeFeature], place: Mapping[int, int]) -> tuple[EdgeFeature, ...]:
    """The features of a program whose leaf number i is number `place[i]` of another one."""

    def moved(face: Face) -> Face:
        return Face(place[face.leaf], face.name)

    return tuple(replace(f, edges=tuple((moved(one), moved(two)) for one, two in f.edges)) for f in features)


def scale_edges(features: Sequence[EdgeFeature], factor: float) -> tuple[EdgeFeature, ...]:
    """The features with sizes times `factor`."""
    return tuple(replace(f, sizes=tuple(s * factor for s in f.sizes)) for f in features)


def name_edges(features: Sequence[EdgeFeature], taken: Iterable[str] = ()) -> tuple[EdgeFeature, ...]:
    """The features with names of their own, those that they have or else by their kinds; no name of a size is one of those `taken`."""
    out: list[EdgeFeature] = []
    used = set(taken)
    for feature in features:
        names = ((feature.name or feature.kind) + (str(n) if n > 1 else "") for n in count(1))
        named = next(f for name in names if used.isdisjoint((f := replace(feature, name=name)).size_names))
        used.update(named.size_names)
        out.append(named)
    return tuple(out)


def with_sizes(features: Sequence[EdgeFeature], values: Mapping[str, float]) -> tuple[EdgeFeature, ...]:
    """The features with the sizes that `values` gives by their names, the others as they are."""
    return tuple(
        replace(f, sizes=tuple(values.get(name, size) for name, size in zip(f.size_names, f.sizes, strict=True))) for f in features
    )


def describe_edges(feature: EdgeFeature) -> str:
    """What a feature is, in words: kind, sizes, and of how many edges."""
    return f"{describe_size(feature.kind, feature.sizes)} of {len(feature.edges)} edge{'s' if len(feature.edges) > 1 else ''}"


def describe_size(kind: str, sizes: Sequence[float]) -> str:
    """Kind and sizes in words: "chamfer 0.5 x 1"."""
    return f"{kind} {' x '.join(f'{size:.9g}' for size in sizes)}"
