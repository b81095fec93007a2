"""RINEX 2, 3 and 4 navigation files: broadcast ephemerides and the ionosphere's coefficients.

Of RINEX 4 the messages LNAV, INAV, FNAV, D1, D2 and FDMA are read; CNAV and its relatives are counted as rejected.
"""

import numpy as np
from numpy.typing import NDArray

from importers.rinex.text import Lines, RinexText, calendar_ns, exponent_numbers, read_rinex
from importers.rows.log import Table
from importers.satellites.ephemeris import GLONASS, KEPLER
from navreplay.geodesy.time_scales import GPS_EPOCH_UNIX_S, WEEK_S, LeapSeconds, gps_from_utc
from navreplay.timeline import Floats, LogError, Times

__all__ = ["is_rinex_navigation", "read_rinex_navigation"]

_S = 1_000_000_000
_BDT_BEHIND_GPS_S = 14
_CALENDAR = ((4, 4), (9, 2), (12, 2), (15, 2), (18, 2), (21, 2))
_TYPES = "NGHE"
"""``N``, and in version 2 ``G`` GLONASS, ``H`` SBAS, ``E`` Galileo."""
_LARGEST_FLAGS = 4096
_MESSAGES = ("LNAV", "INAV", "FNAV", "D1", "D2", "FDMA")
_LINES = {"G": 8, "E": 8, "C": 8, "J": 8, "R": 4}
_KEPLER_FIELDS: dict[str, tuple[int, int]] = {
    "af0": (0, 1), "af1": (0, 2), "af2": (0, 3), "crs": (1, 1), "delta_n": (1, 2), "m0": (1, 3), "cuc": (2, 0),
    "e": (2, 1), "cus": (2, 2), "sqrt_a": (2, 3), "toe_sow": (3, 0), "cic": (3, 1), "omega0": (3, 2), "cis": (3, 3),
    "i0": (4, 0), "crc": (4, 1), "omega": (4, 2), "omega_dot": (4, 3), "idot": (5, 0),
}  # fmt: skip
"""Line and place in the line of each element (RINEX 3.05, tables A6, A8, A12 and A14)."""


def is_rinex_navigation(head: str) -> bool:
    """Whether the beginning of a file is a RINEX navigation header."""
    first = head.lstrip("\r\n").split("\n", 1)[0]
    return first[60:80].startswith("RINEX VERSION") and first[20:21] in _TYPES and first[20:21] != " "


def read_rinex_navigation(path: str, leap: LeapSeconds) -> Table:
    """Columns ``kepler`` and ``glonass`` of those dtypes, a row per record with the name of its satellite in one of the two,
    and ``klobuchar`` (n, 8) with ``klobuchar_system``. Raises LogError where the file holds no ephemeris."""
    text = read_rinex(path, "N")
    start, count, message = _find_records(text)
    system = text.lines.field(start, 0, 1)[:, 0]
    names = text.lines.satellites(start)
    needed = np.array([_LINES.get(chr(code), 0) for code in system], dtype=np.int64)
    other = (names == "") | (needed == 0) | ~np.isin(message, ["", *_MESSAGES])
    cut = ~other & (count < needed)
    usable = ~other & ~cut
    kepler = np.zeros(int(usable.sum()), KEPLER)
    glonass = np.zeros(int(usable.sum()), GLONASS)
    start, names = start[usable], names[usable]
    epoch_ns = _epochs(text.lines, start)
    is_glonass = names.astype("U1") == "R"
    kepler[~is_glonass] = _kepler(text.lines, start[~is_glonass], names[~is_glonass], epoch_ns[~is_glonass])
    glonass[is_glonass] = _glonass(text.lines, start[is_glonass], names[is_glonass], epoch_ns[is_glonass], leap)
    damaged = ~(_finite(kepler) & _finite(glonass)) | (epoch_ns == 0) | (np.abs(kepler["toe_sow"]) > WEEK_S)
    rejected = {
        "message of another kind": int(other.sum()),
        "record cut short": int(cut.sum()),
        "damaged ephemeris": int(damaged.sum()),
    }
    if damaged.all():
        why = ", ".join(f"{reason} {count}" for reason, count in rejected.items() if count) or "it is empty"
        raise LogError(
            f"{path}: the navigation file holds no ephemeris that can be read, of {len(usable)} records ({why}); those of GPS, "
            "Galileo, BeiDou, QZSS and GLONASS can be"
        )
    columns = {"kepler": kepler[~damaged], "glonass": glonass[~damaged]}
    columns["klobuchar"], columns["klobuchar_system"] = _klobuchar(text, int((~damaged).sum()))
    times = np.where(is_glonass, glonass["toe_ns"], kepler["toe_ns"])[~damaged]
    columns["t_gps_ns"] = times
    return Table(times, columns, len(usable), {reason: n for reason, n in rejected.items() if n})


def _find_records(text: RinexText) -> tuple[NDArray[np.intp], NDArray[np.int64], NDArray[np.str_]]:
    """First line of each ephemeris, the number of its lines, and (RINEX 4) the kind of its message."""
    lines = text.lines
    rows = np.arange(len(lines))
    first = lines.field(rows, 0, 1)[:, 0] if len(lines) else np.empty(0, np.uint8)
    marks = np.flatnonzero(first == ord(">"))
    letters = np.flatnonzero(np.isin(first, np.frombuffer(b"GRECJIS", np.uint8)))
    bounds = np.union1d(letters, marks)
    after = np.append(bounds, len(lines))[np.searchsorted(bounds, letters, side="right")]
    kinds = {int(mark): lines.text(int(mark)).split() for mark in marks}
    message = [
        (kinds[start - 1][3:4] or [""])[0] if start - 1 in kinds and kinds[start - 1][1:2] == ["EPH"] else ""
        for start in letters.tolist()
    ]
    return letters, after - letters, np.array(message, dtype="U4")


