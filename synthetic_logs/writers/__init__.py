"""Synthetic logs as files: MCAP, ROS 1 bag, ROS 2 bag, CSV, RINEX; the truth always beside as CSV."""

from collections.abc import Callable
from pathlib import Path

from navreplay.timeline import LogError
from synthetic_logs.simulation import SyntheticLog

__all__ = ["FORMATS", "write"]

FORMATS: dict[str, str] = {
    ".mcap": "MCAP with ROS 2 messages and ranges in JSON, chunks compressed with zstd",
    ".bag": "ROS 1 bag, ranges as gnss_comm messages",
    ".db3": "ROS 2 bag, the bare SQLite file, ranges as gnss_comm messages",
    "": "ROS 2 bag, a directory with metadata.yaml and the SQLite file",
    ".csv": "NAME.imu.csv, NAME.fix.csv, NAME.attitude.csv and NAME.ranges.csv in our own columns",
    ".obs": "ranges as RINEX 3 NAME.obs and NAME.nav, with NAME.imu.csv",
}
"""What `write` can produce, by extension of the path."""


def write(log: SyntheticLog, path: str | Path, force: bool = False) -> tuple[Path, ...]:
    """Writes a log in the format that the extension names (see `FORMATS`) and its truth as NAME.truth.csv beside it.

    Returns the paths written, the truth last. force: overwrite files, but never a folder. Raises LogError for an unknown
    extension, for a path that exists already or cannot be written, and for a format that cannot hold what the log has.
    """
    path = Path(path)
    write_log = _writer(path)
    truth = path.with_suffix(".truth.csv")
    logs = _log_paths(log, path)
    for target in (*logs, truth):
        _make_way(target, force)
    from synthetic_logs.writers.text import write_truth

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_log(log, path)
        write_truth(log, truth)
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from error
    return (*logs, truth)


def _make_way(target: Path, force: bool) -> None:
    if target.is_dir():
        raise LogError(f"{target}: exists already; remove this folder or choose another name")
    if target.exists() and not force:
        raise LogError(f"{target}: exists already; choose another name, or overwrite it with --force")
    try:
        target.unlink(missing_ok=True)
    except OSError as error:
        raise LogError(f"{target}: cannot be written: {error.strerror}; choose another name") from error


def _log_paths(log: SyntheticLog, path: Path) -> tuple[Path, ...]:
    if path.suffix == ".obs":
        return path, path.with_suffix(".nav"), path.with_suffix(".imu.csv")
    if path.suffix != ".csv":
        return (path,)
    held = {"imu": log.imu, "fix": log.fixes, "attitude": log.attitude, "ranges": log.ranges}
    return tuple(path.with_suffix(f".{kind}.csv") for kind, series in held.items() if series is not None)


def _writer(path: Path) -> Callable[[SyntheticLog, Path], None]:
    """The writer for a path; each format's library is imported only when it is needed."""
    if path.suffix == ".mcap":
        from synthetic_logs.writers.mcap_log import write_mcap

        return write_mcap
    if path.suffix == ".csv":
        from synthetic_logs.writers.text import write_csv

        return write_csv
    if path.suffix == ".obs":
        from synthetic_logs.writers.rinex import write_rinex

        return write_rinex
    if path.suffix in (".bag", ".db3", ""):
        from synthetic_logs.writers import ros_bags

        return {".bag": ros_bags.write_ros1, ".db3": ros_bags.write_ros2_file, "": ros_bags.write_ros2}[path.suffix]
    known = ", ".join(suffix for suffix in FORMATS if suffix)
    raise LogError(
        f"{path}: no format has the extension {path.suffix!r}; use one of {known}, or none for a ROS 2 bag directory"
    )
