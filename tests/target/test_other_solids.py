"""Files that were read as other solids than they hold, or left parts out without a word: read whole, noted, or refused by name."""

from __future__ import annotations

import json
import struct
import time
import zipfile

import numpy as np
import pytest
import trimesh

from imdim.target.readers import InputError, read
from imdim.target.target import load_target

BOX = trimesh.creation.box((1.0, 2.0, 3.0))
# an L of area 4 + 4 and perimeter 14, concave at (2, 1), as a prism; triangles of a fan from its first corner would overlap
L_SHAPE = np.array([(4, 0), (4, 3), (2, 3), (2, 1), (0, 1), (0, 0)], float)
HEIGHT = 2.0


def prism():
    """Points, and polygons of six and of four corners."""
    n = len(L_SHAPE)
    points = np.array([(x, y, z) for z in (0.0, HEIGHT) for x, y in L_SHAPE])
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    return points, [tuple(range(n))[::-1], tuple(range(n, 2 * n)), *sides]


def volume(path):
    raw = read(path)
    return trimesh.Trimesh(raw.points, raw.faces).volume


def obj_text(points, polygons):
    rows = [f"v {x:g} {y:g} {z:g}" for x, y, z in points]
    return "\n".join(rows + ["f " + " ".join(str(i + 1) for i in polygon) for polygon in polygons]) + "\n"


def ply_bytes(points, polygons, form):
    head = f"ply\nformat {form} 1.0\ncomment x\nelement vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {len(polygons)}\nproperty list uchar int vertex_indices\nproperty uchar red\nend_header\n"
    if form == "ascii":
        rows = [" ".join(f"{v:g}" for v in p) for p in points] + [" ".join(map(str, (len(q), *q, 255))) for q in polygons]
        return head.encode() + "\n".join(rows).encode() + b"\n"
    order = "<" if form == "binary_little_endian" else ">"
    body = np.asarray(points, order + "f4").tobytes()
    return head.encode() + body + b"".join(struct.pack(f"{order}B{len(q)}iB", len(q), *q, 255) for q in polygons)


def off_text(points, polygons):
    rows = [f"OFF\n# by hand\n{len(points)} {len(polygons)} 0", *(" ".join(f"{v:g}" for v in p) for p in points)]
    return "\n".join(rows + [" ".join(map(str, (len(q), *q))) for q in polygons]) + "\n"


PLIES = ("ascii", "binary_little_endian", "binary_big_endian")


@pytest.mark.parametrize("kind", ["obj", "off", *PLIES])
def test_concave_polygons_and_those_of_any_size_keep_their_volume(tmp_path, kind):
    points, polygons = prism()
    made = {"obj": obj_text, "off": off_text}.get(kind)
    path = tmp_path / f"l.{kind if made else 'ply'}"
    path.write_bytes(made(points, polygons).encode() if made else ply_bytes(points, polygons, kind))
    raw = read(path)
    mesh = trimesh.Trimesh(raw.points, raw.faces)
    assert (mesh.volume, mesh.area) == (pytest.approx(8.0 * HEIGHT), pytest.approx(2 * 8.0 + 14.0 * HEIGHT))


@pytest.mark.parametrize("form", PLIES)
def test_a_ply_of_quads_alone(tmp_path, form):
    quads = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    points = [(x, y, z) for z in (0, 3) for x, y in ((0, 0), (1, 0), (1, 2), (0, 2))]
    (tmp_path / "a.ply").write_bytes(ply_bytes(points, quads, form))
    assert volume(tmp_path / "a.ply") == pytest.approx(6.0)


