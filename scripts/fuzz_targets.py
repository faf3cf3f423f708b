"""What is fuzzed: valid files of each kind to start from, the code that reads them, and the errors that it may raise."""

from __future__ import annotations

import contextlib
import io
import json
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from imdim.program.tree import Combine, Primitive, combine_all

BOX = Primitive("box", (4.0, 2.0, 1.0), (0.5, 0.0, 0.0), (0.0, 0.0, 30.0))
PART = Combine("difference", BOX, combine_all("union", [Primitive("cylinder", (0.2, 2.0), (0.8 * i - 1.0, 0.0, 0.0)) for i in range(4)]))
EVERY = Combine("intersection", Combine("union", PART, Primitive("torus", (2.0, 0.5))), Primitive("ellipsoid", (3.0, 2.0, 2.0)))


class Unclear(Exception):
    """A refusal that is no single line, or a result that contradicts itself."""


@dataclass(frozen=True)
class Kind:
    """`form` chooses the mutations; `seeds` makes valid files in a folder; `try_one` reads a file and says whether
    it was refused; `share` is of all cases, in thousandths or so.
    """

    suffix: str
    form: str
    share: int
    seeds: Callable[[Path], list[bytes]]
    try_one: Callable[[Path], bool]


def refused(kinds: tuple[type[BaseException], ...], read: Callable[[], object]) -> bool:
    """Run `read`: whether it refused, which must be one line of bounded length."""
    try:
        read()
        return False
    except kinds as error:
        said = str(error)
        if not said or "\n" in said or len(said) > 2000:
            raise Unclear(f"{type(error).__name__} says {said[:200]!r}") from error
        return True


# --- clouds and meshes -----------------------------------------------------------------------------------------------


def _load(path: Path) -> bool:
    from imdim.geometry.cloud import InputError, load_target

    return refused((InputError,), lambda: load_target(path))


def _meshes(suffix: str, **options: object) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        two = trimesh.util.concatenate([trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(1).apply_translation((4, 0, 0))])
        out = []
        for mesh in (trimesh.creation.cylinder(1.0, 2.0, sections=12), two):
            found = mesh.export(file_type=suffix, **options)
            out.append(found.encode() if isinstance(found, str) else found)
        return out

    return seeds


def _cloud() -> np.ndarray:
    points, faces = trimesh.sample.sample_surface(trimesh.creation.box((1, 2, 3)), 200, seed=0)
    return np.hstack([points, trimesh.creation.box((1, 2, 3)).face_normals[faces]])


def _texts(_: Path) -> list[bytes]:
    table = _cloud()
    rows = ["\n".join(d.join(f"{v:.6g}" for v in row) for row in t) + "\n" for d, t in ((" ", table[:, :3]), (",", table), (";", table))]
    return [rows[0].encode(), ("x,y,z,nx,ny,nz\n" + rows[1]).encode(), ("# a scan\n" + rows[2]).encode(), ("\ufeff" + rows[0]).encode()]


def _ply_clouds(_: Path) -> list[bytes]:
    table = _cloud().astype("<f4")
    head = "ply\nformat {} 1.0\nelement vertex 200\n" + "".join(f"property float {n}\n" for n in ("x", "y", "z", "nx", "ny", "nz"))
    text = "\n".join(" ".join(f"{v:.5g}" for v in row) for row in table)
    return [
        (head.format("ascii") + "end_header\n" + text + "\n").encode(),
        (head.format("binary_little_endian") + "end_header\n").encode() + table.tobytes(),
    ]


def _pcds(_: Path) -> list[bytes]:
    table = _cloud().astype("<f4")
    head = "VERSION .7\nFIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\nTYPE F F F F F F\nCOUNT 1 1 1 1 1 1\n"
    head += "WIDTH 200\nHEIGHT 1\nPOINTS 200\nDATA {}\n"
    text = "\n".join(" ".join(f"{v:.5g}" for v in row) for row in table)
    columns = table.T.tobytes()
    literal = b"".join(bytes([len(columns[i : i + 32]) - 1]) + columns[i : i + 32] for i in range(0, len(columns), 32))
    sizes = np.array([len(literal), len(columns)], "<u4").tobytes()
    return [
        (head.format("ascii") + text + "\n").encode(),
        head.format("binary").encode() + table.tobytes(),
        head.format("binary_compressed").encode() + sizes + literal,
    ]


def _npys(_: Path) -> list[bytes]:
    out = []
    for table in (_cloud(), _cloud()[:, :3].astype("<f4"), np.asfortranarray(_cloud())):
        buffer = io.BytesIO()
        np.save(buffer, table)
        out.append(buffer.getvalue())
    return out


