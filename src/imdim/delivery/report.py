"""report.json: what was measured over the delivered files, and how they came about.

All that depends on the clock is under ``timing``, so that the rest repeats byte for byte with the same input, settings and versions.
"""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from imdim.delivery.coverage import Coverage, describe_coverage
from imdim.delivery.evaluate import DeliveryLoss, Distances, Scores
from imdim.delivery.explanation import Explanation
from imdim.delivery.finish import FinishedProgram
from imdim.delivery.intervals import StatedInterval
from imdim.delivery.verdict import JudgedRegion, SurfaceVerdict, describe_shares
from imdim.detection.noise import MeasuredNoise
from imdim.export.feature_roles import MOST_NAMED
from imdim.export.hole_names import hole_groups
from imdim.export.inches import inch_fractions
from imdim.geometry.holes import MOST_WALLS, count_walls
from imdim.program.cost import count
from imdim.program.edges import EdgeFeature, describe_edges
from imdim.program.hole_groups import HoleGroup
from imdim.program.metric import screw_of
from imdim.program.repeats import Folded, Repeat, copies_of, repeats, size
from imdim.program.tree import leaves, longest
from imdim.reconstruction.edge_features import MeasuredSizes
from imdim.target.target import Target

FORMAT, VERSION = "imdim-report", 1

PACKAGES = ("imdim", "numpy", "scipy", "numba", "torch", "trimesh", "manifold3d", "cadquery-ocp-novtk")


@dataclass(frozen=True)
class RunRecord:
    """How a program was found: the input as given, seconds per stage, why it stopped, the seed, and the settings as plain values.

    `proof` says whether it was proved minimal, and why not; it is empty where the method does not ask. `noisy` is whether its numbers are
    measured off a noisy cloud or scan, rather than exact, and `noise` what was measured of the target, None where nobody did.
    `edge_sizes` are what a cloud says of the sizes of each edge feature.
    """

    input: str
    stages: Mapping[str, float]
    stop: str
    seed: int
    settings: Mapping[str, Any] = field(default_factory=dict)
    proof: str = ""
    noisy: bool = False
    noise: MeasuredNoise | None = None
    edge_sizes: tuple[MeasuredSizes, ...] = ()


def report_of(
    delivered: FinishedProgram,
    target: Target,
    scores: Scores,
    kept: DeliveryLoss,
    verdict: SurfaceVerdict,
    volumes: Mapping[str, float],
    files: Mapping[str, str],
    run: RunRecord,
    delivery: Mapping[str, float],
    drawn: bool = True,
    left_out: Sequence[str] = (),
    intervals: Mapping[str, StatedInterval] | None = None,
    coverage: Coverage | None = None,
) -> dict[str, Any]:
    """The report as plain values; lengths in model units, `volumes` per file in cubed ones, `delivery` in seconds per step; `drawn` says
    whether program.scad draws the edges, and `left_out`, a sentence each, what the program lacks. `intervals` are
    those of the names of a program that is measured off a noisy cloud, and `coverage` is what a cloud shows of the result."""
    program, constraints, folded = delivered.program, delivered.constraints, delivered.folded
    counts, named = count(program), delivered.parameters
    return {
        "format": FORMAT,
        "version": VERSION,
        "input": run.input,
        "target": _target(target, scores),
        "result": {
            "primitives": counts.primitives,
            "operations": counts.operations,
            "without_copies": counts.primitives if folded is None else len(copies_of(folded)),
            **counts.drawn,
            **({"free_numbers": sum(named.free_numbers(longest(leaves(program))))} if counts.drawn else {}),
            "kinds": {kind: n for kind, n in counts.kinds.items() if n},
            "ops": {op: n for op, n in counts.ops.items() if n},
        },
        "features": [line for lines in named.notes.values() for line in lines],
        "repeats": [] if folded is None else _repeats(folded, delivered.labels),
        "holes": [_group(group) for group in hole_groups(program)],
        "edges": [_edge_feature(feature) for feature in delivered.edges],
        "edges_drawn": drawn if delivered.edges else None,
        "left_out": [*left_out, *_left_out(delivered)],
        "constraints": [{"name": c.name, "kind": c.kind, "says": str(c)} for c in constraints],
        "parameters": {name: number(value) for name, value in named.values.items()},
        **({"inches": fractions} if (fractions := inch_fractions(named)) else {}),
        **({} if intervals is None else {"intervals": {name: _interval(interval) for name, interval in intervals.items()}}),
        "scores": _scores(scores),
        "verdict": _verdict(verdict),
        **({} if coverage is None else {"coverage": _coverage(coverage)}),
        "found": {"volume_iou": number(kept.found), "iou_with_delivered": number(kept.delivered)},
        "volumes": {name: number(volume) for name, volume in volumes.items()},
        "stop": run.stop,
        "proof": run.proof or None,
        "seed": run.seed,
        "settings": dict(run.settings),
        "files": dict(files),
        "versions": _versions(),
        "timing": {
            "stages_s": {stage: round(seconds, 3) for stage, seconds in run.stages.items()},
            "delivery_s": {step: round(seconds, 3) for step, seconds in delivery.items()},
            "total_s": round(sum(run.stages.values()) + sum(delivery.values()), 3),
        },
    }


