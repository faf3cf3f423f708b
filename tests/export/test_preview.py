import numpy as np
import pytest
import trimesh

from imdim.export.preview import GAP, HEADER, PANEL, SUPERSAMPLE, VIEW, preview, side_by_side, thumbnail
from imdim.export.surface_colours import ColouredTarget
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.tree import Combine, Primitive
from imdim.target.target import Target, target_from

BLOCK = Primitive("box", (3.0, 2.0, 1.0))
STEPPED = Combine("union", BLOCK, Primitive("box", (1.0, 1.0, 1.0), (0.0, 0.0, 1.0)))


def mesh(program) -> trimesh.Trimesh:
    return to_trimesh(to_manifold(program))


def panels(target: Target, result, worst: float, supersample: int = SUPERSAMPLE) -> list[np.ndarray]:
    pixels = np.asarray(preview(target, mesh(result), worst, supersample=supersample), np.int64)
    lefts = (10 + number * (PANEL + 20) for number in range(3))
    return [pixels[HEADER : HEADER + PANEL, left : left + PANEL] for left in lefts]


def reddish(panel: np.ndarray) -> int:
    return int((panel[..., 0] - panel[..., 2] > 60).sum())


def inked(panel: np.ndarray) -> int:
    return int((panel.min(axis=2) < 250).sum())


@pytest.mark.parametrize("supersample", [1, SUPERSAMPLE])
def test_the_silhouette_has_the_area_of_the_projected_box(supersample):
    view = VIEW / np.linalg.norm(VIEW)
    area = abs(view) @ [2 * 1, 3 * 1, 3 * 2]
    right = np.cross([0, 0, 1], view) / np.linalg.norm(np.cross([0, 0, 1], view))
    wide = abs(right) @ [3, 2, 1]
    tall = abs(np.cross(view, right)) @ [3, 2, 1]
    exact = area * (0.92 * PANEL / max(wide, tall)) ** 2
    for panel in panels(target_from(mesh(BLOCK)), BLOCK, 0.0, supersample):
        assert inked(panel) == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("as_cloud", [False, True])
def test_what_is_missed_is_red_and_what_is_found_is_not(as_cloud):
    body = mesh(STEPPED)
    target = target_from(trimesh.sample.sample_surface(body, 4000, seed=0)[0] if as_cloud else body)
    assert [reddish(panel) > 1000 for panel in panels(target, BLOCK, 1.0)] == [False, False, True]
    assert [reddish(panel) for panel in panels(target, STEPPED, 0.0)] == [0, 0, 0]


@pytest.mark.parametrize("as_cloud", [False, True])
def test_a_verdict_is_a_fourth_panel(as_cloud):
    """Crimson is what stands on the block, grey the rest."""
    body = mesh(STEPPED)
    target = target_from(trimesh.sample.sample_surface(body, 4000, seed=0)[0] if as_cloud else body)
    pieces = target.points if as_cloud else body.triangles_center
    codes = np.where(pieces[:, 2] > 0.51, 2, 0)
    shares = {"exact": "70 %", "approximated": "0 %", "left out": "30 %"}
    shown = preview(target, mesh(BLOCK), 1.0, ColouredTarget(None if as_cloud else body, codes, shares))
    assert shown.width == 4 * (PANEL + GAP)
    panel = np.asarray(shown, np.int64)[HEADER : HEADER + PANEL, GAP // 2 + 3 * (PANEL + GAP) :]
    crimson = (panel[..., 0] - panel[..., 1] > 60).sum()
    view = abs(VIEW / np.linalg.norm(VIEW))
    assert crimson / inked(panel[:, :PANEL]) == pytest.approx(view.sum() / (view @ [2, 3, 6] + view[:2].sum()), rel=0.15)


@pytest.mark.parametrize(("scale", "offset"), [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6)])
def test_scale_and_place_do_not_matter(scale, offset):
    def placed(leaf: Primitive) -> Primitive:
        x, y, z = (scale * c + offset for c in leaf.center)
        return Primitive("box", tuple(scale * s for s in leaf.size), (x, y, z))

    moved = Combine("union", placed(STEPPED.left), placed(STEPPED.right))
    here, there = panels(target_from(mesh(STEPPED)), BLOCK, 1.0), panels(target_from(mesh(moved)), placed(BLOCK), scale)
    for a, b in zip(here, there, strict=True):
        assert (np.abs(a - b).max(axis=2) > 16).mean() < 0.005


def test_a_thumbnail_is_the_picture_of_the_result_made_small():
    small = np.asarray(thumbnail(mesh(STEPPED), 96), np.int64)
    large = panels(target_from(mesh(STEPPED)), STEPPED, 0.0)[1]
    assert small.shape == (96, 96, 3)
    assert inked(small) / 96**2 == pytest.approx(inked(large) / PANEL**2, rel=0.05)


def test_target_and_result_are_drawn_by_one_camera():
    target = target_from(mesh(BLOCK))
    same = [np.asarray(picture).min(axis=2) < 250 for picture in side_by_side(target, mesh(BLOCK), 120)]
    assert same[0].shape == (120, 120)
    assert (same[0] == same[1]).all()
    first, second = (np.asarray(picture).min(axis=2) < 250 for picture in side_by_side(target, mesh(STEPPED), 120))
    assert first.sum() < second.sum()
    assert not (first & ~second).any(), "the step is all that the result has more"
    cloud, _ = side_by_side(target_from(np.random.default_rng(0).random((4000, 3))), mesh(BLOCK), 120)
    assert inked(np.asarray(cloud)) > 500
