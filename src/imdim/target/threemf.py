"""3MF models as arrays, by a parser that keeps no tree: an object is numbers as soon as it is read (3MF Core Specification 1.3).

Objects may be made of objects many times over, so that a small file describes any number of faces: what it grows to is counted before it
grows. Objects come before those that are made of them (section 4), or are in another model of the archive (the Production Extension).
"""

from __future__ import annotations

import zipfile
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np

from imdim.program.units import MILLIMETRES

MAX_FACES = 20_000_000
MAX_COPIES = 100_000
MODEL = "3d/3dmodel.model"
BETWEEN = "\n"  # a namespace and a name
ASIDE = ("support", "solidsupport", "other")  # kinds of objects that are no part of the solid (section 4.1)
PLACE = np.vstack([np.eye(3), np.zeros(3)])  # a transform [4, 3] of rows: p @ rows[:3] + rows[3]


@dataclass
class _Object:
    """Vertices [3 n] and corners [3 m], parts of other objects with their transforms, and what all that grows to."""

    vertices: array[float] = field(default_factory=lambda: array("d"))
    corners: array[int] = field(default_factory=lambda: array("i"))
    parts: list[tuple[_Object, np.ndarray]] = field(default_factory=list)
    copies: int = 1
    faces: int = 0
    is_aside: bool = False

    def add(self, part: _Object, transform: np.ndarray) -> None:
        self.parts.append((part, transform))
        self.copies, self.faces = self.copies + part.copies, self.faces + part.faces
        if self.copies > MAX_COPIES or self.faces > MAX_FACES:
            raise ValueError(f"its components grow to {self.copies} meshes of {self.faces} faces")


def read_model(archive: zipfile.ZipFile) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Vertices [n, 3] float64, in millimetres, and faces [m, 3] int64 of all that a model builds, every object in its place; and what is
    to be said of units and of objects that are no part of the solid, such as what only supports a print.

    Raises ValueError, one line, for what is no model, declares a document type (entities), grows beyond MAX_FACES or MAX_COPIES, or uses
    an object that is not there yet.
    """
    info = next((info for info in archive.infolist() if MODEL in info.filename.lower()), None)
    if info is None:
        raise ValueError(f"no {MODEL} among its {len(archive.infolist())} members")
    model = _Parser(archive, {})
    model.parse(info)
    vertices, faces, base = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for points, corners in _place_meshes(model.build):
        vertices.append(points)
        faces.append(corners + base)
        base += len(points)
    return np.concatenate(vertices) * MILLIMETRES[model.unit], np.concatenate(faces), tuple(_notes(model))


def _notes(model: _Parser) -> Iterator[str]:
    if MILLIMETRES[model.unit] != 1.0:
        yield f"The file's unit is {model.unit}: read as millimetres, each {MILLIMETRES[model.unit]:g}."
    if model.aside:
        yield (
            f"{model.aside} objects that are no part of the solid, as support material, were left out."
            if model.aside > 1
            else "An object that is no part of the solid, as support material, was left out."
        )


def _place_meshes(build: _Object) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The meshes of an object and its parts, in their places; a mirrored one is turned inside out again."""
    stack = [(build, PLACE)]
    while stack:
        made, place = stack.pop()
        if made.corners:
            points = np.frombuffer(made.vertices).reshape(-1, 3) @ place[:3] + place[3]
            corners = np.frombuffer(made.corners, np.int32).reshape(-1, 3)
            yield points, (corners[:, ::-1] if np.linalg.det(place[:3]) < 0 else corners).astype(np.int64)
        stack += [(part, np.vstack([inner[:3] @ place[:3], inner[3] @ place[:3] + place[3]])) for part, inner in reversed(made.parts)]


