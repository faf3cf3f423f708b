"""A program as the report's page lists it: a tree of operations, repeats and primitives with their numbers and names, and its constraints.

Leaves are counted from 0, copies included, as constraints and program.json count them; those below one node follow each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from imdim.export.feature_names import say_feature
from imdim.export.numbers import Expression, plain, write_expression
from imdim.export.parameters import Parameters
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import primitive_to_manifold, to_trimesh
from imdim.program.constraints import RULES, WORLD, Constraint, Ref
from imdim.program.ellipse import Ellipse, ellipse_point
from imdim.program.outline import Curve, Loop, Outline, arc_radii, arc_radius, ring_curves
from imdim.program.repeats import Folded, Repeat, repeats, size, starts
from imdim.program.tree import SIZE_NAMES, Op, Primitive, Program, fold, leaves

SURFACE_SEGMENTS = 48  # of an outlined leaf that is shown by itself


def tree_values(folded: Folded, first: int = 0) -> dict[str, Any]:
    """The tree: of each node what it does, the number `first` of its first leaf, how many `leaves` it has, and its `parts`."""
    head: dict[str, Any] = {"first": first, "leaves": size(folded)}
    if isinstance(folded, Primitive):
        return {"is": "primitive", **head, "parts": []}
    if isinstance(folded, Repeat):
        how = {"counts": list(folded.counts), "angle": folded.angle, "join": folded.join}
        return {"is": folded.kind, **head, **how, "parts": [tree_values(folded.part, first)]}
    return {"is": folded.op, **head, "parts": [tree_values(part, start) for part, start in starts(folded, first)]}


def leaf_values(program: Program, labels: Sequence[str], named: Parameters) -> list[dict[str, Any]]:
    """Of each leaf its kind, label, role, sizes, place and rotation matrix; numbers that follow names come with the expression.

    A leaf with an outline has that as a drawing, and its own surface, about its frame.
    """
    rows = zip(leaves(program), labels, roles(program), named.sizes, named.centers, strict=True)
    return [
        {
            "kind": p.kind,
            "label": label,
            "role": role,
            "sizes": [_number(*column) for column in zip(SIZE_NAMES[p.kind], p.size, sizes, strict=True)],
            "center": [_number(*column) for column in zip("xyz", p.center, center, strict=True)],
            "rotation": list(p.rotation),
            "matrix": matrix_from_euler(p.rotation).ravel().tolist(),
            **({} if p.outline is None else {"outline": outline_values(p.outline), "surface": _surface(p)}),
        }
        for p, label, role, sizes, center in rows
    ]


def outline_values(outline: Outline) -> dict[str, Any]:
    """The number of curves, the corners of the box, the radii of arcs, largest first, and an SVG path whose y points up."""
    low, high = outline.bounds
    radii = sorted({_digits(radius) for radius in arc_radii(outline)}, reverse=True)
    corners = {"low": list(map(_digits, low)), "high": list(map(_digits, high))}
    return {"curves": outline.curve_count, **corners, "radii": radii, "path": svg_path(outline)}


def svg_path(outline: Outline) -> str:
    """The loops as an SVG path whose y points up."""
    return " ".join(map(_path, outline.loops))


def _path(loop: Loop) -> str:
    if isinstance(loop, Ellipse):
        (x, y), (u, v) = ((_digits(c) for c in ellipse_point(loop, t)) for t in (0.0, math.pi))
        half = f"A {_digits(loop.rx)} {_digits(loop.ry)} {_digits(loop.angle)} 0 1"
        return f"M {x} {y} {half} {u} {v} {half} {x} {y} Z"
    x, y, _ = loop[0]
    return " ".join([f"M {_digits(x)} {_digits(y)}", *map(_step, ring_curves(loop)), "Z"])


def _step(curve: Curve) -> str:
    """An arc's flags say whether it is more than half a circle, and whether it turns from x to y."""
    *_, u, v, bulge = curve
    if not bulge:
        return f"L {_digits(u)} {_digits(v)}"
    radius = _digits(arc_radius(curve))
    return f"A {radius} {radius} 0 {int(abs(bulge) > 1)} {int(bulge > 0)} {_digits(u)} {_digits(v)}"


def _surface(p: Primitive) -> dict[str, Any]:
    mesh = to_trimesh(primitive_to_manifold(replace(p, center=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0)), SURFACE_SEGMENTS))
    return {"points": [[_digits(c) for c in point] for point in mesh.vertices.tolist()], "faces": mesh.faces.ravel().tolist()}


def _digits(value: float) -> float:
    return float(f"{value:.9g}")


def roles(program: Program) -> list[str]:
    """What each leaf does to the solid: "adds", "cuts", or "bounds" where it is intersected with something."""
    combine: Mapping[Op, Callable[[list[str], list[str]], list[str]]] = {
        "union": list.__add__,
        "intersection": lambda a, b: ["cuts" if role == "cuts" else "bounds" for role in a + b],
        "difference": lambda keep, cut: keep + ["adds" if role == "cuts" else "cuts" for role in cut],
    }
    return fold(program, lambda _, __: ["adds"], combine)


def constraint_values(constraints: Sequence[Constraint], labels: Sequence[str]) -> list[dict[str, Any]]:
    """Of each constraint its name, kind, members in words, and the leaves that it binds."""
    return [
        {
            "name": c.name,
            "kind": c.kind,
            "of": [_feature(ref, labels) for ref in c.of],
            "about": None if c.about is None else _feature(c.about, labels),
            "value": c.value if RULES[c.kind].has_value and (c.value or c.kind == "value") else None,
            "leaves": sorted({ref.leaf for ref in (*c.of, *([c.about] if c.about else [])) if ref.leaf != WORLD}),
        }
        for c in constraints
    ]


def name_values(named: Parameters, folded: Folded) -> list[dict[str, Any]]:
    """Of each name its value and the leaves that follow it."""
    followers = _followers(named)
    values = [{"name": name, "value": value, "leaves": followers.get(name, [])} for name, value in named.values.items()]
    copies: dict[str, list[int]] = {}
    for (first, repeat), loop in zip(repeats(folded), named.loops, strict=False):
        for name in loop.counts:
            copies.setdefault(name, []).extend(range(first, first + size(repeat)))
    return values + [{"name": name, "value": count, "leaves": copies.get(name, [])} for name, count in named.counts.items()]


def _followers(named: Parameters) -> dict[str, list[int]]:
    """Of each name that some leaf follows those leaves."""
    found: dict[str, list[int]] = {}
    for i, (sizes, center) in enumerate(zip(named.sizes, named.centers, strict=True)):
        for name in {term.name for expression in (*sizes, *center) for term in expression.terms}:
            found.setdefault(name, []).append(i)
    return found


def _number(name: str, value: float, expression: Expression) -> dict[str, Any]:
    out = {"name": name, "value": _digits(value)}
    return {**out, "says": write_expression(expression, lambda v: plain(_digits(v)), circled=True)} if expression.terms else out


def _feature(ref: Ref, labels: Sequence[str]) -> str:
    where = "frame" if ref.leaf == WORLD else say_feature(labels[ref.leaf], ref.leaf)
    return f"{where} {ref.feature}".rstrip()
