"""What features are called in all files, in `--list`, the report and the lab: a label, and the number of the primitive in program.json."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from imdim.export.feature_roles import feature_roles
from imdim.program.constraints import Constraint
from imdim.program.repeats import Folded
from imdim.program.roles import labels
from imdim.program.tree import Program

MOST_RUNS = 8  # of numbers in a row, and of labels, that are said


def label_features(program: Program, constraints: Sequence[Constraint] = (), folded: Folded | None = None) -> tuple[str, ...]:
    """The label of each leaf, by its role and by what is equal or copied; `program` is the expansion of `folded`."""
    return tuple(labels(program, constraints, folded, feature_roles(program, folded)))


def say_feature(label: str, leaf: int) -> str:
    """As "hole #3"."""
    return f"{label} #{leaf}"


def say_features(numbers: Iterable[int], label: Sequence[str]) -> str:
    """Leaves with their numbers: "plate #0, hole #3, #4"; those of more than a few labels are counted."""
    words = [f"{word} {say_numbers(sorted(of))}" for word, of in _by_label(numbers, label).items()]
    return ", ".join(words[:MOST_RUNS]) + (f" and {len(words) - MOST_RUNS} more" if len(words) > MOST_RUNS else "")


def name_leaves(numbers: Iterable[int], label: Sequence[str], most: int = 10_000) -> list[str]:
    """Leaves with their numbers where several are called so: "plate", "hole #3, #4"; at most so many names."""
    called = Counter(label)
    words = [word if called[word] == 1 else f"{word} {say_numbers(sorted(of))}" for word, of in _by_label(numbers, label).items()]
    return words if len(words) <= most else [*words[:most], f"{len(words) - most} more"]


def _by_label(numbers: Iterable[int], label: Sequence[str]) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for number in dict.fromkeys(numbers):
        groups.setdefault(label[number], []).append(number)
    return groups


def say_numbers(numbers: Sequence[int]) -> str:
    """Numbers in order, "#3, #7 to #9"; those beyond a few are counted."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    said = [f"#{run[0]}" + (f"{', ' if len(run) == 2 else ' to '}#{run[-1]}" if len(run) > 1 else "") for run in runs[:MOST_RUNS]]
    more = sum(map(len, runs[MOST_RUNS:]))
    return ", ".join(said) + (f" and {more} more" if more else "")
