"""Settings: typed, flat where they can be, refused where they are misspelt.

Defaults live here and in the dataclasses of the parts; a YAML file or a command line only overrides them. Whatever composed
them (hydra, ``key=value`` arguments, a plain dict), they are merged into a fresh structured schema and passed on as a `Settings`.
"""

from __future__ import annotations

import re
import site
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from difflib import get_close_matches
from importlib.util import find_spec
from pathlib import Path
from textwrap import wrap
from typing import Any, TypeVar, get_type_hints

from imdim.export.numbers import MAX_SEGMENTS
from imdim.install import install_command
from imdim.program.cost import CURVE_PRICES
from imdim.program.units import ORIGINS, READ_AS

T = TypeVar("T")
LANGUAGES = ("csg", "cad")
AUTO = "auto"  # as an objective: by the language
OBJECTIVES = (AUTO, *CURVE_PRICES)
LEARNING = ("torch", "safetensors")  # what networks need
NONE = "none"  # as a checkpoint: no network at all
# a source tree, and where pip puts the data of a wheel: in an environment, with --user and with --target
_HOMES = (Path(__file__).parents[3], *(Path(base, "share/imdim") for base in (sys.prefix, site.getuserbase(), Path(__file__).parents[2])))
_MODELS = [home / "models" / "imdim-base.safetensors" for home in _HOMES]
SHIPPED = next((model for model in _MODELS if model.is_file()), _MODELS[0])


class ConfigError(ValueError):
    """A setting is unknown, misspelt or of the wrong type; the message is one line."""


def lacking(*modules: str) -> list[str]:
    """Those of the modules that are not installed."""
    return [module for module in modules if find_spec(module) is None]


def require_extra(extra: str, what: str, *modules: str) -> None:
    """Raise ConfigError, with the command that installs the extra, unless all its `modules` that `what` needs are there."""
    missing = lacking(*modules)
    if missing:
        raise ConfigError(f"{what} needs {', '.join(missing)}: {install_command(extra)}")


@dataclass
class Settings:
    """What one reconstruction needs to know; `MEANINGS` says what each is."""

    input: str = ""
    output: str = ""
    seed: int = 0
    budget_s: float = 60.0
    method: str = "auto"
    language: str = "cad"
    objective: str = AUTO
    size_weight: float = 2.5e-4
    segments: int = 96
    units: str = "auto"
    origin: str = "keep"
    logdir: str = ""
    checkpoint: str = ""
    stump_checkpoint: str = ""
    evolution: bool = True
    synthesis: bool = True
    solver: bool = True

    @property
    def counted(self) -> str:
        """What is counted beside the error, one of CURVE_PRICES: with an objective of AUTO by the language, since published programs of
        primitives alone are compared by their number."""
        return {"cad": "description", "csg": "primitives"}[self.language] if self.objective == AUTO else self.objective


MEANINGS: Mapping[str, str] = {
    "input": "the part, a file; - reads it from stdin",
    "output": "the folder for the results; empty: named after the part, as in bracket.imdim",
    "seed": "the same seed gives the same program, unless time ended the search",
    "budget_s": "seconds of wall clock for the whole run",
    "method": "how programs are found: auto, evolve (generations of trees), tree (a decision tree), policy (a network writes them), stump"
    " or stump-net (CSG-Stump, to compare with)",
    "language": "what programs are made of: language=cad of six primitives and extruded and turned outlines, language=csg of the six alone",
    "objective": "what the search counts beside the error: objective=description primitives and the curves of outlines, copies that repeat"
    " once, and plainer features are taken for drawings where they read as well; objective=primitives primitives alone, each copy too;"
    " objective=auto description with language=cad, primitives with language=csg",
    "size_weight": "the share of the volume that one more primitive must set right; larger gives shorter and cruder programs",
    "segments": "facets per circle in meshes",
    "units": "what the lengths of the file are: mm, cm, m or inch, which become millimetres; auto: what the file says, else as they are",
    "origin": "where the part is put: origin=keep where it is, origin=center the middle of its box at 0, 0, 0,"
    " origin=base the middle of the lowest side of that",
    "logdir": "where method=evolve writes tensorboard's event files; empty: nowhere",
    "checkpoint": "the policy, a file; empty: the shipped one; none: no policy",
    "stump_checkpoint": "the network of method=stump-net, a file; empty: the shipped one; none: random starts",
    "evolution": "false leaves out the evolution after the search, and of a noisy cloud the parts that are looked for anew (for ablations)",
    "synthesis": "false puts the decision tree in place of the search and its proofs (for ablations)",
    "solver": "false leaves out what fits, relates and rounds numbers (for ablations)",
}


def list_settings(width: int, without: Collection[str] = ()) -> str:
    """The settings with their defaults and meanings, a paragraph each."""
    shown = [(f"{f.name}={str(f.default).lower() if f.type == 'bool' else f.default}", MEANINGS[f.name]) for f in fields(Settings)]
    left = 2 + max(len(name) for name, _ in shown)
    lines = [(name, wrap(meaning, max(width - left - 2, 20))) for name, meaning in shown if name.split("=")[0] not in without]
    return "".join(f"  {'' if i else name:<{left}}{line}\n" for name, wrapped in lines for i, line in enumerate(wrapped))


