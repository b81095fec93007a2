"""Times of the rows of a table: counts of any unit, and dates as they are written."""

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from importers.rows.clock import count_ns, gps_from_gps_unix, is_time, unwrap_weeks
from importers.settings import CsvTime
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_tai, gps_from_utc, gps_from_week_tow
from navreplay.timeline import LogError, Times

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["check_rounding", "read_counts", "read_dates", "unit_of_counts", "unroll_32_bits"]

_UNIT_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_WEEK_S = 604_800
_HALF_32_BITS = 2.0**31
_DATE = re.compile(r"\s*(\d{1,4})[./-](\d{1,2})[./-](\d{1,4})[\sT,;]*(.*?)\s*")
_COMPACT = re.compile(r"\s*(\d{4})(\d\d)(\d\d)[T\s_-]*(\d\d):?(\d\d):?(\d\d(?:[.,]\d*)?)\s*(Z|UTC)?\s*")
_EXPONENT = re.compile(r"\s*[+-]?\d(?:[.,](\d*))?[eE]\+?(\d{1,2})\s*")
_COARSEST_S = 0.01


def unroll_32_bits(count: np.ndarray) -> tuple[np.ndarray, int]:
    """Counts (n,) without the turns of a counter of 32 bits, and how many there were: steps back by about 2^32 of counts that
    never reach it."""
    size = count.astype(np.float64)
    steps = np.diff(size)
    back = steps < -_HALF_32_BITS
    if not back.any() or not (np.nan_to_num(size) < 2 * _HALF_32_BITS).all() or (np.nan_to_num(size) < 0).any():
        return count, 0
    turns = np.concatenate([[0], np.cumsum(back) - np.cumsum(steps > _HALF_32_BITS)])  # a late row belongs before the turn
    whole = turns * int(2 * _HALF_32_BITS)
    return (count.astype(np.int64) if count.dtype.kind in "iu" else size) + whole, int(turns.max())


def unit_of_counts(count: np.ndarray, base: str, place: str) -> str:
    """The unit of counts (n,), by their size. Raises LogError, naming place, for counts from power-on that leave it open."""
    known = count[np.isfinite(count.astype(np.float64))].astype(np.float64)
    if len(known) == 0:
        return "s"
    if base == "gps_tow":
        return next((unit for unit, scale in _UNIT_S.items() if known.max() * scale <= _WEEK_S * 1.001), "s")
    if base == "boot":
        return _unit_of_steps(known, place)
    size = float(np.median(np.abs(known)))
    return "ns" if size > 1e17 else "us" if size > 1e14 else "ms" if size > 1e11 else "s"


def _unit_of_steps(known: np.ndarray, place: str) -> str:
    """Samples of a moving sensor come every 0.5 ms to 2 s; seconds go first, and where other units fit alike, none is taken."""
    steps = np.diff(known)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0  # rows of one fix repeat their stamp
    fitting = [unit for unit, scale in _UNIT_S.items() if 5e-4 <= step * scale <= 2]
    if len(fitting) == 1 or step <= 2:
        return fitting[0] if fitting else "s"
    raise LogError(
        f"{place}: its times {', '.join(f'{value:.9g}' for value in known[:2])} ... count from power-on in an unsaid unit; "
        "set time.unit to s, ms, us or ns"
    )


def read_counts(
    count: np.ndarray, week: np.ndarray | None, time: CsvTime, gps_week: int | None, leap: LeapSeconds, place: str
) -> tuple[Times, NDArray[np.bool_]]:
    """GPS time of the rows (n,) that have one, and which these are. Raises LogError where seconds of week have no week."""
    unit = unit_of_counts(count, time.base, place) if time.unit == "auto" else time.unit
    timed = is_time(count, unit)
    if week is not None:
        timed &= is_time(week)
    count = count[timed]
    if time.base == "gps_tow":
        tow_s = count * _UNIT_S[unit]
        weeks = unwrap_weeks(gps_week, tow_s, place) if week is None else week[timed].astype(np.int64)
        return gps_from_week_tow(weeks, tow_s), timed
    ns = count_ns(count, unit)
    if time.base in ("gps", "boot"):
        return ns, timed
    if time.base == "gps_unix":
        return gps_from_gps_unix(ns), timed
    return (gps_from_utc(ns, leap) if time.base == "utc" else gps_from_tai(ns)), timed


