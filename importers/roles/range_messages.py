"""Types and layouts that hold pseudoranges, and their tables with a row per satellite signal."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from importers.roles.gnss_messages import gnss_comm_ranges, ublox_ranges
from importers.roles.range_epochs import flatten_epochs
from importers.rows.log import Table
from importers.rows.ranges import Applied, satellite_names
from navreplay.timeline import Floats

__all__ = ["RANGE_TYPES", "range_table"]

_NUMBERS = {
    "pseudorange": "pseudorange_m",
    "range_rate": "range_rate_mps",
    "pseudorange_std": "pseudorange_std_m",
    "range_rate_std": "range_rate_std_mps",
    "cn0": "cn0_dbhz",
}
_VECTORS = {"sat_pos_e": "sat_pos_e_m", "sat_vel_e": "sat_vel_e_mps"}
_CORRECTED = Applied.SATELLITE_CLOCK | Applied.RELATIVITY | Applied.GROUP_DELAY | Applied.TURNED


def range_table(type: str, table: Table) -> Table:
    """A table with one row per observation, columns as `importers.rows.ranges.range_rows` takes them. read counts observations
    and the messages that hold none. Raises KeyError where the type's fields are missing."""
    return RANGE_TYPES[type.replace("/msg/", "/")](table)


def _as_they_are(table: Table) -> Table:
    return table


def _own(table: Table) -> Table:
    """``navreplay.GnssRanges``, see docs/formats.md."""
    n = len(table.log_time_ns)
    epochs = [item if isinstance(item, list) else [] for item in table.columns["satellites"]]
    epochs = [[sat for sat in epoch if isinstance(sat, dict)] for epoch in epochs]
    t_ns = _whole(table.columns["t_gps_ns"])
    applied = np.zeros(n, dtype=np.int64)
    for name, meaning in (
        ("corrected", _CORRECTED),
        ("ionosphere_removed", Applied.IONOSPHERE),
        ("troposphere_removed", Applied.TROPOSPHERE),
    ):
        applied |= np.where(_true(table.columns.get(name), n), int(meaning), 0)

    def columns(satellites: list[Any], message: np.ndarray) -> dict[str, np.ndarray]:
        """Columns of all satellites; message (k,): the index of the message each came in."""
        out: dict[str, np.ndarray] = {"t_gps_ns": t_ns[message], "applied": applied[message]}
        out["sat"] = satellite_names(np.array([str(sat.get("sat", "")) for sat in satellites], dtype="U8"))
        out["signal"] = np.array([str(sat.get("signal", "")) for sat in satellites], dtype="U2")
        out |= {name: _numbers([sat.get(key) for sat in satellites]) for name, key in _NUMBERS.items()}
        out |= {name: _vectors([sat.get(key) for sat in satellites]) for name, key in _VECTORS.items()}
        if "klobuchar" in table.columns and table.columns["klobuchar"].shape[1:] == (8,):
            out["klobuchar"] = table.columns["klobuchar"].astype(np.float64)[message]
        return out

    return flatten_epochs(table, epochs, columns)


def _whole(values: np.ndarray) -> np.ndarray:
    """Stamps as integers; 0, which is before 1990, where there is none."""
    if values.dtype.kind in "iu":
        return values.astype(np.int64)
    return np.array(
        [value if isinstance(value, int) and abs(value) < 2**62 else 0 for value in values.tolist()], dtype=np.int64
    )


def _true(values: np.ndarray | None, n: int) -> np.ndarray:
    return np.zeros(n, dtype=bool) if values is None else np.array([value is True for value in values.tolist()], dtype=bool)


def _numbers(values: Sequence[Any]) -> Floats:
    """Numbers (n,), NaN for whatever is none."""
    return np.array([value if type(value) in (int, float) else np.nan for value in values], dtype=np.float64)


def _vectors(values: Sequence[Any]) -> Floats:
    """Vectors (n, 3), NaN for whatever is none."""
    unknown = [np.nan] * 3
    whole = [value if isinstance(value, list) and len(value) == 3 else unknown for value in values]
    return np.column_stack([_numbers([value[axis] for value in whole]) for axis in range(3)])


RANGE_TYPES: Mapping[str, Callable[[Table], Table]] = {
    "csv/range": _as_they_are,
    "navreplay/range": _as_they_are,
    "smartphone": _as_they_are,
    "rinex/observation": _as_they_are,
    "ubx/RXM-RAWX": _as_they_are,
    "novatel/RANGE": _as_they_are,
    "sbf/MeasEpoch": _as_they_are,
    "rtcm/MSM": _as_they_are,
    "navreplay.GnssRanges": _own,
    "gnss_comm/GnssMeasMsg": gnss_comm_ranges,
    "gnss_comm_msgs/GnssMeasMsg": gnss_comm_ranges,
    "ublox_msgs/RxmRAWX": ublox_ranges,
}
"""By type (without the ``/msg/`` of ROS 2), what makes a table per observation of the table of its messages."""
