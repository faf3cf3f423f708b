"""Reconstruct random parts under random conditions and settings, and see that each ends with a solid or is refused in one line.

    python scripts/fuzz/fits.py [--cases 200] [--seed 0] [--first 0] [--longest 12]
    python scripts/fuzz/fits.py --case 123           one case again, with its traceback

Case i is a function of i and seed: a random program of one to ten primitives (planted, or leaves of every kind anywhere), as a mesh or as
a cloud (`fit_cases.py` says what is done to it), and a method with its ablations. A case is found where the fit raises anything but a
refusal, where it warns, where its program is no solid, lies elsewhere or is another one once written and read, or where it takes `LATE`
times its budget. Budgets and seconds are those of the processor. A fit that never ends stops the run with a trace of where it was. Exit
status 1 where anything was found.
"""

from __future__ import annotations

import argparse
import faulthandler
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "bench"))  # the benches' parts and clock serve here too
from processor import rule_the_clock

LATE, SLACK_S = 1.5, 6.0  # a stage that was begun may end; loading the policy takes seconds
HANG_S = 600.0  # of the wall clock


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--longest", type=float, default=12.0, metavar="SECONDS", help="the largest budget that is drawn")
    parser.add_argument("--case", type=int)
    args = parser.parse_args()
    rule_the_clock()
    return fuzz(args) if args.case is None else again(args)


def fuzz(args: argparse.Namespace) -> int:
    from fit_cases import drawn, tried

    tally, slowest = Counter[str](), 0.0
    for i in range(args.first, args.first + args.cases):
        case = drawn(args.seed, i, args.longest)
        budget = case.settings.budget_s
        faulthandler.dump_traceback_later(HANG_S, exit=True)
        start = time.perf_counter()
        outcome = tried(case)
        seconds = time.perf_counter() - start
        faulthandler.cancel_dump_traceback_later()
        if seconds > LATE * budget + SLACK_S and not outcome.startswith("FOUND"):
            outcome = f"FOUND: late, {outcome}"
        tally[outcome.split(":")[0]] += 1
        slowest = max(slowest, seconds / budget)
        print(f"{i:>5}  {seconds:5.1f} of {budget:4.1f} s  {case.told}: {outcome}", flush=True)
    told = ", ".join(f"{n} {word}" for word, n in sorted(tally.items()))
    print(f"{args.cases} cases, seed {args.seed}: {told}; {slowest:.2f} of a budget at most")
    return 1 if tally["FOUND"] else 0


def again(args: argparse.Namespace) -> int:
    from fit_cases import drawn, fitted, looked_at

    case = drawn(args.seed, args.case, args.longest)
    print(case.told)
    print(looked_at(case, fitted(case)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
