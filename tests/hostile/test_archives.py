"""Archives and arrays built to harm: code in pickles, floods, paths that lead out, promises of terabytes. Each is refused in one line."""

from __future__ import annotations

import io
import os
import pickle
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from imdim.data.npz import SampleError, read_sample
from imdim.learn.checkpoint import CheckpointError, load_policy, load_state, load_stump
from imdim.target.archives import ArchiveError, open_archive, read_arrays
from imdim.target.target import InputError, load_target

MODEL = (
    '<?xml version="1.0"?>{doctype}<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
    '<resources><object id="1" type="model" name="{name}"><mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>'
    "</object>"
    '{more}</resources><build><item objectid="{item}"/></build></model>'
)


def model(doctype: str = "", name: str = "part", more: str = "", item: int = 1) -> bytes:
    box = trimesh.creation.box((1, 2, 3))
    vertices = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*v) for v in box.vertices)
    triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in box.faces)
    return MODEL.format(doctype=doctype, name=name, vertices=vertices, triangles=triangles, more=more, item=item).encode()


def packed(members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return out.getvalue()


def refused(path: Path, content: bytes, said: str) -> None:
    """In one line, without giving memory to what the file promises."""
    path.write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=said) as caught:
            load_target(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert "\n" not in str(caught.value)
    assert path.name in str(caught.value)
    assert peak < 300e6


def test_a_3mf_as_it_should_be_is_read(tmp_path):
    (tmp_path / "part.3mf").write_bytes(packed({"3D/3dmodel.model": model()}))
    assert load_target(tmp_path / "part.3mf").is_solid


def test_a_bomb_is_refused(tmp_path):
    refused(tmp_path / "part.3mf", packed({"3D/3dmodel.model": model(), "Metadata/x.png": b"\0" * (200 << 20)}), "would unpack to 2097")
    refused(tmp_path / "part.npz", packed({"points.npy": b"\0" * (200 << 20)}), "would unpack to 2097")


@pytest.mark.parametrize(
    "name", ["../escaped.txt", "/tmp/escaped.txt", "a/../../escaped.txt", "C:\\escaped.txt", "..\\escaped.txt", "\\escaped"]
)
def test_a_path_that_leads_out_is_refused(tmp_path, name):
    refused(tmp_path / "part.3mf", packed({"3D/3dmodel.model": model(), name: b"x"}), "leads out of the archive")


def test_odd_packing_is_refused(tmp_path):
    refused(tmp_path / "part.3mf", packed({"3D/3dmodel.model": model()}, zipfile.ZIP_LZMA), "packed by method 14")
    content = bytearray(packed({"3D/3dmodel.model": model()}, zipfile.ZIP_STORED))
    content[6] |= 1  # "encrypted", in the local header and in the directory
    content[content.rindex(b"PK\x01\x02") + 8] |= 1
    refused(tmp_path / "locked.3mf", bytes(content), "is encrypted")
    twice = packed({"3D/3dmodel.model": model(), "3D/3dmodel.modex": b"another"})
    refused(tmp_path / "twice.3mf", twice.replace(b"3dmodel.modex", b"3dmodel.model"), "names occur twice")
    refused(tmp_path / "many.3mf", packed({str(i): b"" for i in range(10_001)}, zipfile.ZIP_STORED), "10001 members")


def test_a_name_that_is_accepted_stays_inside(tmp_path):
    for name in ("a", "a/b.npy", "..a", "a..b/c", "3D/3dmodel.model"):
        with open_archive(io.BytesIO(packed({name: b"x"}))) as archive:
            for info in archive.infolist():
                assert (tmp_path / info.filename).resolve().is_relative_to(tmp_path.resolve())


def test_an_entity_opens_no_file_and_does_not_multiply(tmp_path):
    (tmp_path / "secret").write_text("SECRET")
    outside = f'<!DOCTYPE model [<!ENTITY x SYSTEM "file://{tmp_path}/secret">]>'
    laughs = '<!DOCTYPE model [<!ENTITY a0 "ha">' + "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9)) + "]>"
    for doctype, name in ((outside, "&x;"), (laughs, "&a9;")):
        refused(tmp_path / "part.3mf", packed({"3D/3dmodel.model": model(doctype, name)}), "not a readable 3MF file")


def test_components_that_multiply_are_refused(tmp_path):
    """Ten objects a level, each of ten of the level below: 10 ** 7 boxes."""
    objects, below = "", ["1"]
    for level in range(7):
        names = [f"{level + 2}{i}" for i in range(10)]
        parts = "".join(f'<component objectid="{name}"/>' for name in (below * 10)[:10])
        objects += "".join(f'<object id="{name}" type="model"><components>{parts}</components></object>' for name in names)
        below = names
    refused(tmp_path / "part.3mf", packed({"3D/3dmodel.model": model(more=objects, item=80)}), "grow to [0-9]+ meshes")


class Payload:
    def __init__(self, path: Path) -> None:
        self.path = str(path)

    def __reduce__(self):
        return os.mkdir, (self.path,)


