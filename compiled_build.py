"""Builds the package as setuptools does; a wheel has the search's kernels too, compiled for the processor that builds it.

They are numba's cache files. Numba takes them only in the version that wrote them, for the same source, on a processor with the same
instructions: anywhere else the first fit compiles, as it does where this could not. `IMDIM_COMPILE=0` leaves them out.
"""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

from setuptools.build_meta import *  # noqa: F403
from setuptools.command.build_py import build_py

PROJECT = Path(__file__).with_name("pyproject.toml")
LEFT_OUT = "imdim: the kernels could not be compiled here; the first fit will do it\n"


def get_requires_for_build_wheel(config_settings: object = None) -> list[str]:
    """What kernels need to be compiled: all that the package does."""
    return tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]["dependencies"] if is_compiled() else []


def is_compiled() -> bool:
    return os.environ.get("IMDIM_COMPILE") != "0"


class BuildCompiled(build_py):
    """Copies the modules, and compiles their kernels beside the copies."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode and is_compiled():
            compile_beside(Path(self.build_lib).resolve())


def compile_beside(library: Path) -> None:
    """Let the package in a folder compile what a fit needs into that folder, or say that it could not."""
    # pip's isolated environment is a path of its own: without it the package would not find what it needs
    paths = os.pathsep.join(filter(None, (str(library), os.environ.get("PYTHONPATH"))))
    environment = {**os.environ, "PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    if subprocess.run([sys.executable, "-m", "imdim.delivery.first_run", "all"], env=environment, check=False).returncode:
        sys.stderr.write(LEFT_OUT)
