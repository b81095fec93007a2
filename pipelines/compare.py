"""One drive through several methods."""

from collections.abc import Sequence
from pathlib import Path

from navreplay.filters.presets import build_method
from pipelines.process import Progress, filter_drive, read_drive
from pipelines.result import RunResult
from pipelines.spec import Config

__all__ = ["compare"]


def compare(
    paths: Sequence[Path], config: Config, names: Sequence[str], progress: Progress | None = None
) -> tuple[RunResult, ...]:
    """The drive, read once, through each named method with the rest of the configuration the same.

    Parameters in the configuration go to the method it names; the others run with their defaults. Raises LogError as
    `process` does.
    """
    configs = [_with_filter(config, name) for name in names]
    for each in configs:
        build_method(each.filter.name, each.filter.parameters)
    drive = read_drive(paths, config, progress)
    return tuple(filter_drive(drive, each, progress) for each in configs)


def _with_filter(config: Config, name: str) -> Config:
    if name == config.filter.name:
        return config
    return config.model_copy(update={"filter": config.filter.model_copy(update={"name": name, "parameters": {}})})
