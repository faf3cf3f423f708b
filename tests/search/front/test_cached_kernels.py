"""Kernels that one process compiled and another loads beside its own give the answers of those compiled together."""

import os
import subprocess
import sys

SCRIPT = """
import sys
import numpy as np
from numba import njit
for _ in range(int(sys.argv[1])):
    njit(lambda x: x)(1.0)  # shifts the running numbers of all functions that are compiled later
from imdim.program.tree import Primitive
from imdim.search.bits import unpack_words
from imdim.search.front.leaf_cache import LeafCache, Registry

parts = [Primitive("box", (1.0, 2.0, 1.5)), Primitive("sphere", (1.0,)), Primitive("cylinder", (0.8, 2.0))]
points = np.random.default_rng(0).uniform(-1.5, 1.5, (640, 3))
x, y, z = points.T
rho = np.hypot(x, y)
truth = np.array([(abs(x) < 0.5) & (abs(y) < 1) & (abs(z) < 0.75), rho**2 + z**2 < 1, (rho < 0.8) & (abs(z) < 1)])
answers = []
if "first" in sys.argv:
    answers += [LeafCache(points, "distances", Registry(), 8).of(parts) < 0]
if "second" in sys.argv:
    columns = LeafCache(points, "bits", Registry(), 8)
    answers += [unpack_words(columns.of(parts), columns.count)]
sys.exit(sum(int((a != truth).sum()) for a in answers) > 0)
"""


def test_what_two_processes_compiled_goes_together(tmp_path):
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    for shift, tasks in ((0, ["first"]), (9, ["second"]), (0, ["first", "second"])):
        done = subprocess.run([sys.executable, "-c", SCRIPT, str(shift), *tasks], env=env, capture_output=True, text=True, check=False)
        assert done.returncode == 0, (shift, tasks, done.stderr)
