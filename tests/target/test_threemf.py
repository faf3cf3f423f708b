"""3MF models of several objects against trimesh's reader, and what is refused."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from imdim.target.readers import InputError, read

HEAD = (
    '<?xml version="1.0"?><model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" '
    'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06">'
)
TURN = np.asarray(trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (0.5, 0, 1)), float)
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0]) @ trimesh.transformations.translation_matrix((3, 4, 5))


def mesh(size=(1.0, 2.0, 3.0)) -> str:
    box = trimesh.creation.box(size)
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*v) for v in box.vertices)
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in box.faces)
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


def given(transform: np.ndarray) -> str:
    """As an attribute: the columns of the upper rows, one after another."""
    return 'transform="' + " ".join(repr(float(v)) for v in transform[:3].T.ravel()) + '"'


def written(path: Path, resources: str, build: str, **others: str) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", f"{HEAD}<resources>{resources}</resources><build>{build}</build></model>")
        for name, content in others.items():
            archive.writestr(f"3D/{name}.model", f"{HEAD}<resources>{content}</resources><build/></model>")
    return path


def corners(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Triangles [n, 9], each from its least corner on, sorted."""
    triangles = np.round(points[faces], 9) + 0.0
    turned = [np.roll(t, -min(range(3), key=lambda i, t=t: tuple(t[i])), axis=0).ravel() for t in triangles]
    return np.array(sorted(map(tuple, turned)))


def test_objects_of_objects_stand_where_trimesh_puts_them(tmp_path):
    resources = f'<object id="1" name="a">{mesh()}</object><object id="2" name="b">{mesh((4, 1, 1))}</object>'
    resources += f'<object id="3"><components><component objectid="1" {given(TURN)}/><component objectid="2"/></components></object>'
    resources += f'<object id="4"><components><component objectid="3" {given(MIRROR)}/><component objectid="1"/></components></object>'
    build = f'<item objectid="4" {given(TURN)}/><item objectid="2" {given(MIRROR)}/>'
    path = written(tmp_path / "a.3mf", resources, build)
    raw, scene = read(path), trimesh.load_scene(path, process=False).to_mesh()
    assert raw.faces is not None
    assert len(raw.faces) == 4 * 12
    assert corners(raw.points, raw.faces) == pytest.approx(corners(scene.vertices, scene.faces), abs=1e-6)
    assert trimesh.Trimesh(raw.points, raw.faces).volume == pytest.approx(2 * 6 + 2 * 4)  # mirrored ones too are not inside out


def test_what_is_not_built_is_not_there_and_two_meshes_of_an_object_are_one(tmp_path):
    path = written(
        tmp_path / "a.3mf", f'<object id="1">{mesh()}{mesh((4, 1, 1))}</object><object id="2">{mesh()}</object>', '<item objectid="1"/>'
    )
    raw = read(path)
    assert raw.faces is not None
    assert trimesh.Trimesh(raw.points, raw.faces).volume == pytest.approx(6 + 4)


def test_objects_of_another_model_of_the_archive(tmp_path):
    parts = '<component p:path="/3D/other.model" objectid="1"/><component p:path="/3D/other.model" objectid="2" '
    resources = f'<object id="9"><components>{parts}{given(MIRROR)}/></components></object>'
    other = f'<object id="1">{mesh()}</object><object id="2">{mesh((4, 1, 1))}</object>'
    raw = read(written(tmp_path / "a.3mf", resources, '<item objectid="9"/>', other=other))
    assert raw.faces is not None
    assert trimesh.Trimesh(raw.points, raw.faces).volume == pytest.approx(6 + 4)
    assert raw.points[:, 0].min() == pytest.approx(-3 - 2)


@pytest.mark.parametrize(
    ("resources", "build", "said"),
    [
        ('<object id="1"><components><component objectid="1"/></components></object>', "", "object '1' is used before it is there"),
        (f'<object id="1">{mesh()}</object>', '<item objectid="1" transform="1 2 3"/>', "a transform of 3 numbers, 12 are needed"),
        (f'<object id="1">{mesh()}</object>', '<item objectid="1" p:path="/3D/no.model"/>', "'3D/no.model' is not in the archive"),
        ("", '<item p:path="/3D/other.model" objectid="1"/>', "is named by a model that another one names"),
        ('<object id="1"><mesh><vertices><vertex x="1" y="2"/></vertices></mesh></object>', "", "an element without 'z', line 1"),
        (f"<object>{mesh()}</object>", "", "an element without 'id', line 1"),
        (f'<object id="1">{mesh()}</object>'.replace('v1="', 'v1="7', 1), "", "1 of 36 corners name a vertex"),
        ("<object", "", "not well-formed"),
    ],
)
def test_what_is_broken_is_one_line(tmp_path, resources, build, said):
    other = '<object id="1"><components><component p:path="/3D/3dmodel.model" objectid="1"/></components></object>'
    path = written(tmp_path / "a.3mf", resources, build, other=other)
    with pytest.raises(InputError) as caught:
        read(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_model_without_faces_has_no_points(tmp_path):
    path = written(tmp_path / "a.3mf", '<object id="1"><mesh><vertices/><triangles/></mesh></object>', '<item objectid="1"/>')
    assert len(read(path).points) == 0


def test_a_chain_of_ten_thousand_objects_is_read(tmp_path):
    links = "".join(f'<object id="{i}"><components><component objectid="{i - 1}"/></components></object>' for i in range(2, 10_000))
    raw = read(written(tmp_path / "a.3mf", f'<object id="1">{mesh()}</object>{links}', '<item objectid="9999"/>'))
    assert raw.faces is not None
    assert len(raw.faces) == 12
