"""What the 3D view shows, as plain arrays in the unit frame of the target times SPAN. Shapes come from `geometry`, nothing is made here."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import trimesh

from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.solving import violations
from imdim.delivery.evaluate import target_distances
from imdim.export.html_surfaces import SMALLEST_RANGE
from imdim.export.preview import ramp
from imdim.geometry.edge_solids import blend_solids, surface_with_blends
from imdim.geometry.lowering import lower
from imdim.geometry.pose import Pose
from imdim.geometry.sampling import subsample
from imdim.geometry.solid import primitive_to_manifold, to_trimesh
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.edges import describe_edges
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program, fold, leaves, map_leaves, map_lengths
from imdim.relations.residuals import HOLDS
from imdim.target.target import Frame, Target

SPAN = 4.0  # the diagonal of the target in the view
FINE, COARSE, MANY = 96, 48, 60  # facets per circle, fewer for programs of many primitives
SHOWN_POINTS = 30_000  # of a cloud: more fill no more pixels
SHOWN_OF_MESH = 5_000  # its points are samples, and fewer of them say as much
MAP_POINTS = 20_000
LIFT = 2e-3  # of the view: what is translucent lies before faces that it shares, cutters inside what they cut, or both show in patches
SKIN = 1e-6  # by which cutters are drawn larger: caps that lie in the face they cut through would leave a film there
CAP_OF = -2  # the number of what is no feature's: it cannot be clicked
VIOLATED = HOLDS * 10
MOST_FACES = 300_000  # of a part that is drawn as it is; of a larger one points are
SLIVER = 1e-5  # of the diagonal: narrower faces have no direction
SHARP_RAD = math.radians(25.0)  # between two faces: their edge is drawn

Colour = tuple[int, int, int]
ADDS: tuple[Colour, ...] = ((86, 140, 196), (104, 164, 206), (70, 120, 178), (126, 176, 200), (92, 132, 170))
CUT, CLIP, BLENDED, SELECTED = (214, 72, 66), (226, 170, 60), (96, 176, 150), (255, 190, 30)
ORIGINAL, EDGE, CAP = (190, 194, 200), (52, 58, 64), (84, 98, 116)
HELD_COLOUR, BROKEN_COLOUR, POINT_COLOUR = (24, 140, 84), (208, 30, 40), (30, 34, 42)


@dataclass(frozen=True, eq=False)
class Piece:
    """A mesh to draw: the faces that leaf number `leaf` gives the solid, or that a feature of edges does, whose numbers follow those of the
    leaves; or the whole of a cutter, which is translucent."""

    leaf: int
    vertices: np.ndarray
    faces: np.ndarray
    colour: Colour
    opacity: float | None = None


@dataclass(frozen=True, eq=False)
class Drawing:
    """The solid in `pieces`, its sharp edges [m, 2, 3] in `edges`, cutters and clippers in `ghosts`; the solid's `surface` and `volume` in
    the target's units."""

    pieces: list[Piece]
    edges: np.ndarray
    ghosts: list[Piece]
    surface: trimesh.Trimesh
    volume: float


@dataclass(frozen=True, eq=False)
class Overlay:
    """Control points [k, 3], one per primitive, and segments [m, 2, 3] with their colours [m, 2, 3] between what constraints relate."""

    points: np.ndarray
    segments: np.ndarray
    colours: np.ndarray


def place(frame: Frame, points: np.ndarray) -> np.ndarray:
    """Points [n, 3] of the target's units in the view."""
    return (frame.to_unit(points) * SPAN).astype(np.float32)


def roles(program: Program) -> list[str]:
    """What each leaf does: "union", "difference" or "intersection"."""
    keep = list.__add__
    clips = fold(program, lambda _, __: [False], {"union": keep, "intersection": lambda a, b: a + [True] * len(b), "difference": keep})
    return ["intersection" if clip else "union" if sign > 0 else "difference" for clip, sign in zip(clips, signs(program), strict=True)]


def colours(program: Program) -> list[Colour]:
    """The tint of each leaf by what it does."""
    fixed = {"difference": CUT, "intersection": CLIP}
    return [fixed.get(role, ADDS[i % len(ADDS)]) for i, role in enumerate(roles(program))]


def scene(theory: ConstrainedProgram, frame: Frame, selected: int | None) -> Drawing:
    """The solid as it is to be drawn."""
    program = theory.program
    parts, tints = list(leaves(program)), [*colours(program), *[BLENDED] * len(theory.edges)]
    segments = FINE if len(parts) <= MANY else COARSE
    surface, owners = surface_with_blends(enlarge_cutters(program), blend_solids(program, theory.edges), segments)
    at = place(frame, surface.vertices)
    pieces = [_piece(leaf, at, surface.faces[owners == leaf], tints[leaf], leaf == selected) for leaf in np.unique(owners).tolist()]
    ghosts: list[Piece] = []
    for leaf, role in enumerate(roles(program)):
        if role != "union" or leaf == selected:
            tint, opacity = (SELECTED, 0.45) if leaf == selected else (tints[leaf], 0.22)
            ghosts.append(_ghost(leaf, parts[leaf], frame, -LIFT if role == "difference" else LIFT, tint, opacity))
    return Drawing(pieces, sharp_edges(at, surface), ghosts, surface, float(surface.volume) if len(surface.faces) else 0.0)


