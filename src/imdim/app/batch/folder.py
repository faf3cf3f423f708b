"""The folder of a batch: what was asked for, and one folder per finished part that appears in one step.

A part is worked on under ``.running``; when it has ended, well or not, its folder with results, log and ``outcome.json`` moves to
``parts``. So a folder there is a part that is done, and a killed batch loses only what was running.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_type_hints

from imdim.reconstruction.config import ConfigError
from imdim.whole_file import write_text_whole

PARTS, RUNNING, NOTE, LOCK = "parts", ".running", "batch.json", ".lock"
BEGUN = (LOCK, f".{NOTE}.part")  # what there is before the note
OUTCOME, LOG = "outcome.json", "fit.log"
LONGEST_NAME = 120  # bytes; file systems allow 255, and files are written beside with longer names
FORMAT, VERSION = "imdim-batch", 1


@dataclass(frozen=True)
class Part:
    """A file to reconstruct: `digest` is that of its content, `name` that of its folder, unlike any other's."""

    name: str
    source: Path
    digest: str


@dataclass(frozen=True)
class Outcome:
    """One part's record. `failure` is empty or one line that says why there is no result; distances are relative to the diagonal.

    `curves` are those of outlines, None where the program has none; its `primitives` are features then. `exact` and `left_out` are shares
    of the part's surface.
    """

    part: str
    input: str
    digest: str
    failure: str = ""
    primitives: int | None = None
    volume_iou: float | None = None
    mean_distance: float | None = None
    stop: str = ""
    seconds: float = 0.0
    peak_mib: float = 0.0
    curves: int | None = None
    exact: float | None = None
    left_out: float | None = None


_KINDS = {name: (int, float) if kind is float else kind | int for name, kind in get_type_hints(Outcome).items()}


def find_parts(source: Path, suffixes: Sequence[str]) -> list[Part]:
    """The files of a folder with these suffixes, hidden ones left out, by name. Raises ConfigError where there is none."""
    try:
        entries = sorted(source.iterdir())
    except OSError as error:
        raise ConfigError(f"{to_line(source)}: {error.strerror}") from error
    files = [path.absolute() for path in entries if path.suffix.lower() in suffixes and not path.name.startswith(".") and path.is_file()]
    if not files:
        raise ConfigError(f"{to_line(source)}: 0 model files among {len(entries)} entries; known are {', '.join(suffixes)}")
    stems = [path.stem.casefold() for path in files]
    return [Part(_short(p.stem if stems.count(s) == 1 else p.name), p, _digest(p)) for p, s in zip(files, stems, strict=True)]


def to_line(text: object) -> str:
    """A name as one line of valid Unicode: file names may hold line ends and bytes that are no text."""
    plain = str(text).encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in plain)


@contextmanager
def open_batch(out: Path, settings: Mapping[str, Any]) -> Iterator[None]:
    """Claim `out` for a batch with these settings while the block runs, rid of what an earlier run left half done.

    Raises ConfigError where it cannot be written, holds something else, was begun with other settings or is in use.
    """
    try:
        _check_ours(out)
        out.mkdir(parents=True, exist_ok=True)
        with (out / LOCK).open("w") as lock:
            _hold(lock.fileno(), out)
            _claim(out / NOTE, settings)
            with running(out):
                yield
    except OSError as error:
        raise ConfigError(f"output folder {to_line(out)} cannot be written: {error.strerror}") from error


@contextmanager
def hold_folder(out: Path) -> Iterator[None]:
    """Claim the folder `out` itself while the block runs, without a file for that. Raises ConfigError where it is in use, OSError."""
    out.mkdir(parents=True, exist_ok=True)
    lock = os.open(out, os.O_RDONLY)
    try:
        _hold(lock, out)
        with running(out):
            yield
    finally:
        os.close(lock)


@contextmanager
def running(out: Path) -> Iterator[None]:
    """An empty folder for what runs, gone when the block is left."""
    shutil.rmtree(out / RUNNING, ignore_errors=True)
    (out / RUNNING).mkdir()
    try:
        yield
    finally:
        shutil.rmtree(out / RUNNING, ignore_errors=True)


def read_finished(place: Path, parts: Sequence[Part], again: bool) -> dict[str, Outcome]:
    """The outcomes of parts in the folder `place`, by name; with `again` not of failures, and of none whose content has changed."""
    found = {part.name: _read(place / part.name / OUTCOME) for part in parts}
    return {
        part.name: outcome
        for part in parts
        if (outcome := found[part.name]) and (outcome.part, outcome.digest) == (part.name, part.digest) and not (again and outcome.failure)
    }


