"""``navreplay formats``: what logs can be read from, a line each."""

import argparse
import json

from importers.formats import known_formats

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Prints name, extensions and description of every format."""
    known_here = known_formats()
    if arguments.json:
        formats = {known.name: {"extensions": known.extensions, "description": known.description} for known in known_here}
        print(json.dumps(formats, indent=2))
        return
    width = max(len(known.name) for known in known_here)
    for known in known_here:
        extensions = f" ({', '.join(known.extensions)})" if known.extensions else ""
        print(f"{known.name:<{width}}  {known.description}{extensions}")
    print("any of them packed by gzip, bzip2, xz, zstd or zip, or at an address (s3://, https://) with navreplay[remote]")