def test_no_pickle_is_loaded(tmp_path):
    """The payload would make a folder."""
    done = tmp_path / "done"
    objects = np.empty(3, object)
    objects[:] = Payload(done)
    np.save(tmp_path / "part.npy", objects, allow_pickle=True)
    np.savez(tmp_path / "part.npz", points=objects)
    np.savez(tmp_path / "sample.npz", gt_points=objects, cur_points=objects, gt_tokens=objects, gt_params=objects)
    for name in ("part.npy", "part.npz"):
        refused(tmp_path / name, (tmp_path / name).read_bytes(), "'object' where numbers are expected|object")
    with pytest.raises(SampleError, match="gt_points"):
        read_sample(tmp_path / "sample.npz")
    for name in ("a.npy", "a.npz", "a.xyz", "a.pcd", "a.ply", "a.3mf"):
        refused(tmp_path / name, pickle.dumps(Payload(done)), name)
    torch.save({"step": Payload(done)}, tmp_path / "state.pt")
    (tmp_path / "plain.pt").write_bytes(pickle.dumps(Payload(done)))
    for name in ("state.pt", "plain.pt"):
        with pytest.raises(CheckpointError, match="not a training state"):
            load_state(tmp_path / name)
        for load in (load_policy, load_stump):
            with pytest.raises(CheckpointError, match="not a safetensors file"):
                load(tmp_path / name)
    assert not done.exists()


def npy(shape: str, descr: str = "'<f8'") -> bytes:
    head = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + b"\0" * 480


@pytest.mark.parametrize(
    ("shape", "descr"),
    [
        ("(10**12, 3)", "'<f8'"),
        ("(1000000000000, 3)", "'<f8'"),
        ("(-1, 3)", "'<f8'"),
        ("(1000000000000, 3)", "'|V0'"),
        ("(1000000000000, 3)", "'<U0'"),
        ("(2, 3)", "[('a', '<f8', (100000, 100000))]"),
        ("(2, 3)", "'|O'"),
        ("(2, 3)", "'<M8[s]'"),
        ("(2, 3)", "'<c16'"),
        ("(" * 2000, "'<f8'"),
        ("__import__('os').mkdir('escaped')", "'<f8'"),
    ],
)
def test_an_array_that_promises_too_much_is_refused(tmp_path, monkeypatch, shape, descr):
    monkeypatch.chdir(tmp_path)
    refused(tmp_path / "part.npy", npy(shape, descr), "part.npy")
    refused(tmp_path / "part.npz", packed({"points.npy": npy(shape, descr)}), "part.npz")
    assert {path.name for path in tmp_path.iterdir()} == {"part.npy", "part.npz"}


PLY = "ply\nformat {form} 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
PCD = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 {count}\nWIDTH {n}\nHEIGHT 1\nPOINTS {n}\nDATA {form}\n"
HUGE = 10**12


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("ascii.ply", PLY.format(form="ascii", n=HUGE).encode()),
        ("binary.ply", PLY.format(form="binary_little_endian", n=HUGE).encode() + b"\0" * 100),
        ("negative.ply", PLY.format(form="binary_little_endian", n=-5).encode() + b"\0" * 100),
        ("binary.pcd", PCD.format(form="binary", n=HUGE, count=1).encode() + b"\0" * 100),
        ("columns.pcd", PCD.format(form="binary", n=1, count=HUGE).encode() + b"\0" * 100),
        ("packed.pcd", PCD.format(form="binary_compressed", n=HUGE, count=1).encode() + b"\0" * 100),
        ("flood.pcd", PCD.format(form="binary_compressed", n=10**8, count=1).encode() + struct.pack("<II", 8, 1200000000) + b"\0" * 8),
        ("ascii.pcd", PCD.format(form="ascii", n=HUGE, count=1).encode() + b"0 0 0\n"),
        ("binary.stl", b"\0" * 80 + struct.pack("<I", 2**32 - 1) + b"\0" * 50),
        ("part.off", f"OFF\n{HUGE} {HUGE} 0\n0 0 0\n".encode()),
        ("part.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999\n"),
        ("negative.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -9 -8 -7\n"),
        ("wide.csv", ("1," * 200_000 + "1\n").encode() * 3),
    ],
)
def test_a_header_that_promises_too_much_is_refused(tmp_path, name, content):
    refused(tmp_path / name, content, name)


def glb(text: str) -> bytes:
    body = text.encode() + b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<II", 2, 20 + len(body)) + struct.pack("<I", len(body)) + b"JSON" + body


@pytest.mark.parametrize(
    "text",
    [
        "[" * 5000,
        "[" + ",".join(["[" * 150 + "1" + "]" * 150] * 10_000) + "]",
        '{"asset": {"version": "2.0"}, "nodes": [{"children": [0]}], "scenes": [{"nodes": [0]}], "scene": 0}',
        '{"asset":{"version":"2.0"},"accessors":[{"componentType":5126,"count":1000000000000,"type":"VEC3"}],'
        '"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],"scene":0}',
        "{}",
        "null",
    ],
)
def test_a_glb_that_is_none_is_refused(tmp_path, text):
    refused(tmp_path / "part.glb", glb(text), "part.glb")


def test_a_gltf_reads_nothing_outside_of_its_folder(tmp_path):
    (tmp_path / "secret.bin").write_bytes(b"\0" * 1000)
    inner = tmp_path / "inner"
    inner.mkdir()
    for uri in ("../secret.bin", str(tmp_path / "secret.bin"), "http://192.0.2.1/x.bin", "%2e%2e/secret.bin"):
        text = f'{{"asset":{{"version":"2.0"}},"buffers":[{{"uri":"{uri}","byteLength":1000}}]}}'
        refused(inner / "part.gltf", text.encode(), "part.gltf")


def test_a_member_that_lies_about_its_size_is_refused():
    content = bytearray(packed({"points.npy": npy("(20, 3)")}))
    at = content.rindex(b"PK\x01\x02")
    content[at + 24 : at + 28] = struct.pack("<I", 100)
    with open_archive(io.BytesIO(bytes(content))) as archive, pytest.raises(ArchiveError, match="points"):
        read_arrays(archive)
