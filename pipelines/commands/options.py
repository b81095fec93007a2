"""From command-line arguments to a configuration, or to several."""

import argparse
import json
import tomllib
from collections.abc import Sequence

from navreplay.timeline import LogError
from pipelines.config.spec import Config, load_config
from pipelines.drive.compare import Setting

__all__ = ["read_config", "read_settings"]


def read_config(arguments: argparse.Namespace, more_sets: Sequence[str] = ()) -> Config:
    """The configuration file with ``--filter``, ``--rate``, ``--reference``, ``--smooth``, ``--set`` and more_sets on top of
    it."""
    shortcuts = (("filter.name", "filter"), ("output.rate_hz", "rate"), ("input.reference.file", "reference"))
    given = ((key, getattr(arguments, option, None)) for key, option in shortcuts)
    sets = [f"{key}={json.dumps(value, default=str)}" for key, value in given if value is not None]
    if getattr(arguments, "smooth", False):
        sets.append("filter.smooth=true")
    return load_config(arguments.config, [*sets, *arguments.sets, *more_sets])


def read_settings(arguments: argparse.Namespace) -> tuple[Setting, ...]:
    """The configuration, or with ``--vary`` one for each value. Raises LogError for a key that cannot be varied."""
    if arguments.vary is None:
        return (Setting(read_config(arguments)),)
    key, _, text = (part.strip() for part in arguments.vary.partition("="))
    values = _split_values(text)
    if not key or not values:
        raise LogError(f"--vary {arguments.vary}: expected KEY=A,B,..., for example --vary gnss.noise_scale=0.25,1,4")
    if key.split(".")[0] == "input":
        raise LogError(f"--vary {key}: the logs are read once for all runs, so no key of [input] can vary; compare runs apart")
    if key == "filter.name":
        raise LogError("--vary filter.name: the methods are named with --filters")
    sets = [f"{key}={json.dumps(value)}" for value in values]
    return tuple(Setting(read_config(arguments, [one]), key, value) for one, value in zip(sets, values, strict=True))


def _split_values(text: str) -> list[object]:
    """The values in a list with commas: as TOML has them, or strings without quotes."""
    try:
        return [_as_json(value) for value in tomllib.loads(f"values = [{text}]")["values"]]
    except tomllib.TOMLDecodeError:
        values = [value.strip() for value in text.split(",")]
        return list(values) if all(values) else []


def _as_json(value: object) -> object:
    """The value if JSON can hold it; else (inf, a date) its text, which a configuration takes as well."""
    try:
        json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        return str(value)
    return value
