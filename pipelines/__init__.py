"""From log files to results, and the door for Python users: `import pipelines as nav`.

    config = nav.load_config("drive.toml")
    drive = nav.read_drive(["drive.mcap"], config)
    result = nav.filter_drive(drive, config)
    result.solution.to_pandas()

The public names below are loaded when they are first used, so that importing the package costs nothing. docs/python.md shows
them at work. The command line is `pipelines.cli`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from navreplay.timeline import LogError
    from pipelines.config.spec import Config, load_config
    from pipelines.drive.process import Drive, read_drive
    from pipelines.notebook import Result, choose_filter, compare, configure, filter_drive, open_run
    from pipelines.outputs import write_outputs

__all__ = [
    "Config",
    "Drive",
    "LogError",
    "Result",
    "choose_filter",
    "compare",
    "configure",
    "filter_drive",
    "load_config",
    "open_run",
    "read_drive",
    "write_outputs",
]

_HOME = {
    "Config": "pipelines.config.spec",
    "Drive": "pipelines.drive.process",
    "LogError": "navreplay.timeline",
    "Result": "pipelines.notebook",
    "choose_filter": "pipelines.notebook",
    "compare": "pipelines.notebook",
    "configure": "pipelines.notebook",
    "filter_drive": "pipelines.notebook",
    "load_config": "pipelines.config.spec",
    "open_run": "pipelines.notebook",
    "read_drive": "pipelines.drive.process",
    "write_outputs": "pipelines.outputs",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'pipelines' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