def _epochs(lines: Lines, start: NDArray[np.intp]) -> Times:
    """Calendar times of the records, in nanoseconds since 1980-01-06 of whatever scale; 0 where there is none."""
    unix_ns, good = calendar_ns(lines, start, _CALENDAR)
    return np.where(good, unix_ns - GPS_EPOCH_UNIX_S * _S, 0)


def _value(lines: Lines, start: NDArray[np.intp], line: int, place: int) -> Floats:
    return exponent_numbers(lines.field(start + line, 4 + 19 * place, 19))


def _whole(values: Floats) -> NDArray[np.int64]:
    """Flags (n,); all bits set where there is no number, or one too large for any."""
    return np.where(np.abs(values) < _LARGEST_FLAGS, values, -1).astype(np.int64)


def _kepler(lines: Lines, start: NDArray[np.intp], names: np.ndarray, epoch_ns: Times) -> NDArray[np.void]:
    records = np.zeros(len(start), KEPLER)
    records["sat"] = names
    for name, (line, place) in _KEPLER_FIELDS.items():
        records[name] = _value(lines, start, line, place)
    system = names.astype("U1")
    behind_ns = np.where(system == "C", _BDT_BEHIND_GPS_S * _S, 0)
    toc_sow = epoch_ns / _S % WEEK_S
    # The week written beside toe is wrong by a rollover in some files; toe is never half a week from toc.
    apart = (np.nan_to_num(records["toe_sow"]) - toc_sow + WEEK_S / 2) % WEEK_S - WEEK_S / 2
    records["toc_ns"] = epoch_ns + behind_ns
    records["toe_ns"] = records["toc_ns"] + np.rint(apart * _S).astype(np.int64)
    tgd = np.column_stack([_value(lines, start, 6, 2), _value(lines, start, 6, 3)])
    tgd[np.isin(system, ["G", "J"]), 1] = 0.0
    records["tgd"] = np.nan_to_num(tgd)
    records["health"] = _whole(_value(lines, start, 6, 1))
    sources = _whole(_value(lines, start, 5, 1))
    records["fnav"] = (system == "E") & ((sources & 0b10) != 0) & ((sources & 0b101) == 0)
    return records


def _glonass(lines: Lines, start: NDArray[np.intp], names: np.ndarray, epoch_ns: Times, leap: LeapSeconds) -> NDArray[np.void]:
    records = np.zeros(len(start), GLONASS)
    records["sat"] = names
    records["toe_ns"] = gps_from_utc(epoch_ns + GPS_EPOCH_UNIX_S * _S, leap)
    records["tau"] = -_value(lines, start, 0, 1)
    records["gamma"] = _value(lines, start, 0, 2)
    for axis in range(3):
        for place, name in enumerate(("pos", "vel", "acc")):
            records[name][:, axis] = _value(lines, start, axis + 1, place) * 1e3
    records["health"] = _whole(_value(lines, start, 1, 3))
    records["channel"] = np.nan_to_num(_value(lines, start, 2, 3))
    return records


def _finite(records: NDArray[np.void]) -> NDArray[np.bool_]:
    """Rows without a NaN; rows of the other dtype are all zero and pass."""
    good = np.ones(len(records), dtype=bool)
    for name in records.dtype.names or ():
        values = records[name]
        if values.dtype.kind == "f":
            good &= np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
    return good


def _klobuchar(text: RinexText, n: int) -> tuple[Floats, NDArray[np.str_]]:
    """Alpha and beta (n, 8) of the header (RINEX 3) or of the last message (RINEX 4), NaN where there are none, and the system
    (n,) whose model they are for: GPS, or BeiDou where there is no other."""
    found = {content[:4]: content for content, label in text.header if label == "IONOSPHERIC CORR"}
    for alpha, beta, system in (("GPSA", "GPSB", "G"), ("QZSA", "QZSB", "G"), ("BDSA", "BDSB", "C")):
        if alpha in found and beta in found:
            parts = [found[key][5 + 12 * i : 17 + 12 * i] for key in (alpha, beta) for i in range(4)]
            numbers = exponent_numbers(np.array([list(part.ljust(12).encode()[:12]) for part in parts], dtype=np.uint8))
            return np.tile(numbers, (n, 1)), np.full(n, system)
    for system, kind in (("G", "LNAV"), ("C", "D1D2")):
        numbers = _last_message(text, system, kind)
        if np.isfinite(numbers).all():
            return np.tile(numbers, (n, 1)), np.full(n, system)
    return np.full((n, 8), np.nan), np.full(n, "G")


def _last_message(text: RinexText, system: str, kind: str) -> Floats:
    """The eight numbers of the last ionosphere message of a kind (RINEX 4), NaN where there is none."""
    lines = text.lines
    marks = lines.beginning_with(b">").tolist() if text.version >= 4 else []
    for row in reversed(marks):
        words = lines.text(row).split()
        if words[1:2] == ["ION"] and words[2:3] and words[2][0] == system and words[3:4] == [kind]:
            rows = np.minimum([row + 1] * 3 + [row + 2] * 4 + [row + 3], len(lines) - 1)
            places = [1, 2, 3, 0, 1, 2, 3, 0]
            return np.array([_value(lines, rows[i : i + 1], 0, place)[0] for i, place in enumerate(places)])
    return np.full(8, np.nan)
