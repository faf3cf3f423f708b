"""One program of a front.json, or a program.json, written as CAD files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from imdim.export.numbers import MAX_SEGMENTS
from imdim.reconstruction.config import ConfigError, one_line

MESSAGE = 1000  # characters, of what is in a document or a text that was changed by hand


def export_program(source: Path, folder: Path, pick: int | None, segments: int) -> str:
    """Write the files, and say what was written. Raises ConfigError for a file, a pick or a folder that cannot be used.

    Of a results folder it is front.json where there is something to `pick`, else program.json; its names are those of the texts beside it.
    """
    from imdim.delivery.deliver import export
    from imdim.export.edit import check_holes, missing_edges, open_delivered
    from imdim.program import codec, front
    from imdim.program.tree import leaves, longest
    from imdim.target.target import LARGEST

    source = find_document(source, "program.json" if pick is None else "front.json")
    if segments < 3:
        raise ConfigError(f"segments must be at least 3, got {segments}")
    if segments > MAX_SEGMENTS:
        raise ConfigError(f"segments must be at most {MAX_SEGMENTS}, got {segments}")
    with refusing(source):
        document = codec.parse(source.read_bytes())
        if isinstance(document, dict) and document.get("format") == front.FORMAT:
            choices, meta = front.from_json(document)
            number = document.get("picked") or len(choices) if pick is None else pick
            if not 1 <= number <= len(choices):
                raise ConfigError(f"{source}: pick must lie in 1..{len(choices)}, got {number}")
            program, edges, named = choices[number - 1].program, (), None
        elif pick is not None:
            raise ConfigError(f"{source}: holds one program, there is nothing to pick")
        else:
            program, meta, edges = codec.from_json(document), codec.meta_of(document), codec.edges_of(document)
            texts = read_texts(source)
            named = open_delivered(document, texts) if "program.scad" in texts else None
            if named is None:
                check_holes(document, program)
        largest = max(longest(leaves(program)), *(abs(c) for leaf in leaves(program) for c in leaf.center))
        if largest > LARGEST:
            raise ConfigError(f"{source}: a length or a place of {largest:.3g} is beyond {LARGEST:g}")
        files = export(program, folder, meta, segments, edges=edges, named=named)
    return list_files(folder, files) + "".join(f"  {said}\n" for said in missing_edges(program, edges))


def find_document(source: Path, name: str = "program.json") -> Path:
    """The document called `name` of a results folder, which may be named by itself or by one of its texts; else `source` as it is."""
    from imdim.export.delivered import TEXTS

    if source.is_dir():
        return source / name
    beside = source.with_name(name)
    return beside if source.name in TEXTS and beside.is_file() else source


def read_texts(source: Path) -> dict[str, str]:
    """The texts that lie beside a program.json, by their names."""
    from imdim.export.delivered import TEXTS

    return {name: (source.parent / name).read_text(encoding="utf-8") for name in TEXTS if (source.parent / name).is_file()}


@contextmanager
def refusing(source: Path) -> Iterator[None]:
    """Whatever in the block cannot be used or written is a ConfigError of one line, that names `source` where the fault is in there."""
    from imdim.export.folder import OutputError

    try:
        yield
    except (ConfigError, OutputError) as error:
        raise ConfigError(str(error)) from error
    except OSError as error:
        raise ConfigError(f"{source}: {error.strerror}") from error
    except ValueError as error:
        raise ConfigError(f"{source}: {one_line(str(error), MESSAGE)}") from error


def list_files(folder: Path, files: Mapping[str, str]) -> str:
    """A line for each file, with what became of it where it was not written."""
    return "".join(f"  {folder / name}{'' if state == 'written' else '  ' + state}\n" for name, state in files.items())
