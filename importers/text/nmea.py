"""NMEA 0183: positions from GGA, date and velocity from RMC; every sentence is checked by its checksum.

Field layouts: NMEA 0183 version 4, as receivers' protocol manuals give them. GGA heights are above mean sea level; the geoid
separation of the same sentence makes them ellipsoidal.
"""

import re
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from importers.rows.log import Table
from importers.rows.tables import NO_FIX, status_codes
from importers.text.table import parse_text, read_bytes, select_columns
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc
from navreplay.timeline import FixStatus, Floats, LogError, Times

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["NMEA_NOTE", "find_sentences", "is_nmea", "read_nmea", "read_sentences"]

NMEA_NOTE = (
    "NMEA sentences hold no accuracies and no vertical velocity: positions get the accuracy usual for their status, "
    "horizontal velocities 0.2 m/s, the vertical velocity none"
)
_VEL_STD = (0.2, 0.2, 100.0)
_KNOT = 1852 / 3600
_DAY_S = 86_400
_SENTENCE = re.compile(rb"\$[A-Z]{2}[A-Z0-9]{3},[\x20-\x7e]{0,100}\*[0-9A-Fa-f]{2}")
_STATUS = {
    "0": NO_FIX,
    "1": int(FixStatus.SINGLE),
    "2": int(FixStatus.DIFFERENTIAL),
    "3": int(FixStatus.SINGLE),
    "4": int(FixStatus.FIXED),
    "5": int(FixStatus.FLOAT),
    "6": int(FixStatus.DEAD_RECKONING),
    "7": NO_FIX,
    "8": int(FixStatus.SINGLE),
}


def is_nmea(head: str) -> bool:
    """Whether the beginning of a file holds a position sentence."""
    return any(line.startswith("$") and line[3:7] in ("GGA,", "RMC,") for line in head.splitlines())


def read_nmea(path: str, utc_date: date | None, leap: LeapSeconds) -> Table:
    """One row per GGA sentence. Raises LogError where no position sentence is intact or no date is known."""
    return read_sentences(path, read_bytes(path), utc_date, leap)


def find_sentences(stream: bytes | memoryview) -> bytes:
    """The sentences that stand in a stream of other messages, a line each."""
    return b"\n".join(_SENTENCE.findall(stream))


def read_sentences(path: str, data: bytes, utc_date: date | None, leap: LeapSeconds) -> Table:
    """The same of the lines of a file."""
    buffer = np.frombuffer(data, dtype=np.uint8)
    starts, ends, intact = _split_sentences(buffer)
    kind = _name_sentences(buffer, starts, intact)
    gga = _fields(buffer, starts, ends, kind == "GGA", {"time": 1, "lat": 2, "lon": 4, "msl": 9, "geoid": 11}, (3, 5, 6))
    rmc = _fields(buffer, starts, ends, kind == "RMC", {"time": 1, "knots": 7, "course": 8, "date": 9}, (2,))
    if len(gga) == 0:
        raise LogError(f"{path}: no intact GGA sentence among {len(starts)} lines; only GGA holds positions with heights")
    seconds = _seconds_of_day(gga["time"].to_numpy())
    timed = (seconds >= 0) & (seconds <= _DAY_S)
    gga, seconds = gga[timed], seconds[timed]
    day = _date_rows(path, gga.index.to_numpy(), seconds, rmc, utc_date)
    t_ns = gps_from_utc(day * _DAY_S * 10**9 + np.rint(seconds * 1e6).astype(np.int64) * 1000, leap)
    vel, cov_vel = _match_velocities(gga, seconds, rmc)
    status = status_codes(gga[6].to_numpy(), _STATUS)
    columns: dict[str, np.ndarray] = {
        "t_gps_ns": t_ns,
        "lla": _positions(gga),
        "vel_n": vel,
        "cov_vel": cov_vel,
        "status": status,
    }
    return Table(t_ns, columns, len(starts), _count_rejected(kind, intact, len(gga)))


