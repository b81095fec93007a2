"""SP3-c and SP3-d files: precise orbits and clocks.

Source: The Extended Standard Product 3 Orbit Format (SP3-d), S. Hilla, NGS, 2016. Positions in km, clocks in microseconds.
"""

import numpy as np

from importers.rows.log import Table
from importers.rows.ranges import satellite_names
from importers.satellites.precise import PreciseOrbits
from importers.text.table import read_bytes
from navreplay.geodesy.time_scales import GPS_EPOCH_UNIX_S, LeapSeconds, gps_from_utc
from navreplay.timeline import LogError

__all__ = ["is_sp3", "precise_orbits", "read_sp3"]

_S = 1_000_000_000
_NO_CLOCK_US = 999_999.0
_FARTHEST_KM = 1e6
_LEAST_EPOCHS = 10
_BDT_BEHIND_GPS_S = 14


def is_sp3(head: str) -> bool:
    """Whether the beginning of a file is an SP3 header with positions."""
    return head[:2] in ("#c", "#d") and head[2:3] in "PV" and "\n## " in head


def read_sp3(path: str, leap: LeapSeconds) -> Table:
    """A row per satellite and epoch: ``t_gps_ns``, ``sat``, ``pos`` (n, 3) [m], ``clock`` [s]. Raises LogError where there are
    too few epochs to interpolate."""
    lines = read_bytes(path).decode(errors="replace").splitlines()
    scale = next((line[9:12] for line in lines if line.startswith("%c")), "GPS")
    t_ns, rows, damaged = 0, [], 0
    for line in lines:
        if line.startswith("*"):
            t_ns = _epoch(line, scale, leap)
        elif line.startswith("P"):
            row = _position(line)
            if row is None or t_ns == 0:
                damaged += 1
            else:
                rows.append((t_ns, *row))
    if len({row[0] for row in rows}) < _LEAST_EPOCHS:
        raise LogError(f"{path}: the SP3 file holds fewer than {_LEAST_EPOCHS} epochs, too few to interpolate; is it cut?")
    times = np.array([row[0] for row in rows], dtype=np.int64)
    columns = {
        "t_gps_ns": times,
        "sat": satellite_names(np.array([row[1] for row in rows])),
        "pos": np.array([row[2:5] for row in rows]) * 1e3,
        "clock": np.array([row[5] if abs(row[5]) < _NO_CLOCK_US else np.nan for row in rows]) * 1e-6,
    }
    return Table(times, columns, len(rows) + damaged, {"damaged line": damaged} if damaged else {})


def precise_orbits(table: Table) -> PreciseOrbits:
    """The rows of `read_sp3` as a table by satellite and epoch."""
    times, column = np.unique(table.columns["t_gps_ns"], return_inverse=True)
    sats, row = np.unique(table.columns["sat"], return_inverse=True)
    pos, clock = np.full((len(sats), len(times), 3), np.nan), np.full((len(sats), len(times)), np.nan)
    known = (table.columns["pos"] != 0).any(axis=1)
    pos[row[known], column[known]] = table.columns["pos"][known]
    clock[row, column] = table.columns["clock"]
    return PreciseOrbits(times, sats, pos, clock)


def _epoch(line: str, scale: str, leap: LeapSeconds) -> int:
    """GPS time of an epoch line, 0 where it cannot be read."""
    words = line[1:].split()
    try:
        year, month, day, hour, minute = (int(word) for word in words[:5])
        second = float(words[5])
        start = int(np.datetime64(f"{year:04d}-{month:02d}-{day:02d}", "s").astype(np.int64))
    except (ValueError, IndexError, OverflowError):
        return 0
    if not (1980 <= year < 2200 and 0 <= hour < 24 and 0 <= minute < 60 and 0 <= second < 61):
        return 0
    second_ns = round(second * 1e9)
    unix_ns = (start + hour * 3600 + minute * 60) * _S + second_ns
    if scale == "UTC":
        return int(gps_from_utc(np.array([unix_ns]), leap)[0])
    return unix_ns - GPS_EPOCH_UNIX_S * _S + (_BDT_BEHIND_GPS_S * _S if scale == "BDT" else 0)


def _position(line: str) -> tuple[str, float, float, float, float] | None:
    try:
        x, y, z = (float(line[first : first + 14]) for first in (4, 18, 32))
        clock = float(line[46:60]) if line[46:60].strip() else _NO_CLOCK_US
    except ValueError:
        return None
    if not all(abs(value) < _FARTHEST_KM for value in (x, y, z)):
        return None
    return line[1:4], x, y, z, clock