def _npzs(_: Path) -> list[bytes]:
    box = trimesh.creation.box((1, 2, 3))
    out = []
    for save, arrays in (
        (np.savez, {"points": _cloud()[:, :3], "normals": _cloud()[:, 3:]}),
        (np.savez_compressed, {"vertices": np.asarray(box.vertices), "faces": np.asarray(box.faces)}),
    ):
        buffer = io.BytesIO()
        save(buffer, **arrays)
        out.append(buffer.getvalue())
    return out


# --- programs --------------------------------------------------------------------------------------------------------


def _programs(_: Path) -> list[bytes]:
    from imdim.completed import completed
    from imdim.fitting import relations_of
    from imdim.program import codec

    found = completed(*relations_of(PART))
    meta = codec.Meta("millimeter", (1.0, 2.0, 3.0), 0.1)
    return [codec.dumps(EVERY).encode(), codec.dumps(found.program, meta, found.constraints, found.folded).encode()]


def _read_program(path: Path) -> bool:
    from imdim.program import codec

    def read() -> None:
        document = codec.parse(path.read_bytes())
        program, constraints, meta, folded = (f(document) for f in (codec.from_json, codec.constraints_of, codec.meta_of, codec.folded_of))
        text = codec.dumps(program, meta, constraints, folded)
        if (
            codec.loads(text) != program
            or codec.dumps(program, meta, constraints, folded) != text
            or hash(program) != hash(codec.loads(text))
        ):
            raise Unclear("written and read again it is another program")

    return refused((ValueError,), read)


def _fronts(folder: Path) -> list[bytes]:
    from imdim.program import front

    return [front.dumps([front.Choice(BOX, 0.5), front.Choice(PART, 0.01), front.Choice(EVERY)], picked=2).encode()]


def _read_front(path: Path) -> bool:
    from imdim.program import front

    return refused((ValueError,), lambda: front.loads(path.read_bytes()))


def _command(main: Callable[[], int], out: Path) -> bool:
    """A command ends with status 0, or with 2, one line and nothing written: whether it was 2."""
    from imdim.export.folder import FILES

    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        status = main()
    text = said.getvalue()
    if status not in (0, 2) or (status == 2 and (text.count("\n") != 1 or len(text) > 2000 or out.exists())):
        raise Unclear(f"status {status}, says {text[:300]!r}, written: {out.exists()}")
    if status == 0 and not {path.name for path in out.iterdir()} <= set(FILES):
        raise Unclear(f"wrote {sorted(path.name for path in out.iterdir())}")
    return status == 2


def _export(path: Path) -> bool:
    from imdim.app import export

    return _command(lambda: export.main(str(path), str(path.parent / "out"), None, 24), path.parent / "out")


def _delivered(folder: Path) -> list[bytes]:
    """Delivered folders as one file each: a JSON object of its texts, and arguments of an edit."""
    from imdim import deliver
    from imdim.app import edit
    from imdim.program.codec import Meta

    deliver.export(PART, folder / "delivered", Meta(), 24)
    texts = {
        p.name: p.read_text() for p in sorted((folder / "delivered").iterdir()) if p.name.startswith("program.") and p.suffix != ".step"
    }
    rows = [line.split()[:2] for line in edit.listed(folder / "delivered" / "program.json").splitlines()]
    values = {name: float(value) + 1 if name.endswith("count") else float(value) * 1.05 for name, value in rows}
    return [json.dumps({"texts": texts, "set": [f"{name}={value}"]}).encode() for name, value in values.items()]


def _edit(path: Path) -> bool:
    from imdim.app import edit

    given = json.loads(path.read_bytes())
    folder = path.parent / "given"
    folder.mkdir()
    for name, text in given["texts"].items():
        (folder / name).write_bytes(text.encode("utf-8", "surrogatepass"))
    settings = [part for text in given["set"] for part in ("--set", text.replace("\0", ""))]
    arguments = [str(folder / "program.json"), *settings, "-o", str(path.parent / "out")]
    return _command(lambda: edit.main(arguments), path.parent / "out")


def edit_mutated(data: bytes, rng: random.Random, mutate: Callable[[bytes, str], bytes]) -> bytes:
    """One of the texts or the assignment broken."""
    given = json.loads(data)
    name = rng.choice([*given["texts"], *["--set"] * 3])
    if name == "--set":
        given["set"] = [mutate(text.encode(), "text").decode("utf-8", "replace").replace("\n", " ") for text in given["set"]]
    else:
        form = "json" if name.endswith("json") else "text"
        given["texts"][name] = mutate(given["texts"][name].encode(), form).decode("utf-8", "replace")
    return json.dumps(given).encode()


# --- learning --------------------------------------------------------------------------------------------------------