def merge(schema: type[T], values: Mapping[str, Any]) -> T:
    """A fresh `schema` (a dataclass) with `values` laid over its defaults; raises ConfigError on unknown keys and wrong types.

    Values are taken literally: ``${oc.env:NAME}`` in the name of a file is part of that name.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    check_keys(schema, values)
    try:
        merged = OmegaConf.merge(OmegaConf.structured(schema), OmegaConf.create(_escape(dict(values))))
        return OmegaConf.to_object(merged)  # type: ignore[return-value]
    except (OmegaConfBaseException, OverflowError) as error:  # of an integer of hundreds of digits
        where = getattr(error, "full_key", "") or ", ".join(key for key, value in values.items() if not isinstance(value, Mapping))
        raise ConfigError(f"setting {where}: {first_line(error)}") from error


def _escape(value: Any) -> Any:
    """Texts in which nothing is interpolated, at any depth."""
    if isinstance(value, Mapping):
        return {key: _escape(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_escape(inner) for inner in value]
    return re.sub(r"(\\*)\$\{", r"\1\1\\${", value) if isinstance(value, str) else value


def check_keys(schema: type, values: Mapping[str, Any], prefix: str = "") -> None:
    """Raise ConfigError for the first key of `values`, at any depth, that `schema` lacks, with the nearest key that it has."""
    hints = get_type_hints(schema)
    for key, value in values.items():
        if key not in hints:
            raise ConfigError(_unknown(prefix + str(key), schema, prefix))
        if isinstance(value, Mapping) and is_dataclass(hints[key]):
            check_keys(hints[key], value, f"{prefix}{key}.")  # type: ignore[arg-type]


def _unknown(key: str, schema: type, prefix: str) -> str:
    known = [prefix + f.name for f in fields(schema)]
    near = get_close_matches(key, known, n=1, cutoff=0.6)
    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
    return f"unknown setting {key!r}: {hint}"


def from_arguments(arguments: Sequence[str], **given: Any) -> Settings:
    """Settings from ``key=value`` arguments; `given` are already typed and win. Raises ConfigError."""
    hints = get_type_hints(Settings)
    if not arguments and all(type(value) is hints.get(key) for key, value in given.items()):
        return check(Settings(**given))  # what reads texts takes a tenth of a second to load

    from omegaconf import OmegaConf
    from yaml import YAMLError

    for argument in arguments:
        if "=" not in argument:
            raise ConfigError(f"setting {one_line(repr(argument))} is not of the form key=value")
    try:
        values = OmegaConf.to_container(OmegaConf.from_dotlist(list(arguments)))
    except (YAMLError, RecursionError, IndexError) as error:  # the last for a key of brackets alone
        raise ConfigError(f"settings {one_line(' '.join(arguments))}: {first_line(error)}") from error
    assert isinstance(values, dict)
    # YAML reads nothing as null
    named = {key: "" if value is None and hints.get(str(key)) is str else value for key, value in values.items()}
    return check(merge(Settings, {**named, **given}))  # type: ignore[dict-item]


def from_hydra(folder: Path, name: str, overrides: Sequence[str]) -> Settings:
    """Settings composed by hydra from ``folder/name.yaml`` and its override grammar. Raises ConfigError.

    Composing without `hydra.main` leaves the working directory, the log and the disk alone.
    """
    require_extra("learn", "infer.py", "hydra")
    from hydra import compose, initialize_config_dir
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException, OverrideParseException
    from omegaconf import OmegaConf

    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
        for override in parsed:
            if override.is_sweep_override():
                raise ConfigError(f"setting {override.input_line}: one value per run, a sweep was given")
        with initialize_config_dir(str(folder.absolute()), version_base="1.3"):
            # struct mode would report an unknown key without its near match: let all keys in, the schema refuses them
            forced = [o.input_line if _is_group(folder, o.input_line) else f"++{o.input_line}" for o in parsed if o.input_line]
            values = OmegaConf.to_container(compose(name, forced), resolve=True)
    except OverrideParseException as error:
        raise ConfigError(f"{first_line(error)}; quote special characters twice, as in 'input=\"my part (1).stl\"'") from error
    except HydraException as error:
        raise ConfigError(first_line(error)) from error
    assert isinstance(values, dict)
    return check(merge(Settings, values))  # type: ignore[arg-type]


def _is_group(folder: Path, override: str) -> bool:
    return override[0] in "+~" or (folder / override.split("=")[0].split("@")[0]).is_dir()


def check(settings: Settings) -> Settings:
    """The same settings, or ConfigError for a number out of its range."""
    for key, low in (("budget_s", 0.0), ("segments", 3), ("seed", 0)):
        value = getattr(settings, key)
        if not value >= low or value == float("inf"):
            raise ConfigError(f"setting {key} must be a finite number of at least {low:g}, got {value}")
    if settings.segments > MAX_SEGMENTS:
        raise ConfigError(f"setting segments must be at most {MAX_SEGMENTS}, got {settings.segments}")
    check_choices(settings)
    if not 0 < settings.size_weight < 1:
        raise ConfigError(f"setting size_weight must lie in 0..1, got {settings.size_weight}")
    return settings


def check_choices(settings: Settings) -> None:
    """Raise ConfigError for a language, an objective, a unit or an origin that is none of those known."""
    for key, known in (("language", LANGUAGES), ("objective", OBJECTIVES), ("units", READ_AS), ("origin", ORIGINS)):
        if getattr(settings, key) not in known:
            raise ConfigError(f"unknown {key} {getattr(settings, key)!r}; known are {', '.join(known)}")


def first_line(error: BaseException) -> str:
    """The first line of an error's message, not all of it where it is long, or its type where it has none."""
    return one_line(next(iter(str(error).strip().splitlines()), type(error).__name__))


def one_line(text: str, most: int = 200) -> str:
    """What was given, for a message: on one line, and no more than `most` characters of it."""
    text = " ".join(text.split())
    return text if len(text) <= most else text[: most - 3] + "..."
