import zipfile

import pytest
import trimesh
from tests.export.coincident import MEANT
from tests.known_programs import KNOWN

from imdim.export.meshes import write_meshes
from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.solid import mesh_to_manifold, to_manifold

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