def _policies(folder: Path) -> list[bytes]:
    import torch

    from imdim.learn.base import BaseConfig, BasePolicy
    from imdim.learn.checkpoint import save_net
    from imdim.learn.seed import SeedConfig, SeedPolicy
    from imdim.learn.stump.net import StumpNet
    from imdim.learn.stump.settings import StumpConfig

    torch.manual_seed(0)
    torch.set_num_threads(1)
    base = BasePolicy(BaseConfig(d_model=8, encoder_layers=1, decoder_layers=1, heads=2, gt_points=16, cur_points=16, point_width=8), 3)
    nets = (
        base,
        SeedPolicy(SeedConfig(d_model=8, layers=1, heads=2, hidden=8), 3),
        StumpNet(StumpConfig(primitives=8, intersections=4, width=8)),
    )
    out = []
    for net in nets:
        save_net(folder / "net.safetensors", net, {"note": "tiny"})
        out.append((folder / "net.safetensors").read_bytes())
    return out


def _read_policy(path: Path) -> bool:
    from imdim.learn.checkpoint import CheckpointError, load_policy, load_stump

    both = [refused((CheckpointError,), lambda read=read: read(path)) for read in (load_policy, load_stump)]
    return all(both)


def _states(folder: Path) -> list[bytes]:
    import torch

    from imdim.learn.checkpoint import save_state

    save_state(
        folder / "state.pt",
        {"step": 3, "best": 0.5, "config": {"seed": 0}, "policy": {"w": torch.ones(3)}, "average": {"w": torch.ones(3)}, "optimizer": {}},
    )
    return [(folder / "state.pt").read_bytes()]


def _read_state(path: Path) -> bool:
    from imdim.learn.checkpoint import CheckpointError, load_own_state

    return refused((CheckpointError, ValueError), lambda: load_own_state(path, {"seed": 0}))


def _samples(folder: Path) -> list[bytes]:
    import torch

    from imdim.data.folder import chunk_generator
    from imdim.data.npz import split_samples, write_sample
    from imdim.data.synthesize import SynthesisConfig, synthesize

    torch.set_num_threads(1)
    samples = split_samples(synthesize(4, SynthesisConfig(gt_points=64, cur_points=32, volume_samples=256), chunk_generator(0, 0, 0)))
    out = []
    for sample in samples[:3]:
        write_sample(folder / "sample.npz", sample)
        out.append((folder / "sample.npz").read_bytes())
    return out


def _read_sample(path: Path) -> bool:
    from imdim.data.npz import SampleError, read_sample

    return refused((SampleError,), lambda: read_sample(path))


# --- settings --------------------------------------------------------------------------------------------------------


def _settings(_: Path) -> list[bytes]:
    return [b"budget_s=3\nseed=1\nmethod=tree\nsize_weight=0.001\ncheckpoint=none\nlogdir=a/b", b"segments=12\nstump_checkpoint='x y'"]


def _read_settings(path: Path) -> bool:
    from imdim.config import ConfigError, from_arguments

    return refused((ConfigError,), lambda: from_arguments(path.read_bytes().decode("utf-8", "replace").split("\n")))


KINDS: Mapping[str, Kind] = {
    "stl": Kind(".stl", "bytes", 60, _meshes("stl"), _load),
    "stl_ascii": Kind(".stl", "bytes", 50, _meshes("stl_ascii"), _load),
    "obj": Kind(".obj", "bytes", 70, _meshes("obj"), _load),
    "off": Kind(".off", "bytes", 60, _meshes("off"), _load),
    "ply": Kind(".ply", "bytes", 50, _meshes("ply"), _load),
    "ply_ascii": Kind(".ply", "bytes", 40, _meshes("ply", encoding="ascii"), _load),
    "ply_cloud": Kind(".ply", "bytes", 40, _ply_clouds, _load),
    "3mf": Kind(".3mf", "zip", 70, _meshes("3mf"), _load),
    "glb": Kind(".glb", "glb", 70, _meshes("glb"), _load),
    "xyz": Kind(".xyz", "bytes", 40, _texts, _load),
    "csv": Kind(".csv", "bytes", 40, _texts, _load),
    "pcd": Kind(".pcd", "bytes", 80, _pcds, _load),
    "npy": Kind(".npy", "npy", 50, _npys, _load),
    "npz": Kind(".npz", "zip", 50, _npzs, _load),
    "program": Kind(".json", "json", 80, _programs, _read_program),
    "front": Kind(".json", "json", 30, _fronts, _read_front),
    "export": Kind(".json", "json", 30, lambda f: [*_programs(f), *_fronts(f)], _export),
    "edit": Kind(".edit", "edit", 30, _delivered, _edit),
    "policy": Kind(".safetensors", "safetensors", 40, _policies, _read_policy),
    "state": Kind(".pt", "zip", 20, _states, _read_state),
    "sample": Kind(".npz", "zip", 40, _samples, _read_sample),
    "settings": Kind(".txt", "bytes", 20, _settings, _read_settings),
}
