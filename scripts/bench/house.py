"""The state of the house in numbers: ``python scripts/bench/house.py``.

Printed are the lines of src, class names with more than one meaning, functions named by a participle (a function is a verb), conversions
between the unit frame and a body's units, rows of the layers in which neighbours may import each other, and modules that do not say in one
line what they are. A name counts as a participle where its first word ends with "ed" or is one of IRREGULAR; properties are values, which
may be named so.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "imdim"
NO_PARTICIPLES = {"seed", "feed", "need", "speed", "exceed", "embed", "proceed", "succeed", "signed"}  # signed distance is the field's term
# those that differ from the infinitive: cut, run, put, set, hit, read, spread, split are verbs as they stand
IRREGULAR = {
    "begun",
    "bent",
    "bitten",
    "blown",
    "born",
    "bought",
    "bound",
    "broken",
    "brought",
    "built",
    "burnt",
    "caught",
    "chosen",
    "dealt",
    "done",
    "drawn",
    "driven",
    "fallen",
    "felt",
    "found",
    "given",
    "gone",
    "gotten",
    "grown",
    "held",
    "hidden",
    "hung",
    "kept",
    "known",
    "laid",
    "left",
    "lent",
    "likened",
    "lit",
    "lost",
    "made",
    "meant",
    "met",
    "mistaken",
    "paid",
    "proven",
    "redrawn",
    "rewritten",
    "said",
    "seen",
    "sent",
    "shaken",
    "shown",
    "sold",
    "sought",
    "spent",
    "spoken",
    "stood",
    "struck",
    "sunk",
    "swept",
    "taken",
    "taught",
    "thought",
    "told",
    "torn",
    "understood",
    "withdrawn",
    "worn",
    "written",
}
VALUES = {"property", "cached_property", "setter"}
FRAME_HOME = "target.py"
PIPELINE = {"pipeline.py", "several_bodies.py", "one_body.py", "body_state.py"}
CONVERSION = re.compile(r"frame\.(undo|apply|normalise)\b|in_unit_frame\(")  # of programs and targets; pictures have frames of their own

Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def main() -> int:
    """Print the table; the exit status."""
    modules = parse_modules(SOURCE)
    doubled, participles = doubled_classes(modules), participle_functions(modules)
    public = [name for name in participles if not is_private(name)]
    pipeline, conversions = count_conversions(SOURCE)
    rows = {
        "lines in src": sum(len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCE.rglob("*.py")),
        "class names with more than one meaning": list_of(list(doubled)),
        "public functions named by a participle": list_of(public),
        "private functions named by a participle": list_of([name for name in participles if is_private(name)]),
        "frame conversions": f"{pipeline} in the pipeline, {conversions - pipeline} elsewhere",
        "layer rows in which neighbours import each other": count_open_rows(ROOT / "pyproject.toml"),
        "modules whose docstring does not begin with a sentence on one line": list_of(without_sentence(modules)),
    }
    for what, value in rows.items():
        print(f"{what}: {value}")
    return 0


def parse_modules(source: Path) -> dict[str, ast.Module]:
    """Dotted module names below `source` with their trees."""
    paths = sorted(source.rglob("*.py"))
    return {".".join(p.relative_to(source).with_suffix("").parts): ast.parse(p.read_text(encoding="utf-8")) for p in paths}


def doubled_classes(modules: Mapping[str, ast.Module]) -> dict[str, list[str]]:
    """Class names that several classes have, with their modules."""
    homes: dict[str, list[str]] = defaultdict(list)
    for module, tree in modules.items():
        for name, node in definitions(tree):
            if isinstance(node, ast.ClassDef):
                homes[name.rsplit(".", 1)[-1]].append(module)
    return {name: where for name, where in homes.items() if len(where) > 1}


def participle_functions(modules: Mapping[str, ast.Module]) -> list[str]:
    """Functions and methods that are named by what they leave instead of what they do, as ``module:name``."""
    every = ((f"{module}:{name}", node) for module, tree in modules.items() for name, node in definitions(tree))
    return [name for name, node in every if not isinstance(node, ast.ClassDef) and is_participle(node.name) and not is_value(node)]


def is_participle(name: str) -> bool:
    """Whether the first word of a function's name is a past participle."""
    word = name.strip("_").split("_")[0].lower()
    return word in IRREGULAR or (word.endswith("ed") and len(word) > 3 and word not in NO_PARTICIPLES)


def is_value(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether it is read without a call."""
    return any(getattr(d, "attr", getattr(d, "id", "")) in VALUES for d in node.decorator_list)


def is_private(name: str) -> bool:
    return any(part.startswith("_") for part in name.split(":")[1].split("."))


def definitions(tree: ast.AST, owner: str = "") -> Iterator[tuple[str, Definition]]:
    """Qualified names of classes and functions, but not of functions within functions."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, Definition):
            yield owner + node.name, node
            if isinstance(node, ast.ClassDef):
                yield from definitions(node, f"{owner}{node.name}.")
        elif isinstance(node, ast.If | ast.Try | ast.With | ast.For):
            yield from definitions(node, owner)


def count_conversions(source: Path) -> tuple[int, int]:
    """Conversions between the frames: in the modules of the pipeline, the place for them, and in all modules but the frame's own."""
    counts = {p: len(CONVERSION.findall(p.read_text(encoding="utf-8"))) for p in source.rglob("*.py") if p.name != FRAME_HOME}
    return sum(n for p, n in counts.items() if p.name in PIPELINE), sum(counts.values())


def count_open_rows(project: Path) -> int:
    """Rows of the import contract whose modules may import each other."""
    contracts = tomllib.loads(project.read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    return sum(":" in layer for contract in contracts for layer in contract["layers"])


def without_sentence(modules: Mapping[str, ast.Module]) -> list[str]:
    """Modules whose first line, all that lists of them show, is no sentence."""
    first = {module: (ast.get_docstring(tree) or "").partition("\n")[0] for module, tree in modules.items()}
    return [module for module, line in first.items() if not line.endswith((".", "?"))]


def list_of(names: Sequence[str]) -> str:
    """The number of names, and which."""
    return f"{len(names)}" + (f" ({', '.join(names)})" if names else "")


if __name__ == "__main__":
    sys.exit(main())
