"""Fixes of NMEA 0183: positions from GGA, else GNS or RMC; date from RMC or ZDA, velocity from RMC or VTG, accuracy from GST.

Field layouts: NMEA 0183 version 4, as receivers' protocol manuals give them. GGA heights are above mean sea level; the geoid
separation of the same sentence makes them ellipsoidal.
"""

from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from importers.nmea.sentences import Sentences
from importers.rows.log import Table
from importers.rows.tables import NO_FIX, diagonal_covariance, status_codes
from importers.text.table import read_bytes
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc
from navreplay.timeline import FixStatus, Floats, LogError, Times

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["NMEA_NOTE", "read_nmea", "read_sentences"]

NMEA_NOTE = (
    "NMEA sentences hold no accuracies and no vertical velocity: positions get the accuracy usual for their status, "
    "horizontal velocities 0.2 m/s, the vertical velocity none"
)
_VEL_STD = (0.2, 0.2, 100.0)
_KNOT = 1852 / 3600
_DAY_S = 86_400
_MODES = {
    "A": int(FixStatus.SINGLE),
    "D": int(FixStatus.DIFFERENTIAL),
    "P": int(FixStatus.SINGLE),
    "R": int(FixStatus.FIXED),
    "F": int(FixStatus.FLOAT),
    "E": int(FixStatus.DEAD_RECKONING),
    "M": int(FixStatus.SINGLE),
    "S": int(FixStatus.SINGLE),
}
_RMC_STATUS = {"A": int(FixStatus.UNKNOWN)}
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


def read_nmea(path: str, utc_date: date | None, leap: LeapSeconds) -> Table:
    """One row per position sentence. Raises LogError where no position sentence is intact or no date is known."""
    return read_sentences(path, read_bytes(path), utc_date, leap)


def read_sentences(path: str, data: bytes, utc_date: date | None, leap: LeapSeconds) -> Table:
    """The same of the lines of a file."""
    sentences = Sentences(data)
    kind = sentences.kind
    rmc = sentences.fields(kind == "RMC", {"time": 1, "lat": 3, "lon": 5, "knots": 7, "course": 8, "date": 9}, (2, 4, 6))
    name = next((name for name in _POSITIONS if (kind == name).any()), None)
    rows = _position_rows(sentences, name, rmc)
    if len(rows) == 0:
        raise LogError(
            f"{path}: no intact GGA, GNS or RMC sentence among {sentences.count} lines, so there is no position in it"
        )
    seconds = _seconds_of_day(rows["time"].to_numpy())
    timed = (seconds >= 0) & (seconds <= _DAY_S)
    rows, seconds = rows[timed], seconds[timed]
    own = _main_talker(sentences.talker[rows.index.to_numpy().astype(np.int64)], seconds)
    second = int((~own).sum())
    rows, seconds = rows[own], seconds[own]
    day = _date_rows(path, rows.index.to_numpy(), seconds, _dates(sentences, rmc), utc_date)
    t_ns = gps_from_utc(day * _DAY_S * 10**9 + np.rint(seconds * 1e6).astype(np.int64) * 1000, leap)
    vel, cov_vel = _match_velocities(rows, seconds, rmc if len(rmc) else _courses(sentences, rows))
    columns: dict[str, np.ndarray] = {
        "t_gps_ns": t_ns,
        "lla": _positions(rows),
        "vel_n": vel,
        "cov_vel": cov_vel,
        "cov_pos": _accuracies(sentences, rows, seconds),
        "status": _statuses(rows, name),
    }
    return Table(t_ns, columns, sentences.count, _count_rejected(sentences, name, len(rows), second))


_POSITIONS = ("GGA", "GNS", "RMC")
"""Sentences that hold positions, the best first: the last has no height."""


def _position_rows(sentences: Sentences, name: str | None, rmc: "pd.DataFrame") -> "pd.DataFrame":
    """Fields of the sentences that serve as rows, under the same names."""
    if name == "GGA":
        numbers = {"time": 1, "lat": 2, "lon": 4, "msl": 9, "geoid": 11}
        return sentences.fields(sentences.kind == name, numbers, (3, 5, 6)).rename(columns={3: "ns", 5: "ew", 6: "status"})
    if name == "GNS":
        numbers = {"time": 1, "lat": 2, "lon": 4, "msl": 9, "geoid": 10}
        return sentences.fields(sentences.kind == name, numbers, (3, 5, 6)).rename(columns={3: "ns", 5: "ew", 6: "status"})
    rows = rmc.rename(columns={4: "ns", 6: "ew", 2: "status"})
    return rows.assign(msl=np.nan, geoid=np.nan)


def _main_talker(talker: np.ndarray, seconds: Floats) -> np.ndarray:
    """Which rows (n,) to take where several talkers put out positions at the same times: those of the one with most."""
    names, count = np.unique(talker, return_counts=True)
    if len(names) < 2:
        return np.ones(len(talker), dtype=bool)
    main = sorted(names, key=lambda name: (-count[names == name][0], name != "GN"))[0]
    beside = (talker != main) & np.isin(seconds, seconds[talker == main])
    return np.asarray(~beside)


def _statuses(rows: "pd.DataFrame", name: str | None) -> np.ndarray:
    texts = rows["status"].to_numpy()
    if name == "GGA":
        return status_codes(texts, _STATUS)
    letters = _RMC_STATUS if name == "RMC" else _MODES
    return np.array(
        [max((letters.get(letter, NO_FIX) for letter in str(text)), default=NO_FIX) for text in texts], dtype=np.int8
    )


