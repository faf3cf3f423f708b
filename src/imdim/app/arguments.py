"""``key=value`` arguments as any settings dataclass, with optional YAML files of overrides beneath."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from imdim.config import ConfigError, first_line, merge, one_line

T = TypeVar("T")


def from_arguments(schema: type[T], arguments: Sequence[str], folder: Path | None = None, name: str = "") -> T:
    """`schema` with ``folder/name.yaml``, then ``folder/experiment/<experiment>.yaml``, then `arguments` laid over its defaults.

    The experiment is the argument's or else the YAML file's `experiment`. Raises ConfigError for unknown keys, wrong types, an
    argument that is not of the form key=value and an experiment without a file.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    for argument in arguments:
        if "=" not in argument:
            raise ConfigError(f"setting {one_line(repr(argument))} is not of the form key=value")
    try:
        given: Any = OmegaConf.from_dotlist(list(arguments))
        layers = [given] if folder is None else _files(folder, name, given)
        values: Any = OmegaConf.to_container(OmegaConf.merge(*layers), resolve=True)
    except (YAMLError, OmegaConfBaseException, RecursionError) as error:
        raise ConfigError(f"settings {one_line(' '.join(arguments))}: {first_line(error)}") from error
    return merge(schema, values)


def _files(folder: Path, name: str, given: Any) -> list[Any]:
    from omegaconf import OmegaConf

    base: Any = OmegaConf.load(folder / f"{name}.yaml")
    chosen = given.get("experiment", base.get("experiment"))
    if chosen is None:
        return [base, given]
    path = folder / "experiment" / f"{chosen}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in path.parent.glob("*.yaml")))
        raise ConfigError(f"setting experiment: {chosen!r} has no file {path.name}; known are {known}")
    return [base, OmegaConf.load(path), given]
