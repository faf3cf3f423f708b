"""A theory: how many control points there are and which constraints hold between them; its JSON form (design, section 5.2).

Angles are radians, lengths model units. In dimension 2 the points lie in the plane z = 0.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

ARITY = {"distance": 2, "angle": 3, "line_distance": 3, "equal_length": 4, "torsion": 4, "plane_distance": 4}
ALIASES = {"coplanar": "plane_distance", "collinear": "line_distance"}
LENGTHS = ("distance", "line_distance", "plane_distance")
SPATIAL = ("torsion", "plane_distance")
MAX_POINTS = 2000  # Jacobians are dense


class TheoryError(ValueError):
    """A theory, or a position of its points, that means nothing; one line that names the constraint and the number."""


@dataclass(frozen=True)
class SketchConstraint:
    """One relation between control points.

    distance (i, j): |ci - cj| = value. angle (i, j, k): between cj->ci and cj->ck, in 0..pi. line_distance (i, j, k): of ck from the
    line ci cj. equal_length (i, j, k, l): |ci - cj| = |ck - cl|, no value. torsion (i, j, k, l): from plane ijk to plane jkl, seen
    along cj->ck, positive clockwise, in -pi..pi; 0 where ci and cl are on one side. plane_distance (i, j, k, l): of cl from the plane
    ci cj ck, unsigned.
    """

    kind: str
    indices: tuple[int, ...]
    value: float = 0.0

    def __str__(self) -> str:
        value = "" if self.kind == "equal_length" else f" = {self.value:.6g}"
        return f"{self.kind} {'-'.join(map(str, self.indices))}{value}"


@dataclass(frozen=True)
class Theory:
    """`weights`, if any, is the sparse projection of the control points to a cloud; it takes no part in the solution."""

    n_points: int
    constraints: tuple[SketchConstraint, ...] = ()
    dimension: int = 3
    weights: Weights | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not 1 <= self.n_points <= MAX_POINTS:
            raise TheoryError(f"a theory has 1 to {MAX_POINTS} control points, got {self.n_points}")
        if self.dimension not in (2, 3):
            raise TheoryError(f"the dimension is 2 or 3, got {self.dimension}")
        for number, constraint in enumerate(self.constraints):
            if problem := _problem(constraint, self.n_points, self.dimension):
                raise TheoryError(f"constraint {number} ({constraint}): {problem}")

    def only(self, numbers: Iterable[int]) -> Theory:
        """The theory with those constraints alone, in this order."""
        return replace(self, constraints=tuple(self.constraints[i] for i in numbers))

    def name(self, number: int) -> str:
        return f"constraint {number} ({self.constraints[number]})"

    def length(self) -> float | None:
        """The mean of the lengths that the constraints fix, in model units; None where they fix none."""
        values = [c.value for c in self.constraints if c.kind in LENGTHS and c.value > 0]
        return math.fsum(values) / len(values) if values else None


@dataclass(frozen=True)
class Weights:
    """The entries of W [m, n] that are not zero: observed point `rows[e]` takes `values[e]` of control point `columns[e]`."""

    m: int
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    values: tuple[float, ...]

    @classmethod
    def of(cls, matrix: np.ndarray) -> Weights:
        rows, columns = np.nonzero(matrix)
        return cls(len(matrix), tuple(rows.tolist()), tuple(columns.tolist()), tuple(matrix[rows, columns].tolist()))


def _problem(constraint: SketchConstraint, n_points: int, dimension: int) -> str | None:
    kind, indices, value = constraint.kind, constraint.indices, constraint.value
    if kind not in ARITY:
        return f"unknown kind; known are {', '.join(ARITY)}"
    if len(indices) != ARITY[kind]:
        return f"needs {ARITY[kind]} indices, got {len(indices)}"
    for index in indices:
        if not 0 <= index < n_points:
            return f"index {index} is out of range for {n_points} control points"
    if kind in SPATIAL and dimension == 2:
        return "has no meaning in dimension 2"
    return _repetition_error(kind, indices) or _bad_value(kind, value)


def _repetition_error(kind: str, indices: tuple[int, ...]) -> str | None:
    if kind != "equal_length":
        return "an index repeats, so a reference has no length" if len(set(indices)) < len(indices) else None
    first, second = frozenset(indices[:2]), frozenset(indices[2:])
    if len(first) < 2 or len(second) < 2:
        return "an index repeats, so a reference has no length"
    return "compares a length with itself" if first == second else None


def _bad_value(kind: str, value: float) -> str | None:
    if not math.isfinite(value):
        return f"the value {value} is not a number that can be met"
    if kind in LENGTHS and value < 0:
        return f"a distance is not negative, got {value}"
    if kind == "angle" and not 0 <= value <= math.pi:
        return f"an angle is 0 to pi radians, got {value}"
    if kind == "torsion" and not -math.pi <= value <= math.pi:
        return f"a torsion is -pi to pi radians, got {value}"
    return "takes no value" if kind == "equal_length" and value != 0 else None


def to_json(theory: Theory) -> dict[str, Any]:
    """The JSON of section 5.2; `dimension` is written for 2 only."""
    data: dict[str, Any] = {"controlPoints": theory.n_points}
    if theory.dimension == 2:
        data["dimension"] = 2
    data["constraints"] = [_constraint_json(c) for c in theory.constraints]
    if (w := theory.weights) is not None:
        data["weights"] = {"shape": [w.m, theory.n_points], "rows": list(w.rows), "columns": list(w.columns), "values": list(w.values)}
    return data


def _constraint_json(constraint: SketchConstraint) -> dict[str, Any]:
    kind = constraint.kind
    if constraint.value == 0:
        kind = {real: alias for alias, real in ALIASES.items()}.get(kind, kind)
    return {"type": kind, "indices": list(constraint.indices), "value": constraint.value}


def from_json(data: Any) -> Theory:
    """Raises TheoryError, one line, for whatever is not a theory."""
    if not isinstance(data, Mapping):
        raise TheoryError(f"a theory is an object, got {type(data).__name__}")
    if unknown := set(data) - {"controlPoints", "dimension", "constraints", "weights"}:
        raise TheoryError(f"unknown field {min(unknown, key=str)!r} in a theory")
    entries = data.get("constraints", [])
    if not isinstance(entries, list):
        raise TheoryError(f"constraints are a list, got {type(entries).__name__}")
    n_points, dimension = _integer(data.get("controlPoints"), "controlPoints"), _integer(data.get("dimension", 3), "dimension")
    theory = Theory(n_points, tuple(_read_constraint(i, e) for i, e in enumerate(entries)), dimension)
    return replace(theory, weights=_read_weights(data.get("weights"), n_points))


def _integer(value: Any, name: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TheoryError(f"{name} is a whole number, got {value!r}")
    return value


def _read_constraint(number: int, entry: Any) -> SketchConstraint:
    name = f"constraint {number}"
    if not isinstance(entry, Mapping):
        raise TheoryError(f"{name}: a constraint is an object, got {type(entry).__name__}")
    if unknown := set(entry) - {"type", "indices", "value"}:
        raise TheoryError(f"{name}: unknown field {min(unknown, key=str)!r}")
    kind, indices, value = entry.get("type"), entry.get("indices"), entry.get("value", 0.0)
    if not isinstance(kind, str) or kind not in ARITY.keys() | ALIASES.keys():
        close = difflib.get_close_matches(str(kind), [*ARITY, *ALIASES], 1)
        raise TheoryError(f"{name}: unknown type {kind!r}" + (f"; did you mean {close[0]!r}?" if close else ""))
    if not isinstance(indices, list):
        raise TheoryError(f"{name} ({kind}): indices are a list, got {indices!r}")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TheoryError(f"{name} ({kind}): the value is a number, got {value!r}")
    if kind in ALIASES and value != 0:
        raise TheoryError(f"{name} ({kind}): the value is 0, got {value}; use {ALIASES[kind]} for a distance")
    if "value" not in entry and kind not in ALIASES and kind != "equal_length":
        raise TheoryError(f"{name} ({kind}): the value is missing")
    return SketchConstraint(ALIASES.get(kind, kind), tuple(_integer(i, f"{name} ({kind}): an index") for i in indices), float(value))


def _read_weights(data: Any, n_points: int) -> Weights | None:
    if data is None:
        return None
    try:
        m, n = data["shape"]
        weights = Weights(m, *(tuple(data[k]) for k in ("rows", "columns", "values")))
        entries = list(zip(weights.rows, weights.columns, weights.values, strict=True))
        good = n == n_points and all(0 <= r < m and 0 <= c < n and math.isfinite(v) for r, c, v in entries)
    except (TypeError, KeyError, ValueError) as error:
        raise TheoryError(f"weights need shape, rows, columns and values of one length: {error}") from error
    if not good:
        raise TheoryError(f"weights of shape [{m}, {n}] do not fit {n_points} control points, or an entry lies outside")
    return weights


def dumps(theory: Theory) -> str:
    return json.dumps(to_json(theory), indent=1) + "\n"


def loads(text: str) -> Theory:
    """Raises TheoryError for text that is no JSON or no theory."""
    try:
        data = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise TheoryError(f"not JSON: {error}") from error
    return from_json(data)


def save(theory: Theory, path: str | Path) -> None:
    Path(path).write_text(dumps(theory), encoding="utf-8")


def load(path: str | Path) -> Theory:
    """Raises TheoryError that names the file."""
    try:
        return loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, TheoryError) as error:
        raise TheoryError(f"{path}: {error}") from error
