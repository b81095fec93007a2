"""``navreplay filters``: the methods, a line each."""

import argparse
import json

from navreplay.filters.presets import known_methods

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Prints name and description of every method."""
    methods = known_methods()
    if arguments.json:
        print(json.dumps({preset.name: preset.description for preset in methods.values()}, indent=2))
        return
    width = max(len(name) for name in methods)
    for name, preset in methods.items():
        print(f"{name:<{width}}  {preset.description}")
