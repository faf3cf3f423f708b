"""A triangle mesh as it comes made into a solid where it can be: merged, oriented outward, united, thinned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from manifold3d import Error, Manifold, OpType
from scipy.spatial import KDTree

from imdim.geometry.solid import drop_collapsed, solid_of
from imdim.target.bodies import (
    compact,
    components,
    count_bodies,
    edge_table,
    face_normals,
    find_bodies,
    leave_out_flat,
    leave_out_scraps,
    mesh_volume,
    split_faces,
)
from imdim.target.readers import InputError

MAX_FACES = 200_000
MAX_BODIES = 5_000
REDUNDANT = 2  # faces for each that the solid needs, from which a mesh counts as subdivided
LOST = 0.01  # of the volume, from which thinning says that small things went with it
CROWDED = 3  # faces a vertex; closed surfaces have two
SEAM = 1e-6  # gap that is closed along open edges, relative to the diagonal
FLAT, NOTHING = 1e-12, 1e-15  # volumes relative to the cubed diagonal: too little for a search, and what rounding makes of none
WALLS = 1e-6  # share of the surface that lies within the union of the bodies before it is taken for more than noise
THINNING = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3)  # tolerances relative to the diagonal, tried in turn


@dataclass(frozen=True, eq=False)
class Cleaned:
    """`vertices` [n, 3] float64 and `faces` [m, 3] int64; `is_solid` and `notes` as in `cloud.Target`."""

    vertices: np.ndarray
    faces: np.ndarray
    is_solid: bool
    notes: tuple[str, ...]


def clean_mesh(vertices: np.ndarray, faces: np.ndarray, name: str) -> Cleaned:
    """Merge equal vertices, close seams, orient outward, unite overlapping bodies, thin what is too fine.

    Raises InputError, one line with `name` and the number, when the mesh encloses no volume, or too little for its length.
    """
    center = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    unit, faces = merge_equal((vertices - center) / diagonal, faces)
    if len(faces) > CROWDED * len(unit):
        faces = drop_copies(faces, len(unit))
    if len(faces) and find_unpaired(faces).size:
        faces = close_seams(unit, faces)
    if not len(faces):
        raise InputError(f"{name}: the mesh has 0 faces with three different corners")
    if len(faces) >= 4 * MAX_BODIES and (count := count_bodies(faces)) > MAX_BODIES:
        raise InputError(f"{name}: the mesh has {count} separate bodies, at most {MAX_BODIES}")
    faces, loose = leave_out_scraps(unit, faces) if find_unpaired(faces).size else (faces, 0)
    faces, flat = (faces, 0) if find_unpaired(faces).size else leave_out_flat(unit, faces)
    faces, notes = _orient(unit, faces)
    if loose:
        notes.insert(0, f"{loose} facet{'s' if loose > 1 else ''} of open pieces beside what is closed left out.")
    if flat:
        notes.insert(0, f"{flat} {'bodies that hold' if flat > 1 else 'body that holds'} nothing left out.")
    volume = mesh_volume(unit, faces)
    if abs(volume) < FLAT:
        what = f"{volume * diagonal**3:.3g} cubic units, {abs(volume):.1g} of the cubed diagonal"
        thin = abs(volume) > NOTHING
        raise InputError(f"{name}: the mesh {'is too thin for its length' if thin else 'encloses no volume'} ({what}; at least {FLAT:g})")
    found = _as_solid(unit, faces, notes)
    unit, faces = found or _thin_shell(unit, faces, notes)
    unit, faces = compact(unit, faces)
    return Cleaned(unit * diagonal + center, faces, found is not None, tuple(notes))


def merge_equal(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices at exactly the same place become one; faces that lose a corner are dropped."""
    order = np.lexsort(vertices.T)
    fresh = np.ones(len(order), bool)
    fresh[1:] = (vertices[order[1:]] != vertices[order[:-1]]).any(axis=1)
    label = np.empty(len(order), np.int64)
    label[order] = np.cumsum(fresh) - 1
    return vertices[order[fresh]], drop_collapsed(label[faces])


def drop_copies(faces: np.ndarray, count: int) -> np.ndarray:
    """One of each connected piece of a mesh of `count` vertices that lies several times in exactly the same place."""
    single, times = np.unique(_lowest_first(faces), axis=0, return_counts=True)
    piece = components(single.ravel(), np.roll(single, 1, axis=1).ravel(), count)[1][single[:, 0]]
    least, most = np.full(piece.max() + 1, len(faces)), np.zeros(piece.max() + 1, np.int64)
    np.minimum.at(least, piece, times)
    np.maximum.at(most, piece, times)
    return np.repeat(single, np.where((least == most)[piece], 1, times), axis=0)


def find_unpaired(faces: np.ndarray) -> np.ndarray:
    """Vertices [k] of edges that are not walked equally often in both directions: none where the mesh is closed and consistent."""
    low, high, forward, label = edge_table(faces)
    broken = np.bincount(label, np.where(forward, 1, -1))[label] != 0
    return np.unique(np.concatenate([low[broken], high[broken]]))


