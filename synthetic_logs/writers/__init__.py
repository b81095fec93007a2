"""Synthetic logs as files: MCAP, ROS 1 bag, ROS 2 bag, CSV; the truth always beside as CSV."""

from collections.abc import Callable
from pathlib import Path

from navreplay.timeline import LogError
from synthetic_logs.simulation import SyntheticLog

__all__ = ["FORMATS", "write"]

FORMATS: dict[str, str] = {
    ".mcap": "MCAP with ROS 2 messages, chunks compressed with zstd",
    ".bag": "ROS 1 bag",
    ".db3": "ROS 2 bag, the bare SQLite file",
    "": "ROS 2 bag, a directory with metadata.yaml and the SQLite file",
    ".csv": "NAME.imu.csv and NAME.fix.csv in our own columns",
}
"""What `write` can produce, by extension of the path."""


def write(log: SyntheticLog, path: str | Path) -> tuple[Path, ...]:
    """Writes a log in the format that the extension names (see `FORMATS`) and its truth as NAME.truth.csv beside it.

    Returns the paths written. Raises LogError for an unknown extension, for a path that exists already and for one that cannot
    be written.
    """
    path = Path(path)
    write_log = _writer(path)
    truth = path.with_suffix(".truth.csv")
    logs = (path.with_suffix(".imu.csv"), path.with_suffix(".fix.csv")) if path.suffix == ".csv" else (path,)
    for target in (*logs, truth):
        if target.exists():
            raise LogError(f"{target}: exists already; remove it or choose another name")
    from synthetic_logs.writers.text import write_truth

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_log(log, path)
        write_truth(log, truth)
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from error
    return (*logs, truth)


def _writer(path: Path) -> Callable[[SyntheticLog, Path], None]:
    """The writer for a path; each format's library is imported only when it is needed."""
    if path.suffix == ".mcap":
        from synthetic_logs.writers.mcap_log import write_mcap

        return write_mcap
    if path.suffix == ".csv":
        from synthetic_logs.writers.text import write_csv

        return write_csv
    if path.suffix in (".bag", ".db3", ""):
        from synthetic_logs.writers import ros_bags

        return {".bag": ros_bags.write_ros1, ".db3": ros_bags.write_ros2_file, "": ros_bags.write_ros2}[path.suffix]
    known = ", ".join(suffix for suffix in FORMATS if suffix)
    raise LogError(
        f"{path}: no format has the extension {path.suffix!r}; use one of {known}, or none for a ROS 2 bag directory"
    )