def test_a_polygon_that_crosses_itself_is_still_read(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n")
    assert len(read(tmp_path / "a.obj").faces) == 2


def test_an_obj_that_counts_from_zero_is_refused(tmp_path):
    rows = [f"v {x:g} {y:g} {z:g}" for x, y, z in BOX.vertices] + ["f " + " ".join(map(str, face)) for face in BOX.faces]
    (tmp_path / "a.obj").write_text("\n".join(rows))
    with pytest.raises(InputError, match=r"a\.obj.* \d of 36 corners name vertex 0, but OBJ counts from 1$"):
        read(tmp_path / "a.obj")


def test_an_obj_may_count_backwards_and_go_on_in_the_next_line(tmp_path):
    parts = [f"v {x:g} {y:g} {z:g} 1 0 0" for x, y, z in BOX.vertices]
    parts += ["\tf " + "/2/3 \\\n ".join(str(i - 8) for i in face) + "//" for face in BOX.faces]
    (tmp_path / "a.obj").write_text("\r\n".join([*parts, "v 9 9 9", "l 1 2"]))
    assert volume(tmp_path / "a.obj") == pytest.approx(6.0)


def test_an_obj_of_many_objects_takes_as_long_as_one_of_few(tmp_path):
    rows = []
    for i in range(4000):
        rows += [f"o part{i}", f"usemtl m{i}", *(f"v {x + 5 * i:g} {y:g} {z:g}" for x, y, z in BOX.vertices)]
        rows += ["f " + " ".join(str(v - 8) for v in face) for face in BOX.faces]
    (tmp_path / "a.obj").write_text("\n".join(rows))
    start = time.process_time()
    assert len(read(tmp_path / "a.obj").faces) == 48_000
    assert time.process_time() - start < 2.0  # 7 s where each material is a mesh of its own


def stl(count, held):
    data = bytearray(BOX.export(file_type="stl"))
    data[80:84] = count.to_bytes(4, "little")
    return bytes(data[: 84 + 50 * held])


@pytest.mark.parametrize("count", [0, 5])
def test_an_stl_whose_header_counts_too_few_is_read_whole_and_says_so(tmp_path, count):
    (tmp_path / "a.stl").write_bytes(stl(count, 12))
    target = load_target(tmp_path / "a.stl")
    assert target.mesh.volume == pytest.approx(6.0)
    assert target.notes == (f"The header counts {count} triangles, the file has 12: all were read.",)


def test_a_truncated_stl_is_refused_as_such(tmp_path):
    (tmp_path / "a.stl").write_bytes(stl(12, 7))
    with pytest.raises(InputError, match="not a whole STL file: 12 triangles need 684 bytes, 434 are there"):
        read(tmp_path / "a.stl")


def threemf(path, objects, items, unit="millimeter"):
    space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    text = f'<model unit="{unit}" xmlns="{space}"><resources>{objects}</resources><build>{items}</build></model>'
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", text)


def mesh_object(number, kind=""):
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in BOX.vertices + 10.0 * number)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in BOX.faces)
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"
    return f'<object id="{number}"{kind and f" type={chr(34)}{kind}{chr(34)}"}>{mesh}</object>'


@pytest.mark.parametrize("kind", ["support", "solidsupport"])
def test_support_material_of_a_3mf_is_left_out_and_told(tmp_path, kind):
    items = '<item objectid="1"/><item objectid="2"/>'
    threemf(tmp_path / "a.3mf", mesh_object(1) + mesh_object(2, kind), items)
    target = load_target(tmp_path / "a.3mf")
    assert target.mesh.volume == pytest.approx(6.0)
    assert target.notes == ("An object that is no part of the solid, as support material, was left out.",)


def test_inches_of_a_3mf_become_millimetres_and_are_told(tmp_path):
    threemf(tmp_path / "a.3mf", mesh_object(1, "model"), '<item objectid="1"/>', "inch")
    target = load_target(tmp_path / "a.3mf")
    assert target.mesh.volume == pytest.approx(6.0 * 25.4**3)
    assert target.notes == ("The file's unit is inch: read as millimetres, each 25.4.",)
    threemf(tmp_path / "b.3mf", mesh_object(1), '<item objectid="1"/>', "ell")
    with pytest.raises(InputError, match="unknown unit 'ell'"):
        read(tmp_path / "b.3mf")


def glb(path, change):
    """A box of 1 x 2 x 3 whose document `change` has changed; the binary chunk is its argument too, and may grow."""
    data = trimesh.Scene(BOX).export(file_type="glb")
    size = int.from_bytes(data[12:16], "little")
    document, binary = json.loads(data[20 : 20 + size]), bytearray(data[28 + size :])
    change(document, binary)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


