"""A client without a language model repairs seeded mistakes through the tools of `imdim mcp` alone.

    python scripts/agent/repair.py [--only "a missed hole"]

It is not told what is wrong. It compares sizes, removes what explains nothing, adds what the left-out regions look like, moves the numbers
that bring the program nearer, and undoes what does not help. What it exports is judged here: by the exact IoU with the true part, and by
whether it has the names that the true program has, with their values, and no primitives more. The exit status is 0 where at least 8 of 10
are repaired.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from mcp import ClientSession, StdioServerParameters
from mcp.client.stdio import stdio_client
from mistakes import INCH, MISTAKES, SeededMistake

from imdim.app.edit import open_results
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.tree import leaves

BAR, ENOUGH = 0.8, 0.9999  # share of the mistakes; IoU from which a part is repaired
SAME_NAME = 1e-3  # of a value, by which a named number may differ
ALIKE = 1e-3  # of a ratio of lengths
BETTER = 2e-6  # IoU, by which a step helps
PROBE = 0.06  # of a number, or of the part's size, by which it is moved to see what helps
GOLDEN = 0.381966
NARROWINGS = 14
MOST_ROUNDS = 4
SPOKEN_UNITS = (INCH, 1 / INCH, 10.0, 0.1, 1000.0, 1e-3)
BEYOND = 1.0  # length by which a cut goes beyond the region that it is for, at either end
EXPLAINS_NOTHING = 2e-3  # share of the surface
TURNS = {"z": [0.0, 0.0, 0.0], "x": [0.0, 90.0, 0.0], "y": [90.0, 0.0, 0.0]}


class Refused(Exception):
    """The server said no, in one line."""


class Client:
    """The tools, and what one wants of them here."""

    def __init__(self, session: ClientSession) -> None:
        self._session, self.calls = session, 0

    async def call(self, name: str, **arguments: Any) -> dict[str, Any]:
        """The answer of a tool; raises Refused."""
        self.calls += 1
        answer = await self._session.call_tool(name, arguments)
        text = answer.content[0].text  # type: ignore[union-attr]
        if answer.isError:
            assert "\n" not in text, text
            raise Refused(text)
        return json.loads(text)

    async def try_step(self, name: str, **arguments: Any) -> float:
        """The IoU that a step would give, which is taken back; -1 where it is refused."""
        try:
            answer = await self.call(name, **arguments)
        except Refused:
            return -1.0
        await self.call("undo")
        return answer["iou"] or 0.0

    async def iou(self) -> float:
        return (await self.call("measure"))["iou"]


async def repair(client: Client) -> None:
    """Whatever is wrong with the program that is open."""
    await _convert_units(client)
    for _ in range(MOST_ROUNDS):
        if await client.iou() >= ENOUGH:
            break
        if not (await _remove_extra(client) or await _extend(client) or await _add_missing(client) or await _move_number(client)):
            break
    await _remove_idle(client)
    await _tie_alike(client)
    await _relate(client)


async def _convert_units(client: Client) -> None:
    """A program that is as many times too small along all axes as one unit is of another."""
    status = await client.call("status")
    ratios = [part / size for part, size in zip(status["part_size"], status["size"], strict=True)]
    for factor in SPOKEN_UNITS:
        if all(abs(ratio / factor - 1) < ALIKE for ratio in ratios):
            await client.call("scale", factor=factor)


async def _remove_extra(client: Client) -> bool:
    """A feature that explains nothing and lies off the part."""
    before, features = await client.iou(), (await client.call("features"))["features"]
    measured = await client.call("measure")
    idle = [f for f in features if f["explains"] < EXPLAINS_NOTHING and f["off_max"] > 2 * measured["tolerance"] and len(features) > 1]
    for feature in idle:
        if await client.try_step("remove", ids=[feature["id"]]) > before + BETTER:
            await client.call("remove", ids=[feature["id"]])
            return True
    return False


async def _remove_idle(client: Client) -> None:
    """Features without which the program is as near, the first ones first: what was added may say more."""
    while True:
        before, count = await client.iou(), (await client.call("status"))["features"]
        for i in range(count if count > 1 else 0):
            if await client.try_step("remove", ids=[i]) >= before - BETTER:
                await client.call("remove", ids=[i])
                break
        else:
            return


async def _extend(client: Client) -> bool:
    """A feature beside the largest left-out region that need only be longer or thicker, after which nothing is left to do."""
    regions = [r for r in (await client.call("measure"))["regions"] if r["verdict"] == "left out"]
    if not regions:
        return False
    low, high = regions[0]["low"], regions[0]["high"]
    beside = {int(i) for i in (await client.call("explain", low=low, high=high))["features"]}
    if not await _move_number(client, beside):
        return False
    if await client.iou() >= ENOUGH:
        return True
    await client.call("undo")
    return False


async def _add_missing(client: Client) -> bool:
    """What the boxes of the left-out regions may be: a box or a cylinder along an axis, added or cut; the one that makes up for most."""
    measured = await client.call("measure")
    best: tuple[float, dict[str, Any]] = (measured["iou"], {})
    for region in [r for r in measured["regions"] if r["verdict"] == "left out"]:
        there = await client.call("explain", low=region["low"], high=region["high"])
        if there["inside_part"] == there["inside_program"]:
            continue
        does = "add" if there["inside_part"] else "cut"
        for feature in _shapes(region["low"], region["high"], BEYOND if does == "cut" else 0.0):
            best = max(
                best, (await client.try_step("add", does=does, feature=feature), {"does": does, "feature": feature}), key=lambda c: c[0]
            )
    # a number that is off a little leaves regions out too: what is missing is what an addition makes up for nearly whole
    if 1 - best[0] > 0.2 * (1 - measured["iou"]) or not best[1]:
        return False
    await client.call("add", **best[1])
    return True


def _shapes(low: Sequence[float], high: Sequence[float], beyond: float) -> Iterator[dict[str, Any]]:
    """Features with about that box; those that cut end `beyond` it along their axis."""
    size, center = [b - a for a, b in zip(low, high, strict=True)], [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    if min(size) <= 0:
        return
    for axis, rotation in TURNS.items():
        along = "xyz".index(axis)
        wide = max(size[a] for a in range(3) if a != along)
        yield {"kind": "cylinder", "size": {"r": round(wide / 2, 3), "h": size[along] + 2 * beyond}, "center": center, "rotation": rotation}
    yield {"kind": "box", "size": dict(zip(("sx", "sy", "sz"), size, strict=True)), "center": center}


async def _move_number(client: Client, chosen: set[int] | None = None) -> bool:
    """The number whose change helps most, of those with names and of features that lie off the part; or of the `chosen` features."""
    before, length = await client.iou(), max((await client.call("status"))["part_size"])
    numbers = [(row["name"], row["value"], abs(row["value"])) for row in (await client.call("parameters"))["parameters"] if chosen is None]
    features = [f for f in (await client.call("features"))["features"] if chosen is None or f["id"] in chosen]
    tolerance = (await client.call("measure"))["tolerance"] if chosen is None else -1.0
    for feature in [f for f in features if f["off_max"] > tolerance and f["kind"] not in ("fillet", "chamfer")]:
        numbers += [
            (f"{feature['id']}.{n}", v, length if n in "xyz" else v)
            for n, v in feature["numbers"].items()
            if n not in ("rx", "ry", "rz", "angle")
        ]
    probes: list[tuple[float, str, float, float]] = []
    for name, value, scale in numbers:
        for step in (PROBE * scale, -PROBE * scale):
            # a peak may lie within the step: the half of it is nearer then
            for share in (1.0, 0.3):
                probes.append((await client.try_step("set", values={name: value + share * step}), name, value, share * step))
    best: tuple[float, str, float] = (before, "", 0.0)
    # places come by two or three: what helps along one axis may help little until the other follows
    for _, name, value, step in sorted(probes, reverse=True)[:3]:
        found, at = await _climb(client, name, value, step)
        best = max(best, (found, name, at))
    if best[0] <= before + BETTER:
        return False
    await client.call("set", values={best[1]: best[2]})
    return True


async def _climb(client: Client, name: str, value: float, step: float) -> tuple[float, float]:
    """The best IoU on the way from `value` by steps of `step`, by golden section (Kiefer 1953), and the roundest number there."""

    async def at(x: float) -> float:
        return await client.try_step("set", values={name: x})

    low, middle = value, value + step
    held, ahead = await at(middle), await at(middle + step)
    while ahead > held:
        low, middle, held = middle, middle + step, ahead
        ahead = await at(middle + step)
    high = middle + step
    for _ in range(NARROWINGS):
        far = high if abs(high - middle) > abs(middle - low) else low
        probe = middle + GOLDEN * (far - middle)
        found = await at(probe)
        if found > held:
            low, middle, high, held = (middle, probe, high, found) if far == high else (low, probe, middle, found)
        elif far == high:
            high = probe
        else:
            low = probe
    for decimals in range(4):
        near = round(middle, decimals)
        if abs(near - middle) <= 1.5 * abs(high - low) + 0.5 * 10.0**-decimals and (rounder := await at(near)) >= held - BETTER:
            return rounder, near
    return held, middle


async def _tie_alike(client: Client) -> None:
    """Names that differ by a number alone, and have one value."""
    rows = {row["name"]: row["value"] for row in (await client.call("parameters"))["parameters"]}
    groups: dict[tuple[str, float], list[str]] = {}
    for name, value in rows.items():
        if "spacing" not in name:
            groups.setdefault(("".join(c for c in name if not c.isdigit()).rstrip("_"), value), []).append(name)
    for names in groups.values():
        if len(names) > 1:
            try:
                await client.call("tie", names=names)
            except Refused:
                continue


async def _relate(client: Client) -> None:
    """Relations and repeats found anew, where that costs nothing."""
    before = await client.iou()
    try:
        after = await client.call("relate")
    except Refused:
        return
    if after["iou"] < before - BETTER:
        await client.call("undo")


def judge(mistake: SeededMistake, folder: Path) -> tuple[float, list[str]]:
    """The IoU of the exported program with the true one, and what is not as there: true names that it does not have with their values, and
    primitives more than it needs."""
    delivered = open_results(folder / "program.json")
    has: Mapping[str, float] = {**delivered.values, **delivered.counts}
    # of two places that mirror each other a name has that of the first, which may be either
    lost = [n for n, v in mistake.names().items() if n not in has or abs(abs(has[n]) - abs(v)) > SAME_NAME * max(abs(v), 1.0)]
    more = sum(1 for _ in leaves(delivered.program)) - sum(1 for _ in leaves(mistake.true))
    wrong = [f"without {name}" for name in lost] + ([f"{more} primitives more"] if more > 0 else [])
    return volume_iou(to_manifold(mistake.true), to_manifold(delivered.program)), wrong


@asynccontextmanager
async def connect(folder: Path):
    """A client of a server of its own."""
    server = StdioServerParameters(command=sys.executable, args=["-m", "imdim.app.cli", "mcp", str(folder)], env=dict(os.environ))
    async with stdio_client(server, sys.__stderr__ or sys.stderr) as streams, ClientSession(*streams) as session:
        await session.initialize()
        yield Client(session)


async def run(names: Sequence[str]) -> int:
    """How many of the mistakes are repaired."""
    repaired = 0
    print(f"{'mistake':<20} {'before':>9} {'after':>9}  calls  seconds  names")
    for name in names:
        with tempfile.TemporaryDirectory() as place:
            folder, start = Path(place), time.perf_counter()
            MISTAKES[name].write(folder)
            async with connect(folder) as client:
                await client.call("open", path="part.stl")
                await client.call("open", path="results")
                before = await client.iou()
                await repair(client)
                await client.call("export", folder="repaired")
                calls = client.calls
            iou, wrong = judge(MISTAKES[name], folder / "repaired")
        repaired += iou >= ENOUGH and not wrong
        said = ", ".join(wrong) or "all"
        print(f"{name:<20} {before:9.6f} {iou:9.6f}  {calls:5d}  {time.perf_counter() - start:7.1f}  {said}", flush=True)
    print(f"{repaired} of {len(names)} repaired")
    return repaired


def main() -> int:
    parser = argparse.ArgumentParser(description="Repair seeded mistakes through the tools of imdim mcp.")
    parser.add_argument("--only", action="append", choices=list(MISTAKES), help="this mistake alone; may be repeated")
    names = parser.parse_args().only or list(MISTAKES)
    return 0 if asyncio.run(run(names)) >= BAR * len(names) else 1


if __name__ == "__main__":
    sys.exit(main())
