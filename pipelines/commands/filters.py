"""``navreplay filters``: the methods, a line each."""

import argparse
import json

from navreplay.filters.presets import PRESETS

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Prints name and description of every method."""
    if arguments.json:
        print(json.dumps({preset.name: preset.description for preset in PRESETS.values()}, indent=2))
        return
    width = max(len(name) for name in PRESETS)
    for name, preset in PRESETS.items():
        print(f"{name:<{width}}  {preset.description}")
