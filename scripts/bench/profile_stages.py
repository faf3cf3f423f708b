"""Where the time of `imdim fit` goes, stage by stage.

    OMP_NUM_THREADS=1 python scripts/bench/profile_stages.py PART... [--budget 60] [--language cad] [--json out.json]

Each part is reconstructed in a process of its own. Seconds, the budget's too, are those of the processor in that process, so that a busy
machine changes nothing; the STEP export is a process beside it and costs here what waiting for it costs. `import` is everything before the
part is read, `detect`, with fillets and chamfers set aside, is taken out of the stage that follows it, delivery is the stages after
`finished`.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from processor import rule_the_clock


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="+", type=Path)
    parser.add_argument("--budget", type=float, default=60.0, metavar="SECONDS")
    parser.add_argument("--language", default="cad", help="as the setting of that name")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(one(args.parts[0], args.budget, args.language)))
        return 0
    found, whole = {}, Counter[str]()
    for part in args.parts:
        command = [sys.executable, __file__, str(part), "--budget", str(args.budget), "--language", args.language, "--one"]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
        found[part.name] = json.loads(done.stdout.splitlines()[-1])
        whole.update(found[part.name])
        print(f"{part.name}: " + told(found[part.name]), flush=True)
    print("all: " + told(whole))
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n")
    return 0


def told(stages: dict[str, float] | Counter[str]) -> str:
    total = sum(stages.values())
    ordered = sorted(stages.items(), key=lambda item: -item[1])
    return f"{total:.1f} s: " + ", ".join(f"{name} {s:.2f} ({100 * s / total:.0f} %)" for name, s in ordered)


def one(part: Path, budget_s: float, language: str) -> dict[str, float]:
    """Stages of one part in this process."""
    rule_the_clock()
    from imdim.app.fit import fit
    from imdim.reconstruction import one_body
    from imdim.reconstruction.config import Settings

    detection, finish = list[float](), time.process_time()

    def timed(look: Callable[..., Any]) -> Callable[..., Any]:
        def run(*args: object) -> Any:
            start = time.process_time()
            try:
                return look(*args)
            finally:
                detection.append(time.process_time() - start)

        return run

    one_body.observe, one_body.set_edges_aside = timed(one_body.observe), timed(one_body.set_edges_aside)
    with tempfile.TemporaryDirectory() as folder:
        report = fit(Settings(input=str(part), output=f"{folder}/out", budget_s=budget_s, language=language))
    timing = report["timing"]
    stages: dict[str, float] = {"import": finish, "detect": sum(detection), **timing["stages_s"], **timing["delivery_s"]}
    first = next(name for name in timing["stages_s"] if name != "loading")
    stages[first] -= sum(detection)
    # what no stage accounts for: late imports, the page's frame
    stages["between"] = time.process_time() - sum(stages.values())
    return stages


if __name__ == "__main__":
    sys.exit(main())
