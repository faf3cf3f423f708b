"""Valid programs, fronts and delivered folders to break; their readers, and the commands that export and edit them."""

from __future__ import annotations

import contextlib
import io
import json
import random
from collections.abc import Callable
from pathlib import Path

from kind import Unclear, refused

from imdim.program.tree import Combine, Primitive, combine_all

BOX = Primitive("box", (4.0, 2.0, 1.0), (0.5, 0.0, 0.0), (0.0, 0.0, 30.0))
PART = Combine("difference", BOX, combine_all("union", [Primitive("cylinder", (0.2, 2.0), (0.8 * i - 1.0, 0.0, 0.0)) for i in range(4)]))
EVERY = Combine("intersection", Combine("union", PART, Primitive("torus", (2.0, 0.5))), Primitive("ellipsoid", (3.0, 2.0, 2.0)))


def programs(_: Path) -> list[bytes]:
    from imdim.delivery.finish import finish
    from imdim.program import codec
    from imdim.reconstruction.fitting import relations_of

    found = finish(*relations_of(PART))
    meta = codec.Meta("millimeter", (1.0, 2.0, 3.0), 0.1)
    return [codec.dumps(EVERY).encode(), codec.dumps(found.program, meta, found.constraints, found.folded).encode()]


def read_program(path: Path) -> bool:
    from imdim.program import codec

    def read() -> None:
        document = codec.parse(path.read_bytes())
        program, constraints, meta, folded = (
            f(document) for f in (codec.from_json, codec.constraints_of, codec.meta_of, codec.read_folded)
        )
        text = codec.dumps(program, meta, constraints, folded)
        if (
            codec.loads(text) != program
            or codec.dumps(program, meta, constraints, folded) != text
            or hash(program) != hash(codec.loads(text))
        ):
            raise Unclear("written and read again it is another program")

    return refused((ValueError,), read)


def fronts(folder: Path) -> list[bytes]:
    from imdim.program import front

    return [front.dumps([front.Choice(BOX, 0.5), front.Choice(PART, 0.01), front.Choice(EVERY)], picked=2).encode()]


def read_front(path: Path) -> bool:
    from imdim.program import front

    return refused((ValueError,), lambda: front.loads(path.read_bytes()))


def _command(arguments: list[str], out: Path) -> bool:
    """A command ends with status 0, or with 2, one line and nothing written: whether it was 2."""
    from imdim.app.cli import main
    from imdim.export.folder import FILES

    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        status = main(arguments)
    text = said.getvalue()
    if status not in (0, 2) or (status == 2 and (text.count("\n") != 1 or len(text) > 2000 or out.exists())):
        raise Unclear(f"status {status}, says {text[:300]!r}, written: {out.exists()}")
    if status == 0 and not {path.name for path in out.iterdir()} <= set(FILES):
        raise Unclear(f"wrote {sorted(path.name for path in out.iterdir())}")
    return status == 2


def export(path: Path) -> bool:
    return _command(["export", str(path), "-o", str(path.parent / "out"), "--segments", "24"], path.parent / "out")


def delivered(folder: Path) -> list[bytes]:
    """Delivered folders as one file each: a JSON object of its texts, and arguments of an edit."""
    from imdim.app import edit
    from imdim.delivery import deliver
    from imdim.program.codec import Meta

    deliver.export(PART, folder / "delivered", Meta(), 24)
    texts = {
        p.name: p.read_text() for p in sorted((folder / "delivered").iterdir()) if p.name.startswith("program.") and p.suffix != ".step"
    }
    names, _, _ = edit.list_names(folder / "delivered" / "program.json").partition("\n\n")  # the holes come behind
    rows = [line.split()[:2] for line in names.splitlines()]
    values = {name: float(value) + 1 if name.endswith("count") else float(value) * 1.05 for name, value in rows}
    return [json.dumps({"texts": texts, "set": [f"{name}={value}"]}).encode() for name, value in values.items()]


def edit(path: Path) -> bool:
    given = json.loads(path.read_bytes())
    folder = path.parent / "given"
    folder.mkdir()
    for name, text in given["texts"].items():
        (folder / name).write_bytes(text.encode("utf-8", "surrogatepass"))
    settings = [part for text in given["set"] for part in ("--set", text.replace("\0", ""))]
    return _command(["edit", str(folder / "program.json"), *settings, "-o", str(path.parent / "out")], path.parent / "out")


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
