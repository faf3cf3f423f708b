"""report.html: one page that opens anywhere, offline - the solid beside its target in 3D, the program as a tree, and the numbers.

The page holds its own data and scripts. Its content policy refuses everything else: no network, and no script but the one below, so that a
part may be called whatever it likes.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from imdim.export.feature_names import label_features
from imdim.export.hole_names import hole_groups
from imdim.export.html_surfaces import Box, solid_values, target_values
from imdim.export.html_tree import constraint_values, leaf_values, name_values, tree_values
from imdim.export.parameters import Parameters, parametrise
from imdim.export.surface_colours import ColouredResult, ColouredTarget
from imdim.geometry.edge_solids import surface_with_edges
from imdim.geometry.solid import SEGMENTS
from imdim.program.codec import constraints_of, edges_of, from_json, read_folded
from imdim.program.edges import describe_edges
from imdim.target.target import Target

SCRIPTS = ("vectors.js", "meshes.js", "shapes.js", "renderer.js", "view.js", "steer.js", "tree.js", "panels.js", "main.js")


def content(
    document: object,
    target: Target | None = None,
    named: Parameters | None = None,
    segments: int = SEGMENTS,
    worst: float | None = None,
    name: str = "program",
    verdict: ColouredTarget | None = None,
    coverage: ColouredResult | None = None,
) -> dict[str, Any]:
    """What a page draws and lists of a program, as plain values; `document` is a parsed program.json.

    Without a `target` the solid stands alone, called `name`. `named` has the names of the other texts, else they come from the document's
    constraints. `worst` is the largest distance from the target to the result, in model units, if it is known better than the page's
    corners would say, `verdict` what became of the target, and `coverage` what it shows of the solid. Raises ValueError as
    `from_json` does for a document that holds no program.
    """
    program, constraints, folded = from_json(document), constraints_of(document), read_folded(document)
    named = named or parametrise(program, constraints, program, folded)
    label = named.labels or label_features(program, constraints, folded)
    edges = edges_of(document)
    surface, owners = surface_with_edges(program, edges, segments)
    shown = [] if target is None else [target.points if target.mesh is None else target.mesh.vertices]
    box = Box.around(surface.vertices, *shown)
    return {
        "name": name if target is None else target.name,
        "low": box.low.tolist(),
        "high": box.high.tolist(),
        "solid": solid_values(surface, owners, box, coverage),
        "target": None if target is None else target_values(target, surface, box, worst, verdict),
        "leaves": leaf_values(program, label, named),
        "tree": tree_values(folded),
        "constraints": constraint_values(constraints, label),
        "names": name_values(named, folded),
        "edges": [{"says": describe_edges(f), "leaves": sorted({face.leaf for edge in f.edges for face in edge})} for f in edges],
        "holes": [{"says": str(group), "leaves": list(group.leaves)} for group in hole_groups(program)],
    }


def page(content: Mapping[str, Any], report: Mapping[str, Any] | None = None, front: Mapping[str, Any] | None = None) -> str:
    """The text of the page with `content`, and with the parsed report.json and front.json where there are any."""
    style, script = _read("page.css"), _script()
    parts = {
        "title": html.escape(_printable(content["name"])),
        "policy": f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; base-uri 'none'; form-action 'none'",
        "style": style,
        "script": script,
        "data": _json({**content, "report": report, "front": None if front is None else _front(front)}),
    }
    # one pass: what is filled in is never read as a placeholder
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _read("page.html"))


def _json(values: Mapping[str, Any]) -> str:
    """JSON without a character that HTML could read as markup; raises ValueError for a number that JSON does not know."""
    text = json.dumps(values, allow_nan=False, ensure_ascii=True, separators=(",", ":"), default=str)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _front(front: Mapping[str, Any]) -> dict[str, Any]:
    keys = ("pick", "primitives", "operations", "features", "curves", "error")
    choices = [{key: choice[key] for key in keys if key in choice} for choice in front["choices"]]
    return {"picked": front["picked"], "choices": choices}


def _printable(text: str) -> str:
    """Names of files may hold bytes that are no text."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _hash(text: str) -> str:
    """How a content policy names the one inline text that it lets in."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


@cache
def _script() -> str:
    return '"use strict";\n' + "\n".join(map(_read, SCRIPTS))


@cache
def _read(name: str) -> str:
    return (files("imdim.export") / "page" / name).read_text(encoding="utf-8")