def check_rounding(cells: list[str], unit: str, place: str) -> None:
    """Raises LogError where stamps were written with too few digits, as a spreadsheet does."""
    for cell in cells:
        match = _EXPONENT.fullmatch(cell)
        if match is None:
            continue
        resolution = 10.0 ** (int(match.group(2)) - len(match.group(1) or ""))
        size = float(cell.replace(",", "."))
        scale = _UNIT_S["ns" if size > 1e17 else "us" if size > 1e14 else "ms" if size > 1e11 else "s"]
        if resolution * (scale if unit == "auto" else _UNIT_S[unit]) > _COARSEST_S:
            raise LogError(
                f"{place}: its times were rounded when they were written, as '{cell.strip()}' shows (a spreadsheet does that); "
                "export them again with all digits, or name another column with time.column"
            )
        return


def read_dates(cells: np.ndarray, day_first: bool | None, place: str) -> tuple[Times, NDArray[np.bool_]]:
    """Nanoseconds since 1970 of the dates (n,) that can be read, and which these are. Day and month are told apart by the whole
    column; raises LogError where it leaves both."""
    import pandas as pd

    texts = [_COMPACT.sub(r"\1-\2-\3 \4:\5:\6\7", str(cell).strip("[]\"' ")) for cell in cells]
    matches = [_DATE.fullmatch(text) for text in texts]
    parts = [match.groups() for match in matches if match is not None and len(match.group(1)) < 3]
    first_is_day = _day_first([(int(a), int(b)) for a, b, _, _ in parts], texts, day_first, place) if parts else False
    iso = [text if match is None else _iso(match, first_is_day) for text, match in zip(texts, matches, strict=True)]
    texts_of_iso = pd.Series(iso, dtype=object)
    stamps = _bounded(pd.to_datetime(texts_of_iso, format="ISO8601", errors="coerce", utc=True))
    odd = stamps.isna()
    if odd.any():
        stamps[odd] = _bounded(pd.to_datetime(texts_of_iso[odd], format="mixed", errors="coerce", utc=True))
    timed = stamps.notna().to_numpy()
    return stamps[timed].dt.tz_localize(None).to_numpy().astype("datetime64[ns]").astype(np.int64), timed


def _bounded(stamps: "pd.Series") -> "pd.Series":
    """Dates of this and the last century in nanoseconds; others are none."""
    return stamps.where(stamps.dt.year.between(1900, 2100)).dt.as_unit("ns")


def _day_first(parts: list[tuple[int, int]], texts: list[str], told: bool | None, place: str) -> bool:
    first, second = ({part[i] for part in parts} for i in (0, 1))
    if told is not None:
        return told
    if max(first) > 12 or max(second) > 12:
        if max(first) > 12 and max(second) > 12:
            return True  # rows that are no date either way are told as such
        return max(first) > 12
    if all("." in text[:6] for text in texts[:10]):
        return True
    if len(first) != len(second):
        return len(first) > len(second)  # days pass before months do
    if first == second:
        return True  # 04/04 is the same day either way
    raise LogError(
        f"{place}: '{texts[0]}' may be written day first or month first, and no row of the column decides it; set "
        "time.day_first = true, or false"
    )


def _iso(match: re.Match[str], first_is_day: bool) -> str:
    first, second, third, rest = match.groups()
    if len(first) > 2:
        year, month, day = first, second, third
    else:
        day, month = (first, second) if first_is_day else (second, first)
        year = third if len(third) > 2 else f"20{third:0>2}"
    rest = re.sub(r"(\d),(\d)", r"\1.\2", rest)
    return f"{year}-{month:0>2}-{day:0>2} {rest}".strip()
