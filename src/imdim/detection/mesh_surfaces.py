"""Carrier surfaces of a triangle mesh by hypothesis and growing over its flat facets.

A tessellated CAD face has its vertices on the true surface, so the test is strict: a facet belongs to a carrier when all its corners
lie on it and its normal follows the carrier's. Hypotheses come from a seed facet with its smooth neighbours (two strips fix a
cylinder, three facets a cone, a ring of facets a sphere or torus, a band and what is beside it a torus); the kind that explains the
largest area wins. A sphere's band of latitude is also an exact cone, and so is a torus's: area decides that too, and what lies on the
carrier of a larger patch is a part of that in the end. What no curved carrier explains is flat.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import trimesh

from imdim.deadline import NEVER, Deadline
from imdim.detection.chord_corners import onto_corners
from imdim.detection.facets import Facets, Growing, MeshSurfaceConfig, facets_of, points_of
from imdim.detection.fit_ellipsoid import DRAWN, level_axes
from imdim.detection.mesh_hypotheses import cone_in_rings, hypotheses, ring_of, tori_along
from imdim.detection.mesh_support import members_of, sagitta, settle
from imdim.geometry.rows import dot_rows
from imdim.geometry.surface import CLOSED_KINDS, Patch, Surface, normals, signed_distance, vec

DRAWN_ON = 1e-5  # of the diagonal
FLAT_ACROSS = 1e-4  # sine, by which normals leave a plane
CONFIRMED = 5  # whole strips, before a cylinder is believed that one of them tells: two beside one lie on some cylinder anyway
NEAR_GUESS = 5.0  # tolerances, within which a carrier is guessed from a few facets


class Shown(NamedTuple):
    """A carrier with its visible pieces, and the facets [m] that show it."""

    patch: Patch
    members: np.ndarray


def detect_patches(
    mesh: trimesh.Trimesh, deadline: Deadline = NEVER, elliptic: bool = True, expected: Iterable[Surface] = ()
) -> list[Patch]:
    """Carriers with their visible pieces, curved ones first, each kind by falling area; elliptic cylinders where these are asked for.

    Curved carriers that are `expected`, as those of a mesh from which this one differs in places, are looked for before others. No more
    others are looked for past the `deadline`: what they would have explained shows planes.
    """
    return [shown.patch for shown in detect_shown(facets_of(mesh), deadline, elliptic, expected)]


def detect_shown(facets: Facets, deadline: Deadline = NEVER, elliptic: bool = True, expected: Iterable[Surface] = ()) -> list[Shown]:
    """As `detect_patches`, with the facets that show each; no facet shows two."""
    config = MeshSurfaceConfig(elliptic=elliptic)
    curved, free = _find_curved(facets, np.ones(len(facets.areas), bool), config, deadline, expected)
    # corners where two tessellations cut each other lie on chords: what the strict pass leaves gets a second one
    looser = replace(config, on_surface=config.loose, max_failures=config.max_failures // 3)
    more, free = _find_curved(facets, free, looser, deadline)
    curved = _absorb(curved, Growing(facets, ~free, [], config))
    exact = [Shown(_level(onto_corners(patch, facets.diagonal), facets.diagonal), members) for patch, members in curved + more]
    return sorted(exact, key=lambda s: -s.patch.area) + _planes(facets, free, config)


def _level(patch: Patch, diagonal: float) -> Patch:
    """An ellipsoid of revolution as such."""
    return replace(patch, surface=level_axes(patch.surface, DRAWN * diagonal)) if patch.surface.kind == "ellipsoid" else patch


def _find_curved(
    facets: Facets, free: np.ndarray, config: MeshSurfaceConfig, deadline: Deadline, expected: Iterable[Surface] = ()
) -> tuple[list[Shown], np.ndarray]:
    """Curved patches among the `free` facets [u], those on `expected` carriers first, and the facets that stay free."""
    smooth = (facets.angles > 1e-3) & (facets.angles < np.radians(config.smooth_deg))
    neighbours: list[list[int]] = [[] for _ in facets.areas]
    for a, b in facets.edges[smooth]:
        neighbours[a].append(int(b))
        neighbours[b].append(int(a))
    state = Growing(facets, free.copy(), neighbours, config)
    patches = [_take(found, state) for surface in expected if (found := _settle_curved(surface, state)) is not None]
    failures = 0
    for seed in np.argsort(-facets.areas, kind="stable"):
        if not state.free[seed] or len(neighbours[seed]) == 0:
            continue
        if deadline.has_passed():
            break
        found = _grow_from(int(seed), state)
        if found is None:
            failures += 1
            if failures >= config.max_failures or state.spent > config.most_work:
                break
            continue
        patches.append(_take(found, state))
    return patches, state.free


def _absorb(shown: list[Shown], state: Growing) -> list[Shown]:
    """Without the patches all of whose facets lie on the carrier of a larger one, which gets them: a strip of a torus may have been taken
    for a cylinder before anything told of the torus."""
    facets, left = state.facets, sorted(shown, key=lambda s: -s.patch.area)
    out: list[Shown] = []
    while left:
        first, *left = left
        state.free[:] = False
        state.free[np.concatenate([s.members for s in left]) if left else []] = True
        lie = set(members_of(first.patch.surface, state, 1.0, curved=True).tolist()) if left else set[int]()
        taken = [s for s in left if lie.issuperset(s.members.tolist())]
        if taken:
            left = [s for s in left if s not in taken]
            members = np.unique(np.concatenate([first.members, *(s.members for s in taken)]))
            first = Shown(_patch(first.patch.surface, facets, members), members)
        out.append(first)
    return out


def _take(found: tuple[Surface, np.ndarray], state: Growing) -> Shown:
    """A carrier with its facets, and those beside them that a cut has left on chords: none of them is free any longer."""
    (surface, members), facets = found, state.facets
    members = np.union1d(members, members_of(surface, state, 1.0 + _chord_slack(surface, members, state)))
    state.free[members] = False
    return Shown(_patch(surface, facets, members), members)


def _chord_slack(surface: Surface, members: np.ndarray, state: Growing) -> float:
    """In tolerances how far off a carrier a cut may leave corners of these facets."""
    return sagitta(surface, state.facets, members) / (state.config.on_surface * state.facets.diagonal)


def _grow_from(seed: int, state: Growing) -> tuple[Surface, np.ndarray] | None:
    """The carrier through a seed facet that explains the largest area, with its facets."""
    around = ring_of(seed, state.neighbours[seed], state, 12)
    found: list[tuple[float, Surface, np.ndarray]] = []

    def try_out(preference: float, guess: Surface, cut: bool = False, drawn: bool = False) -> None:
        # most guesses fail where they were made, which is far cheaper to see than over the whole mesh
        slack = NEAR_GUESS + (_chord_slack(guess, np.array([seed]), state) if cut else 0.0)
        settled = _settle_curved(guess, state) if len(members_of(guess, state, slack, around)) > 1 else None
        if settled is None or seed not in settled[1] or (cut and len(settled[1]) < CONFIRMED):
            return
        if drawn and not _is_drawn(*settled, state.facets):
            return
        found.append((float(state.facets.areas[settled[1]].sum()) * preference, *settled))

    for guess in hypotheses(seed, state):
        try_out(*guess)
    for cone in cone_in_rings(seed, state):
        try_out(1.0, cone, drawn=True)
    for kind in ("cone", "cylinder"):
        bands = [one for one in found if one[1].kind == kind]
        if bands:
            for torus in tori_along(*max(bands, key=_first)[1:], state):
                try_out(1.0, torus, drawn=True)
    return max(found, key=_first)[1:] if found else None


def _first(found: tuple[float, Surface, np.ndarray]) -> float:
    return found[0]


def _is_drawn(surface: Surface, members: np.ndarray, facets: Facets) -> bool:
    """Whether most corners of facets lie on a surface to the digits of a file, as those of a drawn face do: within the tolerance any smooth
    face is for a while a cone, and a torus."""
    off = np.abs(signed_distance(surface, points_of(facets, members)))
    return float(np.median(off)) < DRAWN_ON * facets.diagonal


def _settle_curved(guess: Surface, state: Growing) -> tuple[Surface, np.ndarray] | None:
    """As `settle`; None too where facets in a strip show a surface that closes on itself."""
    found = settle(guess, state)
    is_flat = found is not None and found[0].kind in CLOSED_KINDS and _is_strip(state.facets.normals[found[1]])
    return None if is_flat else found


def _is_strip(facing: np.ndarray) -> bool:
    """Whether facets face, by their normals [m, 3], directions of one plane alone: a flat between two narrow strips lies on a sphere too,
    without a sign that anything is curved across."""
    return float(np.linalg.svd(facing, compute_uv=False)[-1]) < FLAT_ACROSS * len(facing) ** 0.5


def _patch(surface: Surface, facets: Facets, members: np.ndarray) -> Patch:
    points = points_of(facets, members)
    facing = dot_rows(normals(surface, facets.centers[members]), facets.normals[members]) * facets.areas[members]
    return Patch(surface, points, float(facets.areas[members].sum()), 1 if facing.sum() > 0 else -1)


def _planes(facets: Facets, free: np.ndarray, config: MeshSurfaceConfig) -> list[Shown]:
    """Free facets collected into planes, largest first; the larger facet's plane stands for all that lie in it."""
    order = [i for i in np.argsort(-facets.areas, kind="stable") if free[i] and facets.areas[i] > config.least_plane * facets.diagonal**2]
    normal, at = np.empty((len(order), 3)), np.empty(len(order))
    groups: list[list[int]] = []
    count, cosine = 0, np.cos(np.radians(config.same_plane_deg))
    for i in order:
        n, c = facets.normals[i], facets.centers[i]
        side = normal[:count] @ n
        same = np.flatnonzero((np.abs(side) > cosine) & (np.abs(normal[:count] @ c - at[:count]) < config.on_surface * facets.diagonal))
        if len(same):
            groups[same[0]].append(int(i))
        elif count < 4 * config.max_planes:
            normal[count], at[count] = n, n @ c
            groups.append([int(i)])
            count += 1
    found = [Shown(_plane_patch(facets, np.array(g)), np.array(g)) for g in groups]
    return sorted(found, key=lambda s: -s.patch.area)[: config.max_planes]


def _plane_patch(facets: Facets, members: np.ndarray) -> Patch:
    largest = members[0]
    n = facets.normals[largest]
    sides = facets.normals[members] @ n
    outward = 1 if (sides > 0).all() else 0
    surface = Surface("plane", vec(facets.centers[largest]), vec(n))
    return Patch(surface, points_of(facets, members), float(facets.areas[members].sum()), outward)
