"""Peers, IMDIM and its ablations on the same parts, with the same scorer and the same cores; one table, in Markdown and CSV.

    python scripts/peers/compare.py FOLDER --scorer score.py [--peers box,voxels,imdim] [--ablate evolution solver]
        [--every 6] --out out/compare

Peers that are packages need ``pip install "imdim[peers]"``. Every entrant is a command of its own for every part, one after another, on one
thread, with a limit of time: what crashes, hangs or answers nothing that can be scored is its recorded failure. The same command continues
a comparison that was stopped; what has a row, a failure too, is not run again (delete its folder for that). `inversecsg.json` in FOLDER
adds the published results that it holds. Without --scorer, this project's own evaluation judges. IMDIM has the six
primitives alone, as InverseCSG and the people had who wrote the references. With `--clock processor` budgets and
seconds are of the processor, which other work on the machine changes little, and nothing is ended before `BUSY` times its limit.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NoReturn

sys.path.append(str(Path(__file__).parents[1] / "bench"))  # the benches' parts and clock serve here too
from benchmark import BUSY, CLOCKED, find_parts, read_reference
from benchmark_part import sample, score
from compare_peers import PEERS, missing
from compare_table import Row, text, write_csv
from processor import CLOCKS, children_s

from imdim.app.batch.process import ProcessLimits, run
from imdim.app.batch.run import COMMAND, GRACE_S
from imdim.reconstruction.config import ConfigError
from imdim.target.scan import parse_condition

OWN: dict[str, list[str]] = {"stump-net": ["method=stump-net"], "imdim": []}
LANGUAGE = "language=csg"  # of the references too: primitives are compared with primitives
ABLATIONS = {"policy": "checkpoint=none", "evolution": "evolution=false", "synthesis": "synthesis=false", "solver": "solver=false"}
PUBLISHED = ("InverseCSG (published)", "inversecsg.json")
ANSWERS = ("program.scad", "solid.off")


@dataclass(frozen=True)
class Entrant:
    """`command` runs it on one part, with `{target}` and `{folder}` for where they are; it is ended after `limit_s`."""

    name: str
    command: tuple[str, ...]
    limit_s: float


def main() -> None:
    args = _arguments()
    try:
        found = find_parts(args.folder, set(filter(None, args.only.split(","))), set())
    except ConfigError as error:
        _refuse(str(error))
    parts = [part.source for part in found[:: args.every]]
    reference = read_reference(args.folder)
    rows = [row for row in published(args.folder) if row.part in {p.stem for p in parts}]
    for part in parts:
        for entrant in entrants(args):
            row = kept_or_run(entrant, part, args)
            rows.append(replace(row, reference=reference.get(part.stem, {}).get("primitives")))
            print(_line(rows[-1]), flush=True)
    rows.sort(key=lambda row: row.entrant != PUBLISHED[0])
    page = text(
        rows, f"{args.folder.name}, {args.condition}, {len(parts)} parts, budget {args.budget:g} s, limit {args.limit:g} s, {args.clock}"
    )
    (args.out / "table.md").write_text(page)
    write_csv(rows, args.out / "table.csv")
    print("\n" + page)


def entrants(args: argparse.Namespace) -> Iterator[Entrant]:
    """Peers first, then this project's own, then its ablations."""
    for name in args.peers:
        if name in PEERS:
            script = str(Path(__file__).with_name("compare_peers.py"))
            yield Entrant(name, (sys.executable, script, name, "{target}", "{folder}", "--seed", str(args.seed)), args.limit)
    own = {name: settings for name, settings in OWN.items() if name in args.peers}
    own |= {f"imdim without {name}": [ABLATIONS[name]] for name in args.ablate}
    command = COMMAND if args.clock == "wall" else CLOCKED
    for name, settings in own.items():
        given = ("--budget", f"{args.budget:g}", "--seed", str(args.seed), LANGUAGE, *settings)
        yield Entrant(name, (*command, "{target}", "-o", "{folder}", *given), args.budget + GRACE_S)