class _Parser:
    """Of one model; `models` holds the objects of those that were read for it, by path."""

    def __init__(self, archive: zipfile.ZipFile, models: dict[str, dict[str, _Object]] | None) -> None:
        self.objects: dict[str, _Object] = {}
        self.build = _Object()
        self._archive, self._models = archive, models
        self._id, self._object, self._base, self._first = "", _Object(), 0, 0
        self.unit, self.aside = "millimeter", 0
        self._begun = {
            "model": self._begin_model,
            "vertex": self._vertex,
            "triangle": self._triangle,
            "object": self._begin_object,
            "mesh": self._begin_mesh,
            "component": lambda given: self._add(self._object, given),
            "item": lambda given: self._add(self.build, given),
        }
        self._ended = {"object": self._end_object, "mesh": self._end_mesh}

    def parse(self, info: zipfile.ZipInfo) -> None:
        """Read one member of the archive."""
        parser = expat.ParserCreate(namespace_separator=BETWEEN)
        begun, ended = self._begun, self._ended

        def begin(name: str, given: dict[str, str]) -> None:
            handler = begun.get(name.rpartition(BETWEEN)[2])
            if handler is not None:
                handler(given)

        def end(name: str) -> None:
            handler = ended.get(name.rpartition(BETWEEN)[2])
            if handler is not None:
                handler()

        parser.StartElementHandler, parser.EndElementHandler = begin, end
        parser.StartDoctypeDeclHandler = _refuse
        try:
            with self._archive.open(info) as file:
                parser.ParseFile(file)
        except expat.ExpatError as error:
            raise ValueError(str(error)) from error
        except KeyError as error:
            raise ValueError(f"an element without {error}, line {parser.CurrentLineNumber}") from error

    def _vertex(self, given: dict[str, str]) -> None:
        self._object.vertices.extend((float(given["x"]), float(given["y"]), float(given["z"])))

    def _triangle(self, given: dict[str, str]) -> None:
        self._object.corners.extend((int(given["v1"]), int(given["v2"]), int(given["v3"])))

    def _begin_model(self, given: dict[str, str]) -> None:
        self.unit = given.get("unit", "millimeter")
        if self.unit not in MILLIMETRES:
            raise ValueError(f"unknown unit {self.unit[:40]!r}")

    def _begin_object(self, given: dict[str, str]) -> None:
        self._id, self._object = given["id"], _Object(is_aside=given.get("type") in ASIDE)

    def _begin_mesh(self, given: dict[str, str]) -> None:
        self._base, self._first = len(self._object.vertices) // 3, len(self._object.corners)

    def _end_mesh(self) -> None:
        """Corners count from the first vertex of their own mesh."""
        corners = np.frombuffer(self._object.corners, np.int32)[self._first :] if self._object.corners else np.zeros(0, np.int32)
        count = len(self._object.vertices) // 3 - self._base
        bad = int(((corners < 0) | (corners >= count)).sum())
        if bad:
            raise ValueError(f"{bad} of {len(corners)} corners name a vertex that is not among the {count}")
        corners += self._base

    def _end_object(self) -> None:
        self._object.faces += len(self._object.corners) // 3
        if self._object.faces > MAX_FACES:
            raise ValueError(f"it holds {self._object.faces} faces, at most {MAX_FACES}")
        self.objects[self._id] = self._object
        self._object = _Object()

    def _add(self, whole: _Object, given: dict[str, str]) -> None:
        part, transform = self._part(given)
        if part.is_aside:
            self.aside += 1
        else:
            whole.add(part, transform)

    def _part(self, given: dict[str, str]) -> tuple[_Object, np.ndarray]:
        """The object that a component or an item names, and its transform."""
        path = next((value.strip("/") for name, value in given.items() if name.rpartition(BETWEEN)[2] == "path"), None)
        objects, name = self.objects if path is None else self._model(path), given["objectid"]
        if name not in objects:
            raise ValueError(f"object {name[:40]!r} is used before it is there")
        numbers = given.get("transform", "").split()
        if not numbers:
            return objects[name], PLACE
        if len(numbers) != 12:
            raise ValueError(f"a transform of {len(numbers)} numbers, 12 are needed")
        return objects[name], np.array(numbers, float).reshape(4, 3)

    def _model(self, path: str) -> dict[str, _Object]:
        """The objects of another model, which may not lead to yet another."""
        if self._models is None:
            raise ValueError(f"{path[:40]!r} is named by a model that another one names")
        if path not in self._models:
            info = next((info for info in self._archive.infolist() if info.filename.strip("/") == path), None)
            if info is None:
                raise ValueError(f"{path[:40]!r} is not in the archive")
            other = _Parser(self._archive, None)
            other.parse(info)
            self._models[path] = other.objects
        return self._models[path]


def _refuse(*_: object) -> None:
    raise ValueError("it declares a document type")