def draco_half(document, binary):
    primitive = document["meshes"][0]["primitives"][0]
    document["meshes"].append(
        {"primitives": [{**primitive, "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}}]}
    )
    document["nodes"].append({"mesh": 1, "translation": [9, 0, 0]})
    document["scenes"][0]["nodes"].append(len(document["nodes"]) - 1)


def required(document, binary):
    document["extensionsRequired"] = ["KHR_materials_unlit", "EXT_meshopt_compression"]


def skinned(document, binary):
    next(node for node in document["nodes"] if "mesh" in node)["skin"] = 0


def morphed(document, binary):
    document["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]


def own_child(document, binary):
    document["nodes"][document["scenes"][0]["nodes"][0]]["children"] = [document["scenes"][0]["nodes"][0]]


def views_too_short(document, binary):
    document["bufferViews"][0]["byteLength"] = 4


def not_finite(document, binary):
    document["nodes"][document["scenes"][0]["nodes"][0]]["translation"] = [1e308, 1e308, 1e308]
    document["nodes"][document["scenes"][0]["nodes"][0]]["scale"] = [1e308, 1e308, 1e308]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (draco_half, "a mesh has KHR_draco_mesh_compression, which is not read"),
        (required, "it requires EXT_meshopt_compression, which is not read"),
        (skinned, "has a skin, which is not read"),
        (morphed, "a mesh has morph targets"),
        (own_child, "has two parents, or is its own"),
        (views_too_short, "rows need"),
        (not_finite, "beyond 1e|not finite"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_a_glb_has_and_is_not_read_is_refused_by_name(tmp_path, change, said):
    glb(tmp_path / "a.glb", change)
    with pytest.raises(InputError, match=said) as caught:
        load_target(tmp_path / "a.glb")
    assert "\n" not in str(caught.value)


def test_sparse_places_of_a_glb_count(tmp_path):
    def taller(document, binary):
        """The corners at the top are two and a half higher, by sparse values."""
        primitive = document["meshes"][0]["primitives"][0]
        accessor = document["accessors"][primitive["attributes"]["POSITION"]]
        top = np.flatnonzero(BOX.vertices[:, 2] > 0)
        values = (BOX.vertices[top] + [0, 0, 2.5]).astype("<f4").tobytes()
        start = len(binary)
        binary += top.astype("<u2").tobytes() + values
        document["buffers"][0]["byteLength"] = len(binary)
        views = [(start, 2 * len(top)), (start + 2 * len(top), len(values))]
        document["bufferViews"] += [{"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in views]
        at = len(document["bufferViews"])
        indices, what = {"bufferView": at - 2, "componentType": 5123}, {"bufferView": at - 1}
        accessor["sparse"] = {"count": len(top), "indices": indices, "values": what}

    glb(tmp_path / "a.glb", taller)
    assert volume(tmp_path / "a.glb") == pytest.approx(1 * 2 * 5.5, rel=1e-6)


def test_a_glb_of_many_nodes_is_read_in_seconds(tmp_path):
    def many(document, binary):
        document["nodes"] = [{"mesh": 0, "translation": [4.0 * i, 0, 0]} for i in range(60_000)]
        document["scenes"] = [{"nodes": list(range(60_000))}]
        document["scene"] = 0

    glb(tmp_path / "a.glb", many)
    start = time.process_time()
    assert len(read(tmp_path / "a.glb").faces) == 720_000
    assert time.process_time() - start < 6.0


@pytest.mark.parametrize(("mode", "order", "six_volumes"), [(5, (0, 1, 2, 3, 0, 1), 1), (6, (3, 0, 1, 2, 0), 1), (4, (0, 1, 2), 0)])
def test_strips_close_a_tetrahedron_and_fans_share_their_first_corner(tmp_path, mode, order, six_volumes):
    def changed(document, binary):
        start = len(binary)
        binary += np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], "<f4").tobytes() + np.array(order, "<u2").tobytes()
        document["buffers"][0]["byteLength"] = len(binary)
        document["bufferViews"] = [{"buffer": 0, "byteOffset": start + at, "byteLength": 48} for at in (0, 48)]
        document["bufferViews"][1]["byteLength"] = 2 * len(order)
        places = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
        document["accessors"] = [places, {"bufferView": 1, "componentType": 5123, "count": len(order), "type": "SCALAR"}]
        document["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}]

    glb(tmp_path / "a.glb", changed)
    raw = read(tmp_path / "a.glb")
    a, b, c = (raw.points[raw.faces[:, i]] for i in range(3))
    assert abs(np.einsum("ij,ij->", a, np.cross(b, c))) == pytest.approx(six_volumes)  # about the corner at the origin
    assert len(raw.faces) == {4: 1, 5: 4, 6: 3}[mode]
    if mode == 6:
        assert (raw.faces[:, 0] == 3).all()


def test_turned_and_mirrored_nodes_of_a_glb(tmp_path):
    """Places against trimesh, the volume by closed form."""

    def changed(document, binary):
        quarter = [0, 0, 0.5**0.5, 0.5**0.5]  # a quarter turn about z
        node = {"mesh": 0, "rotation": quarter, "scale": [2, 1, -1], "translation": [7, 0, 0]}
        document["nodes"], document["scenes"], document["scene"] = [node], [{"nodes": [0]}], 0

    glb(tmp_path / "a.glb", changed)
    raw = read(tmp_path / "a.glb")
    mesh = trimesh.Trimesh(raw.points, raw.faces)
    assert mesh.volume == pytest.approx(12.0, rel=1e-6)
    assert mesh.bounds == pytest.approx(np.array([[6.0, -1.0, -1.5], [8.0, 1.0, 1.5]]), abs=1e-6)
    assert raw.points.max(axis=0) == pytest.approx(trimesh.load_scene(tmp_path / "a.glb").bounds[1], abs=1e-6)


@pytest.mark.parametrize("corner", [0.5, np.nan, 1e300])
@pytest.mark.filterwarnings("error")
def test_corners_of_an_npz_are_whole_numbers(tmp_path, corner):
    faces = BOX.faces.astype(float)
    faces[0, 0] = corner
    np.savez(tmp_path / "a.npz", vertices=BOX.vertices, faces=faces)
    with pytest.raises(InputError, match="1 of 12 faces have corners that are no whole numbers"):
        read(tmp_path / "a.npz")
