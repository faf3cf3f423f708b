"""What a 3MF model would grow to: objects may be made of objects many times over, so that a small file describes any number of faces."""

from __future__ import annotations

import zipfile
from typing import NamedTuple

MAX_FACES = 20_000_000
MAX_COPIES = 100_000
MODEL = "3d/3dmodel.model"


class Grown(NamedTuple):
    """Copies of meshes, and faces, all components counted."""

    copies: int
    faces: int


def check_model(archive: zipfile.ZipFile) -> None:
    """Raise ValueError, one line, for a model that would grow beyond MAX_FACES or MAX_COPIES, or has an object made of a later one.

    Objects come before those that are made of them (3MF Core Specification, section 4), so one pass is enough.
    """
    from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

    info = next((info for info in archive.infolist() if MODEL in info.filename.lower()), None)
    if info is None:
        raise ValueError(f"no {MODEL} among its {len(archive.infolist())} members")
    grown: dict[str | None, Grown] = {}
    with archive.open(info) as file:
        for _, element in etree.iterparse(file, tag=("{*}object", "{*}build"), resolve_entities=False, no_network=True):
            found = _grown(element, grown)
            if found.copies > MAX_COPIES or found.faces > MAX_FACES:
                raise ValueError(f"its components grow to {found.copies} meshes of {found.faces} faces")
            grown[element.get("id")] = found
            element.clear()


def _grown(element, grown: dict[str | None, Grown]) -> Grown:
    copies, faces = 1, sum(1 for _ in element.iter("{*}triangle"))
    for part in element.iter("{*}component", "{*}item"):
        name = part.get("objectid")
        if name not in grown:
            raise ValueError(f"object {str(name)[:40]!r} is used before it is there")
        copies, faces = copies + grown[name].copies, faces + grown[name].faces
    return Grown(copies, faces)
