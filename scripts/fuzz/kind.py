"""What a kind of fuzzed file is, and what counts as a refusal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


class Unclear(Exception):
    """A refusal that is no single line, or a result that contradicts itself."""


@dataclass(frozen=True)
class Kind:
    """`form` chooses the mutations; `seeds` makes valid files in a folder; `try_one` reads a file and says whether
    it was refused; `share` is of all cases, in thousandths or so.
    """

    suffix: str
    form: str
    share: int
    seeds: Callable[[Path], list[bytes]]
    try_one: Callable[[Path], bool]


def refused(kinds: tuple[type[BaseException], ...], read: Callable[[], object]) -> bool:
    """Run `read`: whether it refused, which must be one line of bounded length."""
    try:
        read()
        return False
    except kinds as error:
        said = str(error)
        if not said or "\n" in said or len(said) > 2000:
            raise Unclear(f"{type(error).__name__} says {said[:200]!r}") from error
        return True