def _repeats(folded: Folded, label: Sequence[str]) -> list[dict[str, Any]]:
    """What each repeat says; `leaves` are the primitives of one copy, `first` the number of the first of them in `program.json`."""
    return [
        {
            "says": describe_repeat(repeat, label[first]),
            "kind": repeat.kind,
            "counts": list(repeat.counts),
            "leaves": size(repeat.part),
            "first": first,
        }
        for first, repeat in repeats(folded)
    ]


def _left_out(delivered: FinishedProgram) -> Iterator[str]:
    """What a program is too long for, a sentence each."""
    walls, primitives = count_walls(delivered.program), count(delivered.program).primitives
    if walls > MOST_WALLS:
        yield f"holes were not looked for: {walls} round walls, more than {MOST_WALLS}"
    if primitives > MOST_NAMED:
        yield f"sizes have no names: {primitives} primitives, more than {MOST_NAMED}"
    elif delivered.hurried:
        yield f"sizes have no names: no time was left for those of {primitives} primitives"


def _edge_feature(feature: EdgeFeature) -> dict[str, Any]:
    """What an edge feature says; `names` are those of its sizes."""
    sizes = [number(size) for size in feature.sizes]
    return {
        "says": describe_edges(feature),
        "kind": feature.kind,
        "names": list(feature.size_names),
        "sizes": sizes,
        "edges": len(feature.edges),
    }


def _group(group: HoleGroup) -> dict[str, Any]:
    """What a group of holes says; `leaves` are the primitives that make it, as `program.json` counts them."""
    hole, screw = group.holes[0], screw_of(group.holes[0])
    return {
        "says": str(group),
        "kind": hole.kind,
        "through": hole.through,
        "diameters": [number(d) for d in hole.diameters],
        "depth": number(hole.depth),
        "screw": None if screw is None else screw._asdict(),
        "arrangement": group.arrangement or None,
        "points": [[number(c) for c in h.point] for h in group.holes],
        "direction": [number(c) for c in hole.direction],
        "leaves": list(group.leaves),
    }


PLURALS = {"tooth": "teeth"}  # of the words for features, those that are not regular


def describe_repeat(repeat: Repeat, label: str) -> str:
    """In words: "12 holes as a 3 x 4 grid"."""
    own = size(repeat.part)
    word = label.rstrip("0123456789").replace("_", " ")
    what = (
        f"{repeat.number} {PLURALS.get(word, f'{word}es' if word.endswith('s') else f'{word}s')}"
        if own == 1
        else f"{repeat.number} groups of {own} primitives"
    )
    counts = " x ".join(map(str, repeat.counts))
    how = {
        "linear": "in a row",
        "grid": f"as a {counts} grid",
        "circular": "on a circle" if repeat.is_full else f"on a circle, {number(repeat.angle)} degrees apart",
        "mirror": "as mirror images",
    }
    return f"{what} {how[repeat.kind]}" + (", what they have in common" if repeat.join == "intersection" else "")


