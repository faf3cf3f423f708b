"""The `imdim` command. Only the standard library is imported before a command is known, so that help answers at once."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import NoReturn

import imdim
from imdim.app.orderly import run_in_order

SETTINGS = "further settings; they and their defaults are listed below"
ABOUT = "A mesh or a point cloud becomes a short, editable CAD program."


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; the exit status is 0, or 2 for input or arguments that cannot be used (one line on stderr), or what the command's
    own `main` says."""
    return run_in_order(lambda: _run_command(argv))


def run() -> NoReturn:
    """The command as a process of its own. A fit that has ended leaves what it holds to the system: for Python to take it apart takes a
    seventh of a second more."""
    status = main()
    if sys.argv[1:2] == ["fit"]:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError, AttributeError):  # closed, or read by nobody
                stream.flush()
        os._exit(status)
    sys.exit(status)


def _run_command(argv: Sequence[str] | None) -> int:
    parser = argparse.ArgumentParser(prog="imdim", description=ABOUT, epilog="`imdim fit --help` tells more.")
    parser.add_argument("--version", action="version", version=f"imdim {imdim.__version__}")
    about = "fit: reconstruct one part; batch: every part of a folder; export: write one program of a front.json; "
    about += "edit: change named numbers of a program; lab: watch, correct and download in a browser page; "
    about += "mcp: serve language-model agents"
    parser.add_argument("command", choices=list(COMMANDS), help=about)
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="arguments of the command")
    given = parser.parse_args(argv)
    from imdim.side_process import leave_cores_to_copies

    leave_cores_to_copies()
    from imdim.reconstruction.config import ConfigError

    try:
        return COMMANDS[given.command](given.arguments)
    except ConfigError as error:
        sys.stderr.write(f"imdim: {error}\n")
        return 2


def fit_parser() -> argparse.ArgumentParser:
    """The arguments of `imdim fit`."""
    parser = argparse.ArgumentParser(
        prog="imdim fit",
        description="Reconstruct a mesh or a point cloud as a CAD program.",
        epilog=settings_help("input", "output", "budget_s", "seed"),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("input", help="STL, OBJ, OFF, PLY, 3MF, GLB, XYZ, TXT, CSV, PCD, NPY or NPZ file; - reads one from stdin")
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", help="where the results go (default: named after the part, as in bracket.imdim)"
    )
    parser.add_argument("--quiet", action="store_true", help="say nothing but errors")
    parser.add_argument("--json", action="store_true", help="write the report to stdout, as in report.json, and no summary")
    parser.add_argument("--budget", type=float, metavar="SECONDS", help="time for the search (default 60)")
    parser.add_argument("--seed", type=int, help="the same seed gives the same program (default 0)")
    parser.add_argument("--force", action="store_true", help="replace earlier results even where they were changed by hand")
    parser.add_argument("settings", nargs="*", metavar="key=value", help=SETTINGS)
    return parser


def _fit(argv: Sequence[str]) -> int:
    # intermixed: `imdim fit part.stl -o out size_weight=0.001` has a positional after an option
    given = fit_parser().parse_intermixed_args(argv)
    from imdim.app.fit import main as run
    from imdim.reconstruction.config import from_arguments

    typed = {"input": given.input, "output": given.output, "budget_s": given.budget, "seed": given.seed}
    settings = partial(from_arguments, given.settings, **{k: v for k, v in typed.items() if v is not None})
    return run(settings, quiet=given.quiet, as_json=given.json, force=given.force)


def settings_help(*without: str) -> str:
    """The end of a command's help: all settings but those that have options of their own."""
    from shutil import get_terminal_size

    from imdim.reconstruction.config import list_settings

    return f"settings and their defaults:\n{list_settings(get_terminal_size().columns - 2, without)}"


def export_parser() -> argparse.ArgumentParser:
    """The arguments of `imdim export`."""
    parser = argparse.ArgumentParser(prog="imdim export", description="Write one program of a front.json, or a program.json, as CAD files.")
    parser.add_argument("input", help="a results folder, or its front.json or program.json")
    parser.add_argument("--pick", type=int, metavar="N", help="which of the front, from 1, the crudest (default: the delivered one)")
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER", help="where the files go")
    parser.add_argument("--segments", type=int, default=96, help="facets per circle in meshes (default 96)")
    return parser


def _export(argv: Sequence[str]) -> int:
    given = export_parser().parse_args(argv)
    from imdim.app.export import export_program

    sys.stdout.write(export_program(Path(given.input), Path(given.output), given.pick, given.segments))
    return 0


def _lab(argv: Sequence[str]) -> int:
    from importlib.util import find_spec

    from imdim.install import install_command
    from imdim.reconstruction.config import ConfigError

    if find_spec("viser") is None:
        raise ConfigError(f"the lab needs an extra: {install_command('lab')}")
    return _run("imdim.app.lab.server", argv)


def _mcp(argv: Sequence[str]) -> int:
    from imdim.reconstruction.config import require_extra

    require_extra("agent", "imdim mcp", "mcp")
    return _run("imdim.app.agent.server", argv)


def _run(module: str, argv: Sequence[str]) -> int:
    """The `main` of a module that reads its own arguments."""
    return import_module(module).main(argv)


_edit, _batch = (partial(_run, f"imdim.app.{module}") for module in ("edit", "batch.run"))
COMMANDS: Mapping[str, Callable[[Sequence[str]], int]] = {
    "fit": _fit,
    "batch": _batch,
    "export": _export,
    "edit": _edit,
    "lab": _lab,
    "mcp": _mcp,
}

if __name__ == "__main__":
    run()
