"""Every file that once led to a traceback, a hang, a flood of memory or a page of text, as `scripts/fuzz/files.py` found it."""

from __future__ import annotations

import importlib
import random
import resource
import shutil
import sys
import time
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SCRIPTS = HERE.parents[1] / "scripts" / "fuzz"


sys.path += [str(SCRIPTS), str(SCRIPTS.with_name("bench"))]  # the scripts import each other by name
targets = importlib.import_module("targets")
mutations = importlib.import_module("mutations")
FILES = sorted((HERE / "corpus").iterdir())


@pytest.mark.parametrize("file", FILES, ids=[file.stem for file in FILES])
@pytest.mark.filterwarnings("ignore")
def test_what_once_failed_is_read_or_refused_in_one_line(tmp_path, file):
    kind = file.name.split("--")[0]
    path = tmp_path / f"part{targets.KINDS[kind].suffix}"
    shutil.copyfile(file, path)
    start, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    targets.KINDS[kind].try_one(path)
    assert time.process_time() - start < 20.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1_000_000  # KiB


@pytest.mark.parametrize("kind", [k for k in targets.KINDS if k not in ("export", "edit")])
def test_valid_files_are_read_and_broken_ones_are_deterministic(tmp_path, kind):
    seeds = targets.KINDS[kind].seeds(tmp_path)
    for data in seeds:
        path = tmp_path / f"part{targets.KINDS[kind].suffix}"
        path.write_bytes(data)
        assert not targets.KINDS[kind].try_one(path)
    broken = [mutations.mutated(seeds[0], seeds[-1], targets.KINDS[kind].form, random.Random(i)) for i in (1, 2, 3, 1)]
    assert broken[0] == broken[3]
    assert len(set(broken)) > 1