def dumps(report: Mapping[str, Any]) -> str:
    """The report's text; raises ValueError for numbers that JSON does not know."""
    return json.dumps(report, indent=2, allow_nan=False, ensure_ascii=False, default=str) + "\n"


def number(value: float | None) -> float | None:
    """Nine significant digits; None for what is missing or infinite, which JSON cannot say."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.9g}")


def _target(target: Target, scores: Scores) -> dict[str, Any]:
    kind = "cloud" if target.mesh is None else "solid" if target.is_solid else "open mesh"
    faces = None if target.mesh is None else len(target.mesh.faces)
    return {
        "name": target.name,
        "kind": kind,
        "points": len(target.points),
        "faces": faces,
        "units": target.units,
        "diagonal": number(scores.diagonal),
        "notes": list(target.notes),
    }


def _interval(interval: StatedInterval) -> dict[str, Any]:
    return {
        "says": str(interval),
        "value": number(interval.value),
        "measured": number(interval.measured),
        "half": number(interval.half),
        "snapped": interval.snapped,
    }


def _scores(scores: Scores) -> dict[str, Any]:
    both = {"target_to_result": scores.to_result, "result_to_target": scores.to_target}
    return {
        "volume_iou": number(scores.volume_iou),
        **({} if scores.iou_missing is None else {"volume_iou_missing": scores.iou_missing}),
        "distance": {way: _distances(distances) for way, distances in both.items()},
        "distance_relative_to_diagonal": {way: _distances(scores.relative(distances)) for way, distances in both.items()},
    }


def _verdict(verdict: SurfaceVerdict) -> dict[str, Any]:
    """What became of the target's surface, shares of 1, and what speaks against the program of a cloud or a scan; `regions` are those that
    are not exact, the largest first."""
    explanation = verdict.explanation
    return {
        "overall": verdict.overall,
        "says": describe_shares(verdict),
        "shares": {name: number(share) for name, share in verdict.shares.items()},
        "tolerance": number(verdict.tolerance),
        "doubts": list(verdict.doubts),
        **({} if explanation is None else {"explanation": _explanation(explanation)}),
        **({} if verdict.borne_out is None else {"borne_out": number(verdict.borne_out)}),
        "regions": [_region(region) for region in verdict.regions],
    }


def _coverage(coverage: Coverage) -> dict[str, Any]:
    """What a cloud shows of the result's surface, shares of 1; `regions` are those that are not seen, the largest first."""
    return {
        "says": describe_coverage(coverage),
        "shares": {name: number(share) for name, share in coverage.shares.items()},
        "inferred_by": {reason: number(share) for reason, share in coverage.by.items()},
        "regions": [
            {"coverage": r.coverage, "by": r.by or None, "share": number(r.share), "what": r.what, "where": r.where}
            for r in coverage.regions
        ],
    }


def _explanation(explanation: Explanation) -> dict[str, Any]:
    """How the program explains a cloud: nats per point, and shares of its own surface."""
    told = {name: getattr(explanation, name) for name in ("gain", "shown_gain", "bare", "unseen", "blurred")}
    return {name: None if value is None else number(value) for name, value in told.items()}


def _region(region: JudgedRegion) -> dict[str, Any]:
    return {
        "what": region.what,
        "where": region.where,
        "verdict": region.verdict,
        "kind": region.kind or None,
        "share": number(region.share),
        "low": [number(c) for c in region.low],
        "high": [number(c) for c in region.high],
        "furthest": number(region.furthest),
    }


def _distances(distances: Distances) -> dict[str, float | None]:
    return {"mean": number(distances.mean), "max": number(distances.max)}


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
