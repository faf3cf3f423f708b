"""IMDIM: a mesh or a point cloud becomes a short, editable CSG program.

Read `program.tree`, `geometry.sdf`, `reconstruction.pipeline` and `delivery.evaluate`, in this order; docs/tour.md walks through the rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from imdim.reconstruction.config import Settings
    from imdim.reconstruction.pipeline import Snapshot
    from imdim.reconstruction.pipeline import reconstruct_best as reconstruct
    from imdim.target.target import load_target

__all__ = ["Settings", "Snapshot", "load_target", "reconstruct"]

_HOMES = {
    "reconstruct": ("imdim.reconstruction.pipeline", "reconstruct_best"),
    "Snapshot": ("imdim.reconstruction.pipeline", "Snapshot"),
    "Settings": ("imdim.reconstruction.config", "Settings"),
    "load_target": ("imdim.target.target", "load_target"),
}


def __getattr__(name: str) -> Any:
    """Import on first use, so that ``import imdim`` and ``imdim --help`` answer at once."""
    if name not in _HOMES:
        raise AttributeError(f"module 'imdim' has no attribute {name!r}")
    from importlib import import_module

    module, attribute = _HOMES[name]
    return getattr(import_module(module), attribute)
