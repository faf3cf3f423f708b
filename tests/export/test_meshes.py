import json
import math
import re
import tracemalloc
import zipfile

import numpy as np
import pytest
import trimesh
from tests.export.blended import BOX, RIM, fillet
from tests.export.coincident import MEANT
from tests.known_programs import KNOWN
from tests.planted import box, cut, cylinder, union

from imdim.export.meshes import NamedFeatures, assign_faces, write_meshes
from imdim.export.part_names import ADDED, BLENDED, CUT
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.solid import join_touching, mesh_to_manifold, to_manifold, to_trimesh
from imdim.target.target import load_target

SUFFIXES = ("stl", "glb", "3mf")
PARTS = {
    "bracket": MEANT["bracket"][:2],
    "tilted": MEANT["tilted"][:2],
    **{n: KNOWN[n] for n in ("cross drilled", "half torus", "crescent")},
}


@pytest.mark.parametrize("name", PARTS)
def test_files_are_closed_and_hold_the_volume(name, tmp_path):
    program, exact = PARTS[name]
    write_meshes(to_manifold(overshoot(program)), tmp_path)
    for suffix in SUFFIXES:
        read = trimesh.load_mesh(tmp_path / f"mesh.{suffix}")
        assert mesh_to_manifold(read).volume() == pytest.approx(exact, rel=4e-3)


def test_a_wall_that_begins_where_a_plate_ends_up_to_rounding_is_in_the_files(tmp_path):
    plate, wall = box(30, 20.5, 30, center=(15, 14.45, 15)), box(30, 5.3, 30, center=(15, 27.35, 15))
    stack = union(plate, wall, box(10, 6, 6, center=(15, 24, 17)))
    write_meshes(to_manifold(stack), tmp_path)
    assert trimesh.load_mesh(tmp_path / "mesh.stl").volume == pytest.approx(30 * 25.8 * 30, rel=1e-6)
    write_meshes(join_touching(stack), tmp_path)
    assert mesh_to_manifold(trimesh.load_mesh(tmp_path / "mesh.stl")).volume() == pytest.approx(30 * 25.8 * 30, rel=1e-6)


def test_the_same_bytes_every_time(tmp_path):
    solid = to_manifold(MEANT["bracket"][0])
    written = []
    for _ in range(2):
        write_meshes(solid, tmp_path)
        written.append([(tmp_path / f"mesh.{suffix}").read_bytes() for suffix in SUFFIXES])
    assert written[0] == written[1]


def test_3mf_is_in_millimetres(tmp_path):
    write_meshes(to_manifold(KNOWN["box"][0]), tmp_path)
    with zipfile.ZipFile(tmp_path / "mesh.3mf") as package:
        assert b'unit="millimeter"' in package.read("3D/3dmodel.model")


def test_an_empty_solid_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="empty solid"):
        write_meshes(to_manifold(KNOWN["nothing"][0]), tmp_path)
    assert list(tmp_path.iterdir()) == []


PLATE = cut(box(80, 50, 6), cylinder(3, 8, (-20, 0, 0)), cylinder(3, 8, (20, 0, 0)))


def nodes_of(path):
    """Names, areas and colours of the nodes of a GLB with a mesh."""
    scene = trimesh.load_scene(path)
    return {
        name: (geometry.area, tuple(round(v / 255, 2) for v in geometry.visual.material.baseColorFactor[:3]))
        for name in scene.graph.nodes_geometry
        for geometry in [scene.geometry[scene.graph[name][1]]]
    }


def test_a_glb_has_a_node_for_each_feature(tmp_path):
    write_meshes(to_manifold(PLATE), tmp_path, NamedFeatures.of("plate", PLATE))
    nodes = nodes_of(tmp_path / "mesh.glb")
    facet = 2 * 3 * math.sin(math.pi / 96) * 96  # around a hole, inscribed
    assert {name: colour for name, (_, colour) in nodes.items()} == {"plate": ADDED, "hole": CUT, "hole2": CUT}
    assert [nodes[name][0] for name in ("hole", "hole2")] == pytest.approx([facet * 6] * 2, rel=1e-5)
    hole = 96 * 9 * math.sin(math.pi / 96) * math.cos(math.pi / 96)
    assert nodes["plate"][0] == pytest.approx(2 * (80 * 50 - 2 * hole) + 2 * 6 * (80 + 50), rel=1e-5)


