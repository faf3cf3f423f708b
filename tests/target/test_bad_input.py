"""What cannot be reconstructed is refused in one line that names the file and the number."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from imdim.target.target import InputError, load_target, target_from

BOX = trimesh.creation.box()
CLOUD = np.random.default_rng(0).random((60, 3))


def holed(value: float) -> np.ndarray:
    points = CLOUD.copy()
    points[[3, 5], 1] = value
    return points


CASES = {
    "few points": (CLOUD[:49], "49 points"),
    "no points": (np.zeros((0, 3)), r"\(0\)"),
    "NaN points": (holed(np.nan), "2 of 60"),
    "infinite points": (holed(np.inf), "2 of 60"),
    "a huge coordinate": (holed(1e200), r"1e\+200"),
    "one place": (np.ones((60, 3)), "60 points"),
    "one plane": (CLOUD * [1, 1, 0], "60 points .* 0"),
    "one line": (CLOUD * [1, 0, 0], "60 points .* 0"),
    "two columns": (CLOUD[:, :2], r"\[60, 2\]"),
    "a flat mesh": (trimesh.Trimesh(BOX.vertices * [1, 1, 0], BOX.faces, process=False), r"no volume \(0"),
    "a sheet": (trimesh.Trimesh(BOX.vertices, BOX.faces[:1], process=False), r"no volume \("),
    "no proper face": (trimesh.Trimesh(BOX.vertices, [[0, 0, 1], [2, 3, 3]], process=False), "0 faces"),
}


@pytest.mark.parametrize("case", CASES)
def test_refused_in_one_line(case):
    source, number = CASES[case]
    with pytest.raises(InputError, match=f"^part: .*{number}") as caught:
        target_from(source, name="part")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "number"),
    [
        ("missing.stl", None, "no such file"),
        ("empty.stl", b"", r"\(0 bytes\)"),
        ("part.step", b"ISO-10303-21;", r"'\.step'"),
        ("part", b"solid", "unknown format ''"),
        ("header.csv", b"x,y,z\n", "1 lines"),
        ("words.txt", b"this is\nnot a cloud\n", "2 lines"),
        ("ragged.xyz", b"0 0 0\n1 1\n2 2 2\n", "ragged"),
        ("flat.csv", b"0,0,0\n1,2,3\n", "2 points"),
        (
            "vertices.ply",
            b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
            "vertices",
        ),
        ("beyond.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "beyond"),
    ],
)
def test_files_are_refused_in_one_line(tmp_path, name, content, number):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=number) as caught:
        load_target(path)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_is_no_part(tmp_path):
    (tmp_path / "a.stl").mkdir()
    with pytest.raises(InputError, match=r"a\.stl"):
        load_target(tmp_path / "a.stl")


def many_boxes(count: int, crowd: int = 0) -> trimesh.Trimesh:
    """Boxes of .03 to .3 in a cube of 1000, and a sphere of many faces beside them."""
    rng = np.random.default_rng(0)
    places = BOX.vertices * rng.uniform(0.03, 0.3, (count, 1, 3)) + rng.uniform(0, 1000, (count, 1, 3))
    faces = BOX.faces + len(BOX.vertices) * np.arange(count)[:, None, None]
    boxes = trimesh.Trimesh(places.reshape(-1, 3), faces.reshape(-1, 3), process=False)
    ball = trimesh.creation.icosphere(crowd, 1e-3)
    return boxes if not crowd else trimesh.util.concatenate([boxes, ball])


def test_more_bodies_than_any_part_has_are_refused_at_once():
    with pytest.raises(InputError, match=r"^part: the mesh has 20000 separate bodies, at most 5000$"):
        target_from(many_boxes(20_000), name="part")


def test_thinning_leaves_something_and_says_what_went_with_it():
    """All of it is smaller than the least tolerance."""
    target = target_from(many_boxes(2500, 7), name="part")
    assert target.mesh is not None
    assert len(target.mesh.faces) > 0
    assert any("thinned to" in note and "% of the volume lost" in note for note in target.notes) or len(target.mesh.faces) > 200_000


def test_bad_normals_are_left_out_with_a_note():
    normals = np.ones_like(CLOUD)
    normals[7] = 0
    target = target_from(np.hstack([CLOUD, normals]))
    assert target.normals is None
    assert "1 of 60 normals" in target.notes[0]


def test_a_thin_needle_is_still_a_part():
    assert target_from(trimesh.creation.box((1.0, 1.0, 5000.0))).is_solid


def test_a_needle_of_a_kilometre_is_refused_for_what_it_is():
    with pytest.raises(InputError, match=r"too thin for its length \(9.99e\+05 cubic units, 1e-12 of the cubed diagonal; at least 1e-12\)"):
        target_from(trimesh.creation.box((1e6, 1.0, 0.999)))
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 0]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], process=False)
    with pytest.raises(InputError, match="encloses no volume"):
        target_from(flat)
