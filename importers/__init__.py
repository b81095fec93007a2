"""Readers of navigation logs: any supported file becomes series on one timeline.

The public names below are loaded when they are first used, so that importing the package costs nothing. The checks of a
timeline are `importers.preflight.checks.preflight`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importers.findings import Finding
    from importers.formats import open_log
    from importers.inspection import Inspection, inspect_logs
    from importers.load import load_timeline
    from importers.settings import InputSettings
    from navreplay.timeline import LogError

__all__ = [
    "Finding",
    "InputSettings",
    "Inspection",
    "LogError",
    "inspect_logs",
    "load_timeline",
    "open_log",
]

_HOME = {
    "Finding": "importers.findings",
    "InputSettings": "importers.settings",
    "Inspection": "importers.inspection",
    "LogError": "navreplay.timeline",
    "inspect_logs": "importers.inspection",
    "load_timeline": "importers.load",
    "open_log": "importers.formats",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'importers' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
