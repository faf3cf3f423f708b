"""IMDIM: a mesh or a point cloud becomes a short, editable CAD program.

``imdim.reconstruct("part.stl").save("part")`` is all that most users need; README.md and docs/gallery.md have more. Of the code read
`program.tree`, `geometry.sdf`, `reconstruction.pipeline` and `delivery.evaluate`, in this order; docs/tour.md walks through the rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from imdim.delivery.result import Reconstruction, reconstruct
    from imdim.reconstruction.config import ConfigError, Settings
    from imdim.target.target import InputError, Target, load_target

    __version__: str

__all__ = ["ConfigError", "InputError", "Reconstruction", "Settings", "Target", "__version__", "load_target", "reconstruct"]

_HOMES = {
    "reconstruct": "imdim.delivery.result",
    "Reconstruction": "imdim.delivery.result",
    "ConfigError": "imdim.reconstruction.config",
    "Settings": "imdim.reconstruction.config",
    "InputError": "imdim.target.target",
    "Target": "imdim.target.target",
    "load_target": "imdim.target.target",
}


def __getattr__(name: str) -> Any:
    """Import on first use, so that ``import imdim`` and ``imdim --help`` answer at once."""
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("imdim")
        except PackageNotFoundError:  # a source tree that was never installed
            return "unknown"
    if name not in _HOMES:
        raise AttributeError(f"module 'imdim' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """What users need; modules are found by their names."""
    return sorted(__all__)