def test_a_glb_has_flat_normals(tmp_path):
    write_meshes(to_manifold(PLATE), tmp_path, NamedFeatures.of("plate", PLATE))
    data = (tmp_path / "mesh.glb").read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert all("NORMAL" in primitive["attributes"] for mesh in tree["meshes"] for primitive in mesh["primitives"])
    for geometry in trimesh.load_scene(tmp_path / "mesh.glb", process=False).geometry.values():
        given = geometry.vertex_normals[geometry.faces]
        assert np.abs(given - geometry.face_normals[:, None]).max() < 1e-4


def test_copies_have_names_of_their_own_and_blends_are_one_node(tmp_path):
    equal = NamedFeatures.of("plate", PLATE)
    names = equal.names._replace(features=("plate", "hole", "hole"))
    write_meshes(to_manifold(PLATE), tmp_path, equal._replace(names=names))
    assert set(nodes_of(tmp_path / "mesh.glb")) == {"plate", "hole", "hole (2)"}
    edges = (fillet(2.0, RIM),)
    solid = solid_with_edges(BOX, edges)
    write_meshes(solid, tmp_path, NamedFeatures.of("box", BOX, edges))
    nodes = nodes_of(tmp_path / "mesh.glb")
    assert {name: colour for name, (_, colour) in nodes.items()} == {"body": ADDED, "blend": BLENDED}
    assert mesh_to_manifold(trimesh.load_mesh(tmp_path / "mesh.glb")).volume() == pytest.approx(
        solid_with_edges(BOX, edges).volume(), rel=1e-5
    )


def test_3mf_says_the_units_of_the_program(tmp_path):
    write_meshes(to_manifold(KNOWN["box"][0]), tmp_path, units="inch")
    with zipfile.ZipFile(tmp_path / "mesh.3mf") as package:
        assert b'unit="inch"' in package.read("3D/3dmodel.model")
    inches = to_manifold(KNOWN["box"][0]).volume()
    assert load_target(tmp_path / "mesh.3mf").mesh.volume == pytest.approx(25.4**3 * inches)


def test_a_3mf_has_an_object_for_each_body_with_its_name(tmp_path):
    apart = union(box(5, 5, 48, (40.0, 0.0, 0.0)), box(10, 20, 30))
    write_meshes(to_manifold(apart), tmp_path, NamedFeatures.of('a "b" <c>', apart))
    with zipfile.ZipFile(tmp_path / "mesh.3mf") as package:
        text = package.read("3D/3dmodel.model").decode()
    called = re.findall(r"<object id=\"(\d)\" type=\"model\" name=\"(.*?)\">", text)
    assert called == [("1", "a &quot;b&quot; &lt;c&gt;"), ("2", "a &quot;b&quot; &lt;c&gt; (2)")]
    assert '<metadata name="Title">a "b" &lt;c&gt;</metadata>' in text
    assert len(re.findall("<item objectid", text)) == 2
    bodies = trimesh.load_scene(tmp_path / "mesh.3mf").dump()
    assert sorted(body.volume for body in bodies) == pytest.approx([5 * 5 * 48, 10 * 20 * 30])
    assert load_target(tmp_path / "mesh.3mf").mesh.volume == pytest.approx(5 * 5 * 48 + 10 * 20 * 30)


def test_owners_of_faces_take_no_memory_for_each_pair():
    """8,192 boxes of a document of a kilobyte took 11 GB: as many distances as there are faces, of each."""
    row = union(*(box(1, 1, 1, (2.0 * i, 0, 0)) for i in range(300)))
    mesh = to_trimesh(to_manifold(row))
    tracemalloc.start()
    owners = assign_faces(mesh, row, ())
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 300 * len(mesh.faces) * 8 / 3
    assert (owners == np.round(mesh.triangles_center[:, 0] / 2)).all()


def test_a_face_that_lies_on_no_feature_is_of_the_nearest_one():
    """As where rounding moved a blend: the middle is farther from all features than any that they made."""
    row = union(box(1, 1, 1), box(1, 1, 1, (10.0, 0.0, 0.0)))
    off = trimesh.creation.box((0.1, 0.1, 0.1))
    off.apply_translation((6.0, 0.0, 0.0))
    assert (assign_faces(off, row, ()) == 1).all()
