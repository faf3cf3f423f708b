"""Modules that others import as they are imported themselves, and that a fit seldom uses: loaded when something of them is used."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any

# a quarter of a second: for graphs, Fortran (scipy goes through all that numpy has), films of samples, proofs, relations in noise, and
# numba's settings
SELDOM = ("networkx", "numpy.f2py", "scipy.ndimage", "scipy.optimize", "scipy.special", "yaml")


@contextmanager
def defer_modules(names: Sequence[str] = SELDOM) -> Iterator[None]:
    """What is imported in the block gets, of the modules of these `names` that are not loaded yet, ones that load themselves when they are
    used; what is imported after it gets the real ones. What is taken out of one in the block has to be something to call."""
    found = {name: find_spec(name) for name in names if name not in sys.modules}
    deferred = {name: _DeferredModule(name, spec.submodule_search_locations) for name, spec in found.items() if spec is not None}
    for name, module in deferred.items():
        _bind(name, module)
    try:
        yield
    finally:
        for name, module in deferred.items():
            module.is_over = True
            _unbind(name, module)


def _bind(name: str, module: ModuleType) -> None:
    """As an import does: among the modules, and as what the package that holds it calls so."""
    sys.modules[name] = module
    package, _, own = name.rpartition(".")
    if package:
        setattr(sys.modules[package], own, module)


def _unbind(name: str, module: ModuleType) -> None:
    """Undo `_bind`, unless the module was loaded since."""
    if sys.modules.get(name) is module:
        del sys.modules[name]
    package, _, own = name.rpartition(".")
    if package and vars(sys.modules[package]).get(own) is module:
        delattr(sys.modules[package], own)


class _DeferredModule(ModuleType):
    """Gives what the module of its name has; as long as the block is not over, as functions that load it when they are called."""

    def __init__(self, name: str, path: Sequence[str] | None) -> None:
        super().__init__(name)
        self.is_over = False
        self.__path__ = list(path or ())  # its own modules are found as ever

    def __getattr__(self, name: str) -> Any:
        return getattr(self._load(), name) if self.is_over or name.startswith("__") else self._call_later(name)

    def _load(self) -> ModuleType:
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return import_module(self.__name__)

    def _call_later(self, name: str) -> Callable[..., Any]:
        return lambda *args, **kwargs: getattr(self._load(), name)(*args, **kwargs)