def _dates(sentences: Sentences, rmc: "pd.DataFrame") -> "pd.DataFrame":
    """Seconds of day and days since 1970 by line, of RMC and ZDA that tell a date; 000000 is none."""
    import pandas as pd

    zda = sentences.fields(sentences.kind == "ZDA", {"time": 1, "day": 2, "month": 3, "year": 4}, ())
    ddmmyy = rmc["date"].to_numpy(dtype=np.float64)
    told = pd.DataFrame(
        {"time": rmc["time"], "day": ddmmyy // 10000, "month": ddmmyy // 100 % 100, "year": 2000 + ddmmyy % 100}
    )
    dated = pd.concat([told, zda]) if len(zda) and len(told) else (zda if len(zda) else told)
    calendar = pd.to_datetime(dated[["year", "month", "day"]], errors="coerce")
    days = calendar.to_numpy().astype("datetime64[D]").astype(np.int64)
    seconds = _seconds_of_day(dated["time"].to_numpy())
    found = pd.DataFrame({"seconds": seconds, "days": days}, index=dated.index)
    return found[calendar.notna().to_numpy() & np.isfinite(seconds)].sort_index()


def _courses(sentences: Sentences, rows: "pd.DataFrame") -> "pd.DataFrame":
    """VTG in place of RMC, each with the time of the sentence before it, or behind it where VTG comes first in the file."""
    import pandas as pd

    vtg = sentences.fields(sentences.kind == "VTG", {"course": 1, "knots": 5}, (9,))
    if len(vtg) == 0 or len(rows) == 0:
        return pd.DataFrame()
    timed = [sentences.fields(sentences.kind == name, {"time": 1}, ())["time"] for name in ("ZDA", "GST")]
    clock = pd.concat([rows["time"], *(times for times in timed if len(times))]).sort_index()
    lines, places = clock.index.to_numpy(), vtg.index.to_numpy()
    last = np.searchsorted(lines, places) - (1 if places[0] > lines[0] else 0)
    valid = np.where(vtg[9].isin(["N", "E", "S"]), "V", "A")
    times = clock.to_numpy(dtype=np.float64)[np.clip(last, 0, len(lines) - 1)]
    return pd.DataFrame({"time": times, "knots": vtg["knots"], "course": vtg["course"], 2: valid})


def _accuracies(sentences: Sentences, rows: "pd.DataFrame", seconds: Floats) -> Floats:
    """Covariances (n, 3, 3) of the GST of the same time; NaN without one."""
    gst = sentences.fields(sentences.kind == "GST", {"time": 1, "n": 6, "e": 7, "d": 8}, ())
    cov = np.full((len(rows), 3, 3), np.nan)
    if len(gst) == 0:
        return cov
    lines, clock = gst.index.to_numpy(), _seconds_of_day(gst["time"].to_numpy())
    told = diagonal_covariance(gst[["n", "e", "d"]].to_numpy(dtype=np.float64))
    after = np.clip(np.searchsorted(lines, rows.index.to_numpy()), 0, len(lines) - 1)
    for nearest in (np.maximum(after - 1, 0), after):
        same = np.abs(clock[nearest] - seconds) < 1e-3
        cov[same] = told[nearest[same]]
    return cov


def _seconds_of_day(hhmmss: np.ndarray) -> Floats:
    whole = hhmmss.astype(np.float64)
    return np.asarray(whole // 10000 * 3600 + whole // 100 % 100 * 60 + whole % 100)


def _date_rows(path: str, lines: np.ndarray, seconds: Floats, dated: "pd.DataFrame", utc_date: date | None) -> Times:
    """Days since 1970 (n,) of rows at lines (n,) and seconds of day (n,): by the date told before each, or counted from one."""
    if len(dated):
        nearest = np.clip(np.searchsorted(dated.index.to_numpy(), lines, side="right") - 1, 0, None)
        passed = np.rint((dated["seconds"].to_numpy()[nearest] - seconds) / _DAY_S)
        return np.asarray(dated["days"].to_numpy()[nearest] + passed, dtype=np.int64)
    if utc_date is None:
        raise LogError(
            f"{path}: no intact RMC or ZDA sentence tells the date (000000 is none); set input.utc_date to the date of the "
            "first sentence"
        )
    midnights = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -_DAY_S / 2)
    return np.asarray((utc_date - date(1970, 1, 1)).days + midnights, dtype=np.int64)


def _positions(gga: "pd.DataFrame") -> Floats:
    def angle(column: str, letters: str, negative: str) -> Floats:
        """Degrees and minutes, written together, in radians."""
        value = gga[column].to_numpy(dtype=np.float64)
        degrees = value // 100 + value % 100 / 60
        return np.asarray(np.radians(np.where(gga[letters].to_numpy() == negative, -degrees, degrees)))

    height = gga["msl"].to_numpy(dtype=np.float64) + gga["geoid"].to_numpy(dtype=np.float64)
    return np.column_stack([angle("lat", "ns", "S"), angle("lon", "ew", "W"), height])


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


def _count_rejected(sentences: Sentences, name: str | None, rows: int, second: int) -> dict[str, int]:
    kind = sentences.kind
    merged = [other for other in ("RMC", "ZDA", "GST", "VTG") if other != name]
    counts = {
        "wrong checksum or garbled": int((~sentences.intact).sum()),
        f"{name} without time or with odd fields": int((kind == name).sum()) - rows - second,
        "of another talker at the same time": second,
        **{f"{other}, merged into the fix of its epoch": int((kind == other).sum()) for other in merged},
        "other sentence": int((sentences.intact & ~np.isin(kind, [*merged, str(name)])).sum()),
    }
    return {reason: count for reason, count in counts.items() if count}