def kept_or_run(entrant: Entrant, part: Path, args: argparse.Namespace) -> Row:
    """The row that an equal command has left, or a new one."""
    folder = args.out / part.stem / entrant.name.replace(" ", "-")
    asked = {"command": entrant.command, "limit_s": entrant.limit_s, "condition": args.condition, "clock": args.clock}
    kept = folder / "row.json"
    asked = json.loads(json.dumps(asked))
    if kept.is_file() and (found := json.loads(kept.read_text()))["asked"] == asked:
        return Row(**found["row"])
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    source = sample(part, args.condition, args.out / part.stem / "cloud.npy")
    row = compete(entrant, part, source, folder, args.scorer, args.clock)
    kept.write_text(json.dumps({"asked": asked, "row": asdict(row)}))
    return row


def compete(entrant: Entrant, part: Path, source: Path, folder: Path, scorer: Path | None, clock: str = "wall") -> Row:
    """Run and score one entrant on `source`, a mesh or a cloud of `part`; never raises for what the entrant does."""
    row = Row(entrant.name, part.stem)
    result = folder / "result"
    command = [{"{target}": str(source), "{folder}": str(result)}.get(word, word) for word in entrant.command]
    before = children_s()
    ended = run(command, ProcessLimits(entrant.limit_s * (1 if clock == "wall" else BUSY)), folder / "log.txt")
    row.seconds, row.peak_mib, row.failure = ended.seconds if clock == "wall" else children_s() - before, ended.peak_mib, ended.why
    answer = next((result / name for name in ANSWERS if (result / name).is_file()), None)
    if row.failure or answer is None:
        row.failure = row.failure or "no answer"
        return row
    told = json.loads((result / "peer.json").read_text()) if (result / "peer.json").is_file() else {}
    row.note = told.get("note", "")
    try:
        row.iou, row.hausdorff, leaves, _ = score(part, answer, scorer)
    except (ValueError, KeyError, IndexError, subprocess.SubprocessError) as error:
        row.failure = f"not scored: {' '.join(str(error).split())[:200]}"
    else:
        row.parts = told.get("parts", leaves)
    return row


def published(folder: Path) -> list[Row]:
    """The rows of a published study whose results lie beside the parts."""
    name, file = PUBLISHED
    if not (folder / file).is_file():
        return []
    found = json.loads((folder / file).read_text())
    return [Row(name, part, e["iou"], e["hausdorff"], e["primitives"], note="as published") for part, e in found.items() if "iou" in e]


def _line(row: Row) -> str:
    return f"{row.part:<24} {row.entrant:<26} " + (
        f"FAILED: {row.failure}" if row.failure else f"IoU {row.iou:.4f}, {row.parts} primitives"
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scorer", type=Path, help="`python SCORER TARGET PREDICTION` prints one JSON line")
    parser.add_argument("--peers", default=",".join((*PEERS, *OWN)), help="which, joined by commas (default: %(default)s)")
    parser.add_argument("--ablate", nargs="+", choices=list(ABLATIONS), default=[], help="IMDIM without each of these")
    parser.add_argument("--only", default="", help="parts by name, joined by commas")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="every N-th part by name, from the first")
    parser.add_argument("--condition", default="mesh", help="as of scripts/bench/benchmark.py; what is no mesh is for IMDIM alone")
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS", help="of IMDIM's search")
    parser.add_argument("--limit", type=float, default=60.0, metavar="SECONDS", help="of a peer's whole command")
    parser.add_argument("--clock", default="wall", choices=CLOCKS, help="what budgets and seconds are told by (default wall)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    args.peers = list(filter(None, args.peers.split(",")))
    if unknown := [name for name in args.peers if name not in (*PEERS, *OWN)]:
        _refuse(f"no peer named {', '.join(unknown)}; known are {', '.join((*PEERS, *OWN))}")
    if args.every < 1:
        _refuse(f"--every {args.every}: 1 or more is needed")
    if line := missing(args.peers):
        _refuse(line)
    if parse_condition(args.condition) is not None and (meshed := [name for name in args.peers if name in PEERS]):
        _refuse(f"--condition {args.condition}: {', '.join(meshed)} need a mesh, leave them out of --peers")
    args.out.mkdir(parents=True, exist_ok=True)
    return args


def _refuse(line: str) -> NoReturn:
    sys.stderr.write(f"compare.py: {line}\n")
    sys.exit(2)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
