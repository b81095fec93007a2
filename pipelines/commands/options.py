"""From command-line arguments to a configuration."""

import argparse
import json

from pipelines.spec import Config, load_config

__all__ = ["read_config"]


def read_config(arguments: argparse.Namespace) -> Config:
    """The configuration file with ``--filter``, ``--rate``, ``--reference``, ``--smooth`` and ``--set`` on top of it."""
    shortcuts = (("filter.name", "filter"), ("output.rate_hz", "rate"), ("input.reference.file", "reference"))
    given = ((key, getattr(arguments, option, None)) for key, option in shortcuts)
    sets = [f"{key}={json.dumps(value, default=str)}" for key, value in given if value is not None]
    if getattr(arguments, "smooth", False):
        sets.append("filter.smooth=true")
    return load_config(arguments.config, [*sets, *arguments.sets])
