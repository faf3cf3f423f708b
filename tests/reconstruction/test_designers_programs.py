"""Whole parts as people draw them in OpenSCAD come back as the few features, and the numbers, that were typed."""

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from imdim.geometry.solid import to_trimesh
from imdim.program.tree import Program, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct_best


def fit(mesh: trimesh.Trimesh) -> Program:
    return reconstruct_best(mesh, Settings(evolution=False)).program


def test_a_knob_with_grooves_is_a_turned_part_with_nine_cylinders_cut_from_it() -> None:
    """Each groove shows a part of its circle, and most corners of the cone are those of grooves."""
    knob = Manifold.cylinder(16, 18, 16, 72) + Manifold.cylinder(8, 9, 9, 72).translate([0, 0, -7])
    for turn in range(0, 360, 40):
        knob -= Manifold.cylinder(30, 4, 4, 72).translate([19.5, 0, -1]).rotate([0, 0, turn])
    found = list(leaves(fit(to_trimesh(knob))))
    cut = [leaf for leaf in found if leaf.kind == "cylinder" and leaf.size[0] == pytest.approx(4.0, abs=1e-6)]
    assert len(cut) == 9
    assert [np.hypot(*leaf.center[:2]) for leaf in cut] == pytest.approx([19.5] * 9, abs=1e-5)
    assert len(found) <= 9 + 2


def test_a_funnel_with_a_tab_stays_a_turned_drawing_and_its_tab_a_box() -> None:
    """Six cones and cylinders would each have to end where the next begins; and the tab, which runs into the flaring rim, has no notch."""
    corners = [(6, 0), (8, 0), (9, 30), (40, 65), (40, 70), (38, 70), (38, 66), (7, 31)]
    funnel = Manifold.revolve(CrossSection([np.array(corners, float)]), 90) + Manifold.cube([22, 8, 6]).translate([38, -4, 64])
    turned, tab = leaves(fit(to_trimesh(funnel)))
    assert (turned.kind, tab.kind) == ("revolve", "box")
    assert turned.outline is not None
    found = sorted((round(x, 2), round(y + turned.center[2], 2)) for x, y, _ in turned.outline.rings[0])
    assert found == sorted(corners)
    assert sorted(tab.size)[:2] == pytest.approx([6.0, 8.0])