def close_seams(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Merge vertices of open edges that nearly coincide, in a mesh of diagonal 1; repeated faces count once."""
    rim = find_unpaired(faces)
    pairs = KDTree(vertices[rim]).query_pairs(SEAM, output_type="ndarray")
    count, label = components(pairs[:, 0], pairs[:, 1], len(rim))
    leader = np.full(count, len(vertices))
    np.minimum.at(leader, label, rim)
    target = np.arange(len(vertices))
    target[rim] = leader[label]
    merged = drop_collapsed(target[faces])
    return merged[np.sort(np.unique(_lowest_first(merged), axis=0, return_index=True)[1])]


def _lowest_first(faces: np.ndarray) -> np.ndarray:
    """Faces [m, 3] that begin with their lowest vertex, still the same way round."""
    turn = np.argmin(faces, axis=1)[:, None]
    return np.take_along_axis(faces, (turn + np.arange(3)) % 3, axis=1)


def orient_alike(faces: np.ndarray) -> tuple[np.ndarray, int]:
    """Faces turned so that neighbours across an edge of two agree, and how many were turned (the smaller part of each piece).

    Each face stands for two nodes, as it is and turned, and nodes that agree are joined. A piece that cannot be oriented stays as it is.
    """
    count = len(faces)
    _, _, forward, label = edge_table(faces)
    order = np.argsort(label, kind="stable")
    paired = order[np.bincount(label)[label[order]] == 2]
    one, two = paired[0::2], paired[1::2]
    turned_too = np.where(forward[one] == forward[two], count, 0)
    one, two = one % count, two % count
    rows, columns = np.concatenate([one, one + count]), np.concatenate([two + turned_too, two + count - turned_too])
    pieces, node = components(rows, columns, 2 * count)
    kept, turned = node[:count], node[count:]
    as_is = np.bincount(kept, minlength=pieces)
    flip = (as_is[kept] < as_is[turned]) | ((as_is[kept] == as_is[turned]) & (kept > turned))
    return np.where(flip[:, None], faces[:, ::-1], faces), int(flip.sum())


def cluster(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most about MAX_FACES faces of a mesh of diagonal 1: vertices of a grid cell become their mean, collapsed faces go."""
    cells = MAX_FACES**0.5 / 2
    while True:
        _, label = np.unique(np.floor(vertices * cells).astype(np.int64), axis=0, return_inverse=True)
        label = label.reshape(-1)
        fewer = drop_collapsed(label[faces])
        if len(fewer) <= MAX_FACES:
            size = np.bincount(label)
            return np.stack([np.bincount(label, v) / size for v in vertices.T], axis=1), fewer
        cells *= 0.8


def _orient(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, list[str]]:
    notes: list[str] = []
    turned = 0
    if find_unpaired(faces).size:
        faces, turned = orient_alike(faces)
    if turned:
        notes.append(f"{turned} of {len(faces)} faces turned to agree with their neighbours.")
    bodies = find_bodies(vertices, faces)
    # where neighbours had disagreed no body's own orientation can be trusted: cavities are told by their depth alone
    wanted = np.where(bodies.depth % 2, -1, 1) if turned else np.sign(bodies.volume[bodies.root]) * np.sign(bodies.volume)
    inverted = bodies.volume * wanted < 0
    if inverted.any():
        notes.append(
            "The mesh was inside out: turned." if inverted.all() else f"{inverted.sum()} of {bodies.count} bodies were inside out: turned."
        )
        faces = np.where(inverted[bodies.label][:, None], faces[:, ::-1], faces)
    return faces, notes


def _as_solid(vertices: np.ndarray, faces: np.ndarray, notes: list[str]) -> tuple[np.ndarray, np.ndarray] | None:
    """The closed manifold that the mesh bounds, bodies united and fine faces thinned; None, and a note, where there is none."""
    rim = find_unpaired(faces).size
    if rim:
        notes.append(f"The mesh is open ({rim} vertices on open edges): the winding number tells inside from outside.")
        return None
    bodies = [solid_of(*compact(vertices, faces[chosen])) for chosen in split_faces(vertices, faces)]
    if any(body.status() != Error.NoError or body.volume() <= 0 for body in bodies):
        notes.append("The mesh is closed but no manifold: the winding number tells inside from outside.")
        return None
    solid = Manifold.batch_boolean([part for body in bodies for part in _parts(body)], OpType.Add)
    walls = 1 - solid.surface_area() / face_normals(vertices, faces)[1].sum()
    if walls > WALLS:
        notes.append(f"Bodies overlapped or touched: united, {100 * walls:.2g} % of the surface lay within.")
    if len(faces) > MAX_FACES:
        thinner = _simplify(solid)
        lost = 1 - thinner.volume() / solid.volume()
        solid = thinner
        notes.append(f"{len(faces)} faces thinned to {solid.num_tri()}{f', {100 * lost:.2g} % of the volume lost' if lost > LOST else ''}.")
    else:
        # what is found must not depend on how often flat faces were divided; ordinary tessellations stay as they are, to the last digit
        bare = solid.simplify(SEAM)
        if REDUNDANT * bare.num_tri() <= len(faces) and abs(bare.volume() - solid.volume()) <= SEAM * solid.volume():
            solid = bare
            notes.append(f"{len(faces)} faces merged to {solid.num_tri()}: the others divided flat ones.")
        elif walls <= WALLS:
            return vertices, faces
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties[:, :3], float), np.array(mesh.tri_verts, np.int64)


def _parts(body: Manifold) -> list[Manifold]:
    """A body that only touches itself along edges taken apart there; one with cavities stays whole."""
    parts = body.decompose()
    return [body] if any(part.volume() <= 0 for part in parts) else parts


def _simplify(solid: Manifold) -> Manifold:
    """With at most MAX_FACES where that leaves anything: bodies smaller than the tolerance vanish."""
    found = solid
    for tolerance in THINNING:
        thinner = solid.simplify(tolerance)
        if thinner.is_empty():
            return found
        found = thinner
        if found.num_tri() <= MAX_FACES:
            return found
    return found


def _thin_shell(vertices: np.ndarray, faces: np.ndarray, notes: list[str]) -> tuple[np.ndarray, np.ndarray]:
    if len(faces) <= MAX_FACES:
        return vertices, faces
    fewer = cluster(vertices, faces)
    notes.append(f"{len(faces)} faces thinned to {len(fewer[1])}.")
    return fewer
