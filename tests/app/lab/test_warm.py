"""The process that waits for work has its kernels ready: what a task needs is compiled or loaded before it is asked for."""

import json
import subprocess
import sys

# Lists the kernels that each task makes ready itself, in a process that did what a waiting one does.
SCRIPT = """
import json, sys, time
from dataclasses import asdict
from numba.core.dispatcher import Dispatcher
from imdim.app.lab import work
from imdim.app.lab.resume import Rates
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.examples import example
from imdim.app.lab.requests import request
from imdim.reconstruction.config import Settings
from imdim.reconstruction.fitting import relations_of
from imdim.app.lab.examples import PROGRAMS

def ready():
    loaded = [m for name, m in sys.modules.items() if name.startswith("imdim")]
    kernels = {id(f): f for m in loaded for f in vars(m).values() if isinstance(f, Dispatcher)}
    return {f"{f.__module__}.{f.__name__}{s}" for f in kernels.values() for s in f.signatures}

work.warm()
first = ready()
work.warm_rest()
late = {"warm_rest": sorted(ready() - first)}
target, theory, settings = example("Bracket"), ConstrainedProgram(*relations_of(PROGRAMS["Bracket"]())), Settings(budget_s=1.0)
asked = {
    "continue": request("continue", target, settings, theory, rates=asdict(Rates(population=8))),
    "solve": request("solve", target, settings, theory, locks=[]),
    "relate": request("relate", target, settings, theory),
}
for name, message in asked.items():
    before = ready()
    told = [message.kind for message in work.perform(message, time.perf_counter)]
    assert told[-1] == "done", told
    late[name] = sorted(ready() - before)
print(json.dumps(late))
"""


def test_no_kernel_is_made_ready_while_a_person_waits():
    ran = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr
    late = json.loads(ran.stdout.splitlines()[-1])
    assert late.pop("warm_rest"), "it has something to do"
    assert late == {"continue": [], "solve": [], "relate": []}
