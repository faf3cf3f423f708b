"""Text on flat faces of a target is set aside before the search, which sees the plain faces that carry it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Error, Manifold

from imdim.detection.face_pieces import without_pieces
from imdim.detection.facets import facets_of
from imdim.detection.lettering import Lettering, find_lettering
from imdim.geometry.solid import to_trimesh
from imdim.reconstruction.observation import find_solid
from imdim.target.target import Frame, Target, with_mesh

MOST = 0.05  # of a part's volume: what has more of it is no decoration
FACES = 0.999  # cosine between a normal and an axis that a face is named after


class Untexted(NamedTuple):
    """A target without text, and a sentence for each text that it had."""

    target: Target
    notes: tuple[str, ...] = ()


def set_text_aside(target: Target, own: Frame | None = None) -> Untexted:
    """The target with plain faces in place of its text; a cloud, or a mesh that bounds no solid, as it is. `own` is the frame of a part
    that was turned into it, and whose text is told where it lies in the world."""
    if target.mesh is None or not target.is_solid:
        return Untexted(target)
    found = [*find_lettering(target.mesh, facets_of(target.mesh))]
    solid = find_solid(target) if found else None
    if solid is None:
        return Untexted(target)
    taken, kept, plain = list[Lettering](), list[Lettering](), solid
    for text in found:
        bare = _take_off(target.mesh, [*taken, text])
        changed = 1.0 if bare is None else abs(bare.volume() - solid.volume()) / solid.volume()
        if bare is not None and changed <= MOST:
            taken, plain = [*taken, text], bare
        else:
            kept.append(text)
    notes = [f"{note}: set aside as decoration, the program has the plain face" for note in _tell(taken, own)]
    notes += [f"{note}: too much of the part to be set aside as decoration" for note in _tell(kept, own)]
    return Untexted(with_mesh(target, to_trimesh(plain)) if taken else target, tuple(notes))


def _take_off(mesh: trimesh.Trimesh, texts: Sequence[Lettering]) -> Manifold | None:
    """The solid that a mesh bounds without these texts; None where it bounds none then."""
    plain = without_pieces(mesh, [piece for text in texts for piece in text.pieces])
    return plain if plain.status() == Error.NoError and plain.volume() > 0 else None


def _tell(texts: Sequence[Lettering], own: Frame | None) -> Iterator[str]:
    for text in texts:
        point, normal, scale = text.point, text.normal, 1.0
        if own is not None:
            point, normal, scale = own.to_world(point), own.turn_back(normal), own.scale
        digits = max(0, 2 - int(np.floor(np.log10(abs(text.depth) / scale))))
        where = ", ".join(f"{round(v, digits) + 0.0:.6g}" for v in point.tolist())
        how = "raised" if text.depth > 0 else "sunk"
        rows = f" in {text.rows} rows" if text.rows > 1 else ""
        yield f"text of {text.letters} letters{rows}, {how} by {abs(text.depth) / scale:.3g} on the {_name_face(normal)} at ({where})"


def _name_face(normal: np.ndarray) -> str:
    axis = int(np.abs(normal).argmax())
    if abs(normal[axis]) >= FACES:
        return f"{'+' if normal[axis] > 0 else '-'}{'xyz'[axis]} face"
    towards = ", ".join(f"{round(v, 2) + 0.0:.2g}" for v in normal.tolist())
    return f"face towards ({towards})"