def staging(out: Path, part: Part) -> Path:
    """A new folder to run a part in: its results go to ``parts/<name>`` there, its log beside them."""
    folder = out / RUNNING / hashlib.sha256(os.fsencode(part.name)).hexdigest()[:16]
    shutil.rmtree(folder, ignore_errors=True)
    (folder / PARTS).mkdir(parents=True)
    return folder


def commit(place: Path, folder: Path, outcome: Outcome) -> None:
    """Put results, log and record of a part into the folder `place` in one step, instead of older ones."""
    ready, there = folder / PARTS / outcome.part, place / outcome.part
    place.mkdir(exist_ok=True)
    if outcome.failure:
        shutil.rmtree(ready, ignore_errors=True)
    ready.mkdir(exist_ok=True)
    if (folder / LOG).exists():
        (folder / LOG).rename(ready / LOG)
    write_text_whole(ready / OUTCOME, json.dumps(asdict(outcome), indent=1) + "\n")
    if there.exists():
        there.rename(folder / "earlier")
    ready.rename(there)
    shutil.rmtree(folder, ignore_errors=True)


def outcome_of(part: Part, folder: Path, seconds: float, peak_mib: float, why: str) -> Outcome:
    """The record of a part that ended with `why` (empty: well), from the report that it wrote in `folder`."""
    found: dict[str, Any] = {"failure": why.removeprefix("imdim: ")}
    if not why:
        try:
            found = _scores(json.loads((folder / PARTS / part.name / "report.json").read_text(encoding="utf-8")))
        except (OSError, ValueError, KeyError, TypeError) as error:
            found = {"failure": f"no readable report: {type(error).__name__} {error}".splitlines()[0]}
    return Outcome(part.name, part.source.name, part.digest, seconds=round(seconds, 2), peak_mib=round(peak_mib), **found)


def _scores(report: Mapping[str, Any]) -> dict[str, Any]:
    scores = report["scores"]
    return {
        "primitives": report["result"]["primitives"],
        "curves": report["result"].get("curves"),
        "volume_iou": scores["volume_iou"],
        "mean_distance": scores["distance_relative_to_diagonal"]["target_to_result"]["mean"],
        "stop": report["stop"],
        **({"exact": shares["exact"], "left_out": shares["left out"]} if (shares := report.get("verdict", {}).get("shares")) else {}),
    }


def _read(path: Path) -> Outcome | None:
    """What `commit` wrote, None where that is missing or no such record."""
    try:
        outcome = Outcome(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
    return outcome if all(isinstance(getattr(outcome, name), kind) for name, kind in _KINDS.items()) else None


def _short(name: str) -> str:
    data = os.fsencode(name)
    if len(data) <= LONGEST_NAME:
        return name
    return os.fsdecode(data[: LONGEST_NAME - 17]) + "-" + hashlib.sha256(data).hexdigest()[:16]


def _digest(path: Path) -> str:
    """SHA-256 of a file, empty where it cannot be read: then the part fails, not the batch."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def _check_ours(out: Path) -> None:
    if out.is_dir() and not (out / NOTE).is_file() and (foreign := sorted(p.name for p in out.iterdir() if p.name not in BEGUN)):
        raise ConfigError(f"output folder {to_line(out)} holds {to_line(foreign[0])} and no {NOTE}: give another folder")


def _hold(lock: int, out: Path) -> None:
    """Released by the system when this process ends, however it does."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise ConfigError(f"output folder {to_line(out)} is in use by another batch") from error


def _claim(note: Path, settings: Mapping[str, Any]) -> None:
    """Note the settings that decide the results, or compare with those noted."""
    wanted = {"format": FORMAT, "version": VERSION, "settings": dict(settings)}
    if not note.exists():
        write_text_whole(note, json.dumps(wanted, indent=1) + "\n")
        return
    try:
        noted = json.loads(note.read_text(encoding="utf-8"))
        before = noted["settings"]
        other = [f"{key}={before.get(key)} then, {key}={value} now" for key, value in settings.items() if before.get(key) != value]
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"{to_line(note)}: not the note of a batch") from error
    if other:
        raise ConfigError(f"{to_line(note.parent)} was begun with other settings ({'; '.join(other)}): give another folder")