def enlarge_cutters(program: Program) -> Program:
    """The program with cutters larger by SKIN, whose solid differs in nothing that could be seen."""
    sign = signs(program)
    return map_leaves(program, lambda i, p: p if sign[i] > 0 else map_lengths(p, lambda length: length * (1 + SKIN), p.center))


def _piece(leaf: int, vertices: np.ndarray, faces: np.ndarray, tint: Colour, selected: bool) -> Piece:
    used, corners = np.unique(faces, return_inverse=True)
    return Piece(leaf, vertices[used], corners.reshape(-1, 3), SELECTED if selected else tint)


def _ghost(leaf: int, part: Primitive, frame: Frame, lift: float, tint: Colour, opacity: float) -> Piece:
    """The whole of a primitive, larger by `lift` in the view."""
    whole = to_trimesh(primitive_to_manifold(part, COARSE))
    at = place(frame, whole.vertices) + (lift * whole.vertex_normals).astype(np.float32)
    return Piece(leaf, at, whole.faces, tint, opacity)


def overlay(theory: ConstrainedProgram, frame: Frame) -> Overlay:
    """Control points and constraints."""
    pose = Pose.of(lower(theory.program))
    segments: list[np.ndarray] = []
    tints: list[Colour] = []
    for constraint, off in zip(theory.constraints, violations(theory.program, theory.constraints), strict=True):
        links = _links(constraint, pose)
        segments += links
        tints += [HELD_COLOUR if off <= VIOLATED else BROKEN_COLOUR] * len(links)
    ends = np.array(segments).reshape(-1, 3)
    two = np.repeat(np.array(tints, np.uint8).reshape(-1, 1, 3), 2, axis=1)
    return Overlay(place(frame, pose.numbers.centers), place(frame, ends).reshape(-1, 2, 3), two)


def _links(constraint: Constraint, pose: Pose) -> list[np.ndarray]:
    """Lines [2, 3] from feature to feature; nothing for what stands alone or lies in the frame."""
    refs = [ref for ref in (*constraint.of, *([constraint.about] if constraint.about else [])) if ref.leaf != WORLD]
    at = [_place(ref, pose) for ref in refs]
    return [np.array([a, b]) for a, b in pairwise(at) if not np.allclose(a, b)]


def _place(ref: Ref, pose: Pose) -> np.ndarray:
    return pose.position(ref).value if ref.side else pose.center(ref.leaf).value


def sharp_edges(at: np.ndarray, surface: trimesh.Trimesh) -> np.ndarray:
    """The edges [m, 2, 3] of a surface, whose vertices are drawn `at` [n, 3], where its faces turn by more than SHARP_RAD."""
    if not len(surface.faces):
        return np.zeros((0, 2, 3), np.float32)
    ends = surface.vertices[surface.face_adjacency_edges]
    least = surface.area_faces[surface.face_adjacency].min(axis=1)
    is_wide = least > SLIVER * surface.scale * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return at[surface.face_adjacency_edges[is_wide & (surface.face_adjacency_angles > SHARP_RAD)]]


def original(target: Target, frame: Frame) -> tuple[Piece, np.ndarray] | None:
    """The target's own surface, and its sharp edges [m, 2, 3]; None for clouds, and for meshes of too many faces."""
    if target.mesh is None or len(target.mesh.faces) > MOST_FACES:
        return None
    at = place(frame, target.mesh.vertices)
    return Piece(-1, at, np.asarray(target.mesh.faces), ORIGINAL), sharp_edges(at, target.mesh)


def cloud(target: Target, frame: Frame) -> np.ndarray:
    """The target's points [n, 3] as they are drawn, evenly thinned."""
    return place(frame, subsample(target.points, SHOWN_POINTS if target.mesh is None else SHOWN_OF_MESH))


def distance_map(target: Target, surface: trimesh.Trimesh, frame: Frame) -> tuple[np.ndarray, np.ndarray, float]:
    """Points [n, 3] of the target, colours [n, 3] of their distance to the result, and the end of the scale in the target's units."""
    points, far, _ = target_distances(target, surface, MAP_POINTS)
    top = max(float(far.max(initial=0.0)), SMALLEST_RANGE / frame.scale)
    return place(frame, points), ramp(far / top).astype(np.uint8), top


def names(theory: ConstrainedProgram) -> list[str]:
    """What each leaf, and after them each feature of edges, is called."""
    return [*theory.labels, *map(describe_edges, theory.edges)]


def middle_of(scene: Drawing, number: int) -> np.ndarray | None:
    """Where [3] in the view a feature of edges is written beside: the vertex of it that is farthest up; None where none of it is seen."""
    piece = next((p for p in scene.pieces if p.leaf == number), None)
    return None if piece is None else piece.vertices[np.argmax(piece.vertices[:, 2])]
