"""What the tools answer: small values of plain numbers and words. Lengths are in the part's units, places and boxes in x, y, z."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

DIGITS = 6


def shorten(value: float) -> float:
    """A number as an answer says it."""
    return float(f"{value:.{DIGITS}g}") + 0.0


def shorten_all(values: Iterable[float]) -> list[float]:
    """Numbers as an answer says them."""
    return [shorten(value) for value in values]


@dataclass(frozen=True)
class StatusReply:
    """`part` is what is measured against, `size` the box of the program along x, y, z, `notes` what reading the part said. `undo` and
    `redo` are steps that can be taken back and again, `files` the meshes, clouds and results folders that can be opened."""

    folder: str
    part: str
    part_size: list[float]
    program: str
    features: int
    size: list[float]
    volume: float | None
    undo: list[str]
    redo: list[str]
    locked: list[str]
    notes: list[str] = field(default_factory=list)
    files: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class FitReply:
    """`stop` says why the search ended; `iou` is None where the part bounds no solid."""

    stop: str
    seconds: float
    features: int
    iou: float | None
    names: list[str]
    notes: list[str]


@dataclass(frozen=True)
class FeatureReply:
    """One feature. `id` counts primitives as `imdim edit --list` and the lab do, fillets and chamfers after them; `does` is "add", "cut",
    "clip" or "blend". `explains` is the share of the part's surface that it made, None without a part; `off_mean` and `off_max` are how far
    its own surface lies from the part."""

    id: int
    name: str
    kind: str
    does: str
    numbers: dict[str, float]
    explains: float | None = None
    off_mean: float | None = None
    off_max: float | None = None


@dataclass(frozen=True)
class FeaturesReply:
    """`holes` are groups of equal ones in words, with the ids of their features."""

    features: list[FeatureReply]
    holes: list[str]
    relations: list[str]


@dataclass(frozen=True)
class RegionReply:
    """A piece of the part's surface that the program does not have exactly; `low` and `high` are the corners of its box."""

    verdict: str
    what: str
    where: str
    share: float
    furthest: float
    low: list[float]
    high: list[float]


@dataclass(frozen=True)
class ExplainReply:
    """Which features are there, the nearest or largest first, as id and share, and how far the region is from the program's surface.

    `verdict` is exact, approximated or left out, as most of the region is, and empty where the part has no surface there. `inside` says
    whether the region's middle is in the part's material, and in the program's."""

    features: dict[int, float]
    names: list[str]
    verdict: str
    furthest: float | None
    inside_part: bool | None
    inside_program: bool
    regions: list[RegionReply]


@dataclass(frozen=True)
class ParameterReply:
    """`ties` are the features whose sizes share the name, where there are several."""

    name: str
    value: float
    meaning: str
    ties: list[int]
    locked: bool


@dataclass(frozen=True)
class ParametersReply:
    """The names that `set` takes."""

    parameters: list[ParameterReply]


@dataclass(frozen=True)
class ChangeReply:
    """What a step did. `kind` says which bodies, through-holes or voids came or went, empty where none did; `names` are those that are new,
    `gone` those that are no more."""

    step: str
    size: list[float]
    volume_before: float
    volume: float
    kind: str
    iou_before: float | None
    iou: float | None
    names: dict[str, float]
    gone: list[str]
    notes: list[str]


@dataclass(frozen=True)
class MeasureReply:
    """`verdict` is exact, approximated or left out, of a cloud also partial or not explained, with the `doubts` that say why; `shares` are
    of the surface. Distances go from the part to the program and back."""

    iou: float | None
    iou_missing: str
    verdict: str
    shares: dict[str, float]
    tolerance: float
    to_program_mean: float
    to_program_max: float
    to_part_mean: float
    to_part_max: float
    regions: list[RegionReply]
    doubts: list[str]


@dataclass(frozen=True)
class UndoReply:
    """The step that was taken back, or done again."""

    step: str
    features: int
    iou: float | None


@dataclass(frozen=True)
class ExportReply:
    """What became of each file of a results folder."""

    folder: str
    files: Mapping[str, str]


@dataclass(frozen=True)
class StopReply:
    """Whether a fit was going on."""

    stopped: bool
