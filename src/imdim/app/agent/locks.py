"""What an agent has locked: names, each with the numbers of primitives that stay as they are while it holds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from imdim.app.lab.solving import TURN, Lock
from imdim.export.delivered import Delivered, EditError, find_followers
from imdim.program.constraints import AXES, read_ref
from imdim.program.tree import SIZE_NAMES, Primitive, Program, leaves

MOVED = 1e-9  # share of a number by which it is another one

NamedLocks = tuple[str, tuple[Lock, ...]]  # what is locked, as it was asked for, and its numbers


def is_reference(name: str) -> bool:
    """Whether a name is that of one number of a primitive, such as 3.x."""
    try:
        return bool(read_ref(name).feature) and read_ref(name).leaf >= 0
    except ValueError:
        return False


def find_locks(delivered: Delivered, name: str) -> tuple[Lock, ...]:
    """The numbers that a name stands for. Raises EditError for a name that there is not, and for one that nothing but `set` changes."""
    if name in delivered.values:
        across, equal, moved = find_followers(delivered)[name]
        numbers = [*across, *equal] or moved
        locks = tuple(Lock(*feature) for feature in sorted(numbers) if feature[1] != "outline")
        if not locks:
            raise EditError(f"{name} is a number of a drawing or of an edge, which nothing but set changes: it needs no lock")
        return locks
    if not is_reference(name):
        raise EditError(f"no parameter {name!r} to lock")
    ref, parts = read_ref(name), list(leaves(delivered.program))
    known = [] if not 0 <= ref.leaf < len(parts) else [*SIZE_NAMES[parts[ref.leaf].kind], *AXES, TURN]
    if ref.feature not in known:
        raise EditError(f"no number {name} to lock; primitive {ref.leaf} has {', '.join(known) or 'none: there is no such primitive'}")
    return (Lock(ref.leaf, ref.feature),)


def check_locks(locks: Sequence[NamedLocks], before: Program, after: Program) -> None:
    """Raise EditError where a program of the same primitives moves what is locked."""
    old, new = list(leaves(before)), list(leaves(after))
    for name, of in locks:
        for lock in of:
            had, has = _number(old[lock.leaf], lock.name), _number(new[lock.leaf], lock.name)
            if any(abs(a - b) > MOVED * max(1.0, abs(a)) for a, b in zip(had, has, strict=True)):
                raise EditError(f"{name} is locked, and this would move it: unlock it first")


def shift_locks(locks: Sequence[NamedLocks], first: int, more: int) -> tuple[NamedLocks, ...]:
    """The locks after so many `more` primitives stand before number `first`."""
    return _relabel((name, tuple(Lock(k.leaf + more * (k.leaf >= first), k.name) for k in of)) for name, of in locks)


def keep_locks(locks: Sequence[NamedLocks], before: Program, after: Program) -> tuple[NamedLocks, ...]:
    """The locks of the primitives that are still there, told by their own numbers."""
    place: dict[Primitive, int] = {part: i for i, part in enumerate(leaves(after))}
    parts = list(leaves(before))
    return _relabel((name, tuple(Lock(place[parts[k.leaf]], k.name) for k in of if parts[k.leaf] in place)) for name, of in locks)


def _number(part: Primitive, name: str) -> tuple[float, ...]:
    if name == TURN:
        return part.rotation
    return (part.center[AXES.index(name)],) if name in AXES else (part.size[SIZE_NAMES[part.kind].index(name)],)


def _relabel(locks: Iterable[NamedLocks]) -> tuple[NamedLocks, ...]:
    """Those that were named by a feature and a number are so again, those without any are left out."""
    return tuple((f"{of[0].leaf}.{of[0].name}" if is_reference(name) else name, of) for name, of in locks if of)
