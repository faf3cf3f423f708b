"""A person selects a chamfer and changes its distance."""

import pytest
from tests.app.lab.page.browser import in_the_lab

from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.edges import EdgeFeature, Face
from imdim.program.tree import Primitive
from imdim.target.target import Frame, target_from

pytestmark = in_the_lab
BLOCK = Primitive("box", (40.0, 30.0, 10.0))
RIM = tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y"))


def volume(distance):
    return solid_with_edges(BLOCK, [EdgeFeature("chamfer", (distance,), RIM)]).volume()


def test_a_chamfer_is_selected_and_changed(phone, tmp_path):
    to_trimesh(solid_with_edges(BLOCK, [EdgeFeature("chamfer", (2.0,), RIM)])).export(tmp_path / "block.stl")
    phone.page.set_input_files("input[type=file]", tmp_path / "block.stl")
    phone.says("block.stl")
    phone.run()
    assert phone.volume() == pytest.approx(volume(2.0), rel=1e-3)
    phone.tab("Edit")
    phone.click_spot(Frame.of(target_from(to_trimesh(to_manifold(BLOCK)), "block")), (0.0, -14.0, 4.0))  # the edge in front
    phone.box("distance mm").fill("3")
    phone.measures(volume(3.0))
    phone.page.locator(".lab-row", has_text="chamfer 3 of 4 edges").wait_for(state="attached")
    phone.keys("Control+z")
    phone.measures(volume(2.0))
    phone.keys("Escape")