def _split_sentences(buffer: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Starts and ends of the non-blank lines, and which of them are intact by form and checksum."""
    newlines = np.flatnonzero(buffer == 10)
    starts = np.concatenate([[0], newlines + 1])
    ends = np.concatenate([newlines, [len(buffer)]])
    ends = ends - (buffer[np.maximum(ends - 1, 0)] == 13)
    keep = ends > starts
    starts, ends = starts[keep], ends[keep]
    formed = (ends - starts > 10) & (buffer[starts] == ord("$"))
    formed[formed] = buffer[ends[formed] - 3] == ord("*")
    intact = formed.copy()
    if formed.any():
        edges = np.column_stack([starts[formed] + 1, ends[formed] - 3]).ravel()
        parity = np.bitwise_xor.reduceat(buffer, edges)[::2]
        intact[formed] = parity == 16 * _hex(buffer[ends[formed] - 2]) + _hex(buffer[ends[formed] - 1])
    return starts, ends, intact


def _hex(digit: np.ndarray) -> np.ndarray:
    value = digit.astype(np.int64)
    return np.where(value <= ord("9"), value - ord("0"), (value | 0x20) - ord("a") + 10)


def _name_sentences(buffer: np.ndarray, starts: np.ndarray, intact: np.ndarray) -> np.ndarray:
    """Sentence name of each line, empty where it is not intact."""
    names = np.full(len(starts), "", dtype="U3")
    letters = buffer[starts[intact, None] + np.arange(3, 6)]
    names[intact] = letters.astype(np.uint32).view("U3").ravel()
    return names


def _fields(
    buffer: np.ndarray,
    starts: np.ndarray,
    ends: np.ndarray,
    chosen: np.ndarray,
    numbers: dict[str, int],
    texts: tuple[int, ...],
) -> "pd.DataFrame":
    """Fields of the chosen sentences; the index is the number of the line."""
    import pandas as pd

    lines = np.flatnonzero(chosen)
    body = b"\n".join(b"%d,%s" % (line, bytes(buffer[starts[line] : ends[line]])) for line in lines)
    text = parse_text(body, delimiter=",", header=False)
    shifted = {name: i + 1 for name, i in numbers.items()} | {"line": 0}
    if text.frame.empty or max(*shifted.values(), *texts) + 1 > text.frame.shape[1]:
        return pd.DataFrame({name: np.empty(0) for name in (*numbers, *texts)})
    selection = select_columns(text, shifted, {str(i): i + 1 for i in texts})
    frame = pd.DataFrame(dict(selection.columns)).rename(columns={str(i): i for i in texts})
    return frame.set_index("line")


def _seconds_of_day(hhmmss: np.ndarray) -> Floats:
    whole = hhmmss.astype(np.float64)
    return np.asarray(whole // 10000 * 3600 + whole // 100 % 100 * 60 + whole % 100)


def _date_rows(path: str, lines: np.ndarray, seconds: Floats, rmc: "pd.DataFrame", utc_date: date | None) -> Times:
    """Days since 1970 (n,) of rows at lines (n,) and seconds of day (n,): from the RMC before each, or counted from a date."""
    dated = rmc[np.isfinite(rmc["date"].to_numpy(dtype=np.float64))]
    if len(dated):
        nearest = np.clip(np.searchsorted(dated.index.to_numpy(), lines, side="right") - 1, 0, None)
        ddmmyy = dated["date"].to_numpy(dtype=np.int64)[nearest]
        import pandas as pd

        parts = pd.DataFrame({"year": 2000 + ddmmyy % 100, "month": ddmmyy // 100 % 100, "day": ddmmyy // 10000})
        day = pd.to_datetime(parts).to_numpy().astype("datetime64[D]").astype(np.int64)
        return np.asarray(
            day + np.rint((_seconds_of_day(dated["time"].to_numpy())[nearest] - seconds) / _DAY_S), dtype=np.int64
        )
    if utc_date is None:
        raise LogError(f"{path}: no intact RMC sentence tells the date; set input.utc_date to the date of the first sentence")
    midnights = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -_DAY_S / 2)
    return np.asarray((utc_date - date(1970, 1, 1)).days + midnights, dtype=np.int64)


def _positions(gga: "pd.DataFrame") -> Floats:
    def angle(column: str, letters: int, negative: str) -> Floats:
        """Degrees and minutes, written together, in radians."""
        value = gga[column].to_numpy(dtype=np.float64)
        degrees = value // 100 + value % 100 / 60
        return np.asarray(np.radians(np.where(gga[letters].to_numpy() == negative, -degrees, degrees)))

    height = gga["msl"].to_numpy(dtype=np.float64) + gga["geoid"].to_numpy(dtype=np.float64)
    return np.column_stack([angle("lat", 3, "S"), angle("lon", 5, "W"), height])


def _match_velocities(gga: "pd.DataFrame", seconds: Floats, rmc: "pd.DataFrame") -> tuple[Floats, Floats]:
    """Velocities (n, 3) NED and covariances of the RMC of the same second of day nearest in the file; NaN without one."""
    vel, cov = np.full((len(gga), 3), np.nan), np.full((len(gga), 3, 3), np.nan)
    valid = rmc[rmc[2] == "A"] if len(rmc) else rmc
    if len(valid) == 0:
        return vel, cov
    lines = valid.index.to_numpy()
    after = np.clip(np.searchsorted(lines, gga.index.to_numpy()), 0, len(lines) - 1)
    rmc_seconds = _seconds_of_day(valid["time"].to_numpy())
    for nearest in (np.maximum(after - 1, 0), after):
        same = np.abs(rmc_seconds[nearest] - seconds) < 1e-3
        speed = valid["knots"].to_numpy(dtype=np.float64)[nearest[same]] * _KNOT
        course = np.radians(np.nan_to_num(valid["course"].to_numpy(dtype=np.float64)[nearest[same]]))
        vel[same] = np.column_stack([speed * np.cos(course), speed * np.sin(course), np.zeros(len(speed))])
    cov[np.isfinite(vel).all(axis=1)] = np.diag(np.square(_VEL_STD))
    return vel, cov


def _count_rejected(kind: np.ndarray, intact: np.ndarray, rows: int) -> dict[str, int]:
    counts = {
        "wrong checksum or garbled": int((~intact).sum()),
        "GGA without time or with odd fields": int((kind == "GGA").sum()) - rows,
        "RMC, merged into the fix of its epoch": int((kind == "RMC").sum()),
        "other sentence": int((intact & (kind != "GGA") & (kind != "RMC")).sum()),
    }
    return {reason: count for reason, count in counts.items() if count}
