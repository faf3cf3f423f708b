"""``key=value`` arguments as any settings dataclass, with optional YAML files of overrides beneath."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from imdim.reconstruction.config import ConfigError, first_line, merge, one_line

T = TypeVar("T")


def from_arguments(schema: type[T], arguments: Sequence[str], folder: Path | None = None, name: str = "") -> T:
    """`schema` with ``folder/name.yaml`` and the files of its defaults list, then `arguments` laid over its defaults.

    The argument `experiment` chooses the file of that group. Raises ConfigError for unknown keys, wrong types, an argument that is not
    of the form key=value and an experiment without a file.
    """
    from hydra.errors import HydraException
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
    except (YAMLError, OmegaConfBaseException, HydraException, RecursionError) as error:
        raise ConfigError(f"settings {one_line(' '.join(arguments))}: {first_line(error)}") from error
    return merge(schema, values)


def _files(folder: Path, name: str, given: Any) -> list[Any]:
    """What hydra composes from the files, and `given`: plain key=value, not hydra's grammar, in which a file name may need quotes."""
    from hydra import compose, initialize_config_dir
    from omegaconf import OmegaConf

    chosen = []
    if "experiment" in given:
        known = sorted(p.stem for p in (folder / "experiment").glob("*.yaml"))
        if given.experiment not in known:
            raise ConfigError(f"setting experiment: {given.experiment!r} has no file; known are {', '.join(known)}")
        chosen = [f"experiment={given.experiment}"]
    # out of hydra's struct mode, which would refuse what the schema knows to refuse better
    with initialize_config_dir(str(folder.absolute()), version_base="1.3"):
        return [OmegaConf.create(OmegaConf.to_container(compose(name, chosen))), given]
