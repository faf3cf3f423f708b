"""Every format, written by trimesh, numpy or by hand, read back; and the traps that real files set."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from PIL import Image

from imdim.target.readers import FORMATS, InputError, read
from imdim.target.target import load_target

RNG = np.random.default_rng(3)
CLOUD = RNG.random((60, 3)).astype(np.float32).astype(float)
NORMALS = CLOUD / np.linalg.norm(CLOUD, axis=1, keepdims=True)
PCD = "# .PCD v0.7\nVERSION .7\nFIELDS {f}\nSIZE {s}\nTYPE {t}\nCOUNT {c}\nWIDTH {n}\nHEIGHT 1\nPOINTS {n}\nDATA {d}\n"


def pcd_head(form, fields="x y z", count=60):
    columns = len(fields.split())
    return PCD.format(f=fields, s=" ".join("4" * columns), t=" ".join("F" * columns), c=" ".join("1" * columns), n=count, d=form).encode()


@pytest.mark.parametrize("suffix", ["stl", "obj", "off", "ply", "3mf", "glb", "gltf"])
def test_a_mesh_keeps_its_volume_in_every_mesh_format(tmp_path, suffix):
    path = tmp_path / f"box.{suffix}"
    mesh = trimesh.creation.box((1.0, 2.0, 3.0))
    if suffix == "gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(mesh)).items():
            (tmp_path / name.replace("model", "box")).write_bytes(data)
    else:
        mesh.export(path)
    raw = read(path)
    assert raw.faces is not None
    assert trimesh.Trimesh(raw.points, raw.faces).volume == pytest.approx(6.0, rel=1e-6)


def test_every_format_is_read_by_some_test():
    assert set(FORMATS) == {".stl", ".obj", ".off", ".ply", ".3mf", ".glb", ".gltf", ".xyz", ".txt", ".csv", ".pcd", ".npy", ".npz"}


def test_a_binary_stl_may_begin_with_solid(tmp_path):
    data = bytearray(trimesh.creation.box().export(file_type="stl"))
    data[:12] = b"solid model "
    (tmp_path / "a.stl").write_bytes(data)
    assert len(read(tmp_path / "a.stl").points) == 36


def test_a_text_stl_is_read_as_text(tmp_path):
    (tmp_path / "a.stl").write_text(trimesh.creation.box().export(file_type="stl_ascii"))
    assert np.ptp(read(tmp_path / "a.stl").points, axis=0) == pytest.approx([1, 1, 1])


def test_a_glb_scene_keeps_its_transforms(tmp_path):
    scene = trimesh.Scene()
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    scene.add_geometry(trimesh.creation.box(), transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    scene.add_geometry(trimesh.creation.box((2, 1, 1)), transform=mirror @ trimesh.transformations.translation_matrix([5, 0, 0]))
    scene.export(tmp_path / "s.glb")
    raw = read(tmp_path / "s.glb")
    assert raw.faces is not None
    assert [raw.points[:, 0].min(), raw.points[:, 0].max()] == pytest.approx([-6, 5.5])
    assert trimesh.Trimesh(raw.points, raw.faces).volume == pytest.approx(3.0)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_a_ply_without_faces_is_a_cloud(tmp_path, encoding):
    trimesh.PointCloud(CLOUD).export(tmp_path / "c.ply", encoding=encoding)
    raw = read(tmp_path / "c.ply")
    assert raw.faces is None
    assert raw.points == pytest.approx(CLOUD, abs=1e-6)


def test_a_ply_cloud_keeps_its_normals(tmp_path):
    head = (
        "ply\nformat ascii 1.0\nelement vertex 60\n"
        + "".join(f"property float {p}\n" for p in ("x", "y", "z", "nx", "ny", "nz"))
        + "end_header\n"
    )
    rows = "\n".join(" ".join(map(str, row)) for row in np.hstack([CLOUD, NORMALS]))
    (tmp_path / "c.ply").write_text(head + rows + "\n")
    assert read(tmp_path / "c.ply").normals == pytest.approx(NORMALS, abs=1e-5)


def test_an_obj_without_faces_is_a_cloud(tmp_path):
    (tmp_path / "c.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in CLOUD))
    assert read(tmp_path / "c.obj").points == pytest.approx(CLOUD)


@pytest.mark.parametrize(
    ("name", "head", "delimiter"),
    [
        ("a.xyz", "", " "),
        ("a.txt", "# made by a scanner\n60\n", "\t"),
        ("a.csv", "x,y,z\n", ","),
        ("b.csv", "", ";"),
        ("c.csv", "\ufeffx,y,z\n", ","),
    ],
)
def test_text_with_any_head_and_delimiter(tmp_path, name, head, delimiter):
    rows = "\n".join(delimiter.join(f"{v:.6f}" for v in row) for row in CLOUD)
    (tmp_path / name).write_text(head + rows, encoding="utf-8")
    raw = read(tmp_path / name)
    assert raw.points == pytest.approx(CLOUD, abs=1e-6)
    assert raw.normals is None


def test_a_quoted_table_of_a_spreadsheet(tmp_path):
    rows = "\n".join(",".join(f'"{v:.6f}"' for v in row) for row in CLOUD)
    (tmp_path / "a.csv").write_text(f'"y","x","z"\n{rows}', encoding="utf-8")
    assert read(tmp_path / "a.csv").points == pytest.approx(CLOUD[:, [1, 0, 2]], abs=1e-6)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_text_in_utf_16(tmp_path, encoding):
    mark, box = "" if encoding == "utf-16" else "\ufeff", trimesh.creation.box()
    texts = {f"b.{kind}": box.export(file_type=kind) for kind in ("obj", "off")} | {"b.stl": box.export(file_type="stl_ascii")}
    texts["b.ply"] = box.export(file_type="ply", encoding="ascii").decode()
    for name, text in texts.items():
        (tmp_path / name).write_bytes((mark + text).encode(encoding))
        assert np.ptp(read(tmp_path / name).points, axis=0) == pytest.approx([1, 1, 1]), name
    rows = "\r\n".join("\t".join(f"{v:.6f}" for v in row) for row in CLOUD)
    (tmp_path / "a.txt").write_bytes(f"{mark}x\ty\tz\r\n{rows}".encode(encoding))
    assert read(tmp_path / "a.txt").points == pytest.approx(CLOUD, abs=1e-6)


def test_a_binary_stl_whose_head_looks_like_utf_16(tmp_path):
    data = trimesh.creation.box().export(file_type="stl")
    (tmp_path / "b.stl").write_bytes(b"\xff\xfe" + data[2:])
    assert np.ptp(read(tmp_path / "b.stl").points, axis=0) == pytest.approx([1, 1, 1])


@pytest.mark.parametrize("row", ["1,5;2,25;-3,0", '"1,5";"2,25";"3"', "1,5\t2,25\t3,0", "1,5 2 3,5"])
@pytest.mark.parametrize("before", ["", "1;2;3\n"])
def test_decimal_commas_are_refused_as_such(tmp_path, before, row):
    (tmp_path / "a.csv").write_text(f"{before}{row}\n{row}\n")
    with pytest.raises(InputError, match=r"numbers have decimal commas, as in '.*1,5.*': write them with points"):
        read(tmp_path / "a.csv")


def test_a_broken_row_beside_commas_that_part_numbers_is_no_decimal_comma(tmp_path):
    (tmp_path / "a.csv").write_text("1, 2, 3\n4, 5, 6\n7, x, 9\n")
    with pytest.raises(InputError, match="could not convert string ' x'"):
        read(tmp_path / "a.csv")


def test_text_columns_are_told_apart_by_header_or_by_length(tmp_path):
    colours = RNG.integers(0, 256, (60, 3))
    np.savetxt(tmp_path / "colour.xyz", np.hstack([CLOUD, colours]))
    np.savetxt(tmp_path / "normal.xyz", np.hstack([CLOUD, NORMALS]))
    np.savetxt(tmp_path / "both.xyz", np.hstack([CLOUD, colours, NORMALS]))
    np.savetxt(tmp_path / "named.csv", np.hstack([colours, CLOUD]), delimiter=",", header="r,g,b,x,y,z", comments="")
    assert read(tmp_path / "colour.xyz").normals is None
    assert read(tmp_path / "normal.xyz").normals == pytest.approx(NORMALS)
    assert read(tmp_path / "both.xyz").normals == pytest.approx(NORMALS)
    assert read(tmp_path / "named.csv").points == pytest.approx(CLOUD)


def test_pcd_as_text_and_as_records(tmp_path):
    rows = "\n".join(" ".join(map(repr, row)) for row in CLOUD.tolist())
    (tmp_path / "a.pcd").write_bytes(pcd_head("ascii") + rows.encode())
    fields = "x y z normal_x normal_y normal_z"
    (tmp_path / "b.pcd").write_bytes(pcd_head("binary", fields) + np.hstack([CLOUD, NORMALS]).astype("<f4").tobytes())
    assert read(tmp_path / "a.pcd").points == pytest.approx(CLOUD)
    assert read(tmp_path / "b.pcd").points == pytest.approx(CLOUD)
    assert read(tmp_path / "b.pcd").normals == pytest.approx(NORMALS, abs=1e-6)


def test_pcd_says_from_where_it_was_scanned(tmp_path):
    rows = "\n".join(" ".join(map(repr, row)) for row in CLOUD.tolist())
    for name, viewpoint in (("known", "1.5 -2 3"), ("unknown", "0 0 0")):
        head = pcd_head("ascii").replace(b"DATA", f"VIEWPOINT {viewpoint} 1 0 0 0\nDATA".encode())
        (tmp_path / f"{name}.pcd").write_bytes(head + rows.encode())
    assert np.array_equal(read(tmp_path / "known.pcd").scanners, [[1.5, -2.0, 3.0]])
    assert read(tmp_path / "unknown.pcd").scanners is None


def test_pcd_compressed_with_literals_and_with_references(tmp_path):
    plain = CLOUD.astype("<f4").T.tobytes()
    literal = b"".join(bytes([len(plain[i : i + 32]) - 1]) + plain[i : i + 32] for i in range(0, len(plain), 32))
    # sixty points (1, 1, 1): four literal bytes, then the same four again and again, at most 264 bytes a reference
    ones = b"\x03" + np.float32(1).tobytes() + b"\xe0\xff\x03" + b"\xe0\xff\x03" + bytes([0xE0, 720 - 4 - 528 - 9, 0x03])
    for name, packed in (("a.pcd", literal), ("b.pcd", ones)):
        (tmp_path / name).write_bytes(pcd_head("binary_compressed") + np.array([len(packed), 720], "<u4").tobytes() + packed)
    assert read(tmp_path / "a.pcd").points == pytest.approx(CLOUD)
    assert (read(tmp_path / "b.pcd").points == 1.0).all()


def test_pcd_pixels_without_a_return_are_left_out(tmp_path):
    (tmp_path / "a.pcd").write_bytes(pcd_head("ascii", count=3) + b"0 0 0\nnan nan nan\n1 2 3\n")
    assert read(tmp_path / "a.pcd").points.tolist() == [[0, 0, 0], [1, 2, 3]]


def test_numpy_arrays(tmp_path):
    np.save(tmp_path / "a.npy", np.hstack([CLOUD, NORMALS]))
    np.savez(tmp_path / "a.npz", vertices=CLOUD, faces=np.array([[0, 1, 2]]))
    assert read(tmp_path / "a.npy").normals == pytest.approx(NORMALS)
    assert read(tmp_path / "a.npz").faces.tolist() == [[0, 1, 2]]  # type: ignore[union-attr]


def test_a_cloud_may_say_where_its_scanners_stood(tmp_path):
    places = [[0.0, 0.0, 9.0], [9.0, 0.0, 0.0]]
    np.savez(tmp_path / "a.npz", points=CLOUD, scanners=np.array(places))
    assert read(tmp_path / "a.npz").scanners.tolist() == places  # type: ignore[union-attr]
    np.savez(tmp_path / "b.npz", points=CLOUD, scanners=np.array([[0.0, np.nan, 1.0], places[0]]))
    with pytest.raises(InputError, match="1 of 2 scanners are nowhere"):
        read(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", points=CLOUD, scanners=np.zeros((2, 4)))
    with pytest.raises(InputError, match="3 numbers of scanners each"):
        read(tmp_path / "c.npz")


def test_pickles_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(InputError, match=r"a\.npy"):
        read(tmp_path / "a.npy")


@pytest.mark.parametrize("suffix", sorted(FORMATS))
def test_garbage_and_truncation_are_input_errors(tmp_path, suffix):
    path = tmp_path / f"bad{suffix}"
    rng = np.random.default_rng(5)
    for size in (0, 1, 7, 90, 1500):
        path.write_bytes(rng.bytes(size))
        with pytest.raises(InputError) as caught:
            load_target(path)
        assert "bad" in str(caught.value)
        assert "\n" not in str(caught.value)


def test_textures_are_not_decoded(tmp_path, monkeypatch):
    """A picture of half a megabyte on ten meshes took more than eight gigabytes."""
    parts = []
    for x in (0.0, 3.0):
        mesh = trimesh.creation.box((1, 1, 1))
        mesh.apply_translation((x, 0, 0))
        mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), image=Image.new("RGB", (8, 8)))
        parts.append(mesh)
    path = tmp_path / "boxes.glb"
    path.write_bytes(trimesh.Scene(parts).export(file_type="glb"))

    def decode(*_args, **_settings):
        raise AssertionError("a texture was decoded")

    monkeypatch.setattr(Image.Image, "load", decode)
    assert len(read(path).faces) == 24
