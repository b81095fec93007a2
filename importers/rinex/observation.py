"""RINEX 2, 3 and 4 observation files: pseudoranges, Doppler and C/N0 of the preferred signals, by the column.

Source: RINEX 4.01 (IGS/RTCM), table A2 and A3. What a header says about the types decides what the columns mean, so a header
that contradicts itself is refused, and lines with more in them than it allows are rejected.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.rinex.text import Lines, RinexText, calendar_ns, header_line, is_compact, plain_numbers, read_rinex
from importers.rows.log import Table
from importers.rows.signals import DEFAULT_SIGNALS, SPEED_OF_LIGHT, carrier_hz
from importers.settings import RangeInput
from navreplay.geodesy.time_scales import GPS_EPOCH_UNIX_S, LeapSeconds, gps_from_utc
from navreplay.timeline import LogError, Times

__all__ = ["is_rinex_observation", "read_rinex_observation"]

_S = 1_000_000_000
_FIELD, _STRIDE = 14, 16
_BDT_BEHIND_GPS_S = 14
_MORE = 30
"""How many fields beyond those announced are looked for."""
_CALENDAR = ((2, 4), (7, 2), (10, 2), (13, 2), (16, 2), (18, 11))
_EVENTS = (2, 3, 4, 5, 6)
_NEW_HEADER = 4
_LABEL, _COMMENT = 60, b"COMMENT"
_SLOT = re.compile(r"R ?(\d{1,2}) *([-+]?\d)(?!\d)")
_OWN_SCALE = {"R": "GLO", "C": "BDT"}
"""The time of files of one system that do not tell theirs, where it is not GPS's (table A2, TIME OF FIRST OBS)."""


def is_rinex_observation(head: str) -> bool:
    """Whether the beginning of a file is a RINEX observation header, or one of Compact RINEX."""
    first = head.lstrip("\r\n").split("\n", 1)[0]
    return (first[60:80].startswith("RINEX VERSION") and first[20:21] == "O") or is_compact(head)


def read_rinex_observation(path: str, settings: RangeInput, leap: LeapSeconds) -> Table:
    """A row per satellite and preferred signal that has a pseudorange, columns as `importers.rows.ranges.range_rows` takes
    them.
    read counts these rows and the satellite lines that gave none. Raises LogError where a header contradicts itself, has
    none of the signals, or the file holds no observation.
    """
    text = read_rinex(path, "O")
    marks = text.lines.beginning_with(b">")
    layouts = _layouts(path, text, marks)
    wanted = [_wanted(layout, settings) for layout in layouts.types]
    if not any(codes for by_system in wanted for codes in by_system.values()):
        there = "; ".join(f"{system}: {', '.join(codes)}" for system, codes in layouts.types[0].items()) or "none"
        raise LogError(f"{path}: has none of the signals of input.range.signals; its header lists the types {there}")
    rejected: Counter[str] = Counter()
    rejected["epoch that Compact RINEX lost"] += text.lost
    rows, t_ns = _satellite_lines(text, marks, leap, rejected)
    layout = np.searchsorted(layouts.first, rows, side="right") - 1
    system = text.lines.field(rows, 0, 1)[:, 0]
    known = np.isin(system, [ord(name) for by_system in wanted for name in by_system])
    rejected["system not in input.range.systems"] += int((~known).sum())
    parts = []
    for number, by_system in enumerate(wanted):
        for name in sorted({name for each in wanted for name in each}):
            own = (system == ord(name)) & (layout == number)
            types, codes = layouts.types[number].get(name, []), by_system.get(name, [])
            scales = [layouts.factors[number].get((name, type), 1.0) for type in types]
            parts += _read_system(text.lines, rows[own], t_ns[own], types, scales, codes, layouts.channels, rejected)
    if not parts:
        raise LogError(f"{path}: the observation file holds no pseudorange of a chosen signal; is it cut behind its header?")
    columns = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    counts = {reason: count for reason, count in rejected.items() if count}
    return Table(columns["t_gps_ns"], columns, len(columns["sat"]) + sum(counts.values()), counts)


def _wanted(types: Mapping[str, list[str]], settings: RangeInput) -> dict[str, list[str]]:
    """By system, those of the signals asked for that have a pseudorange among its types."""
    return {
        system: [code for code in settings.signals.get(system) or DEFAULT_SIGNALS[system] if f"C{code}" in types[system]]
        for system in settings.systems
        if system in types
    }


@dataclass(frozen=True, eq=False, slots=True)
class _Layouts:
    """What the columns mean: types[i], by system, and factors[i], by system and type, that numbers were multiplied by, from
    line first[i] of the body on. channels: of GLONASS satellites."""

    first: NDArray[np.int64]
    types: tuple[dict[str, list[str]], ...]
    factors: tuple[Mapping[tuple[str, str], float], ...]
    channels: Mapping[str, float]


def _layouts(path: str, text: RinexText, marks: NDArray[np.intp]) -> _Layouts:
    """The types of the header, and each change of them by an event. Raises LogError."""
    first, types, told = [0], [_read_types(path, text.header)], [*text.header]
    factors = [_read_factors(text.header, types[0])]
    flags = plain_numbers(text.lines.field(marks, 31, 1))
    ends = np.append(marks, len(text.lines))[1:]
    for mark, end in zip(marks[flags == _NEW_HEADER].tolist(), ends[flags == _NEW_HEADER].tolist(), strict=True):
        records = [header_line(text.lines.text(row)) for row in range(mark + 1, end)]
        told += records
        first.append(mark)
        types.append(types[-1] | _read_types(path, records))
        factors.append(factors[-1] | _read_factors(records, types[-1]))
    if not types[0]:
        raise LogError(f"{path}: its header lists no observation types (SYS / # / OBS TYPES); the header is damaged")
    return _Layouts(np.array(first), tuple(types), tuple(factors), _glonass_channels(told))


def _read_factors(header: Sequence[tuple[str, str]], types: Mapping[str, list[str]]) -> dict[tuple[str, str], float]:
    """SYS / SCALE FACTOR by system and type; a line that lists no types is for all of its system."""
    factors: dict[tuple[str, str], float] = {}
    system, factor = "", 1.0
    for content, label in header:
        if label != "SYS / SCALE FACTOR":
            continue
        if content[:1].strip():
            system = content[0]
            factor = float(content[2:6]) if content[2:6].strip().isdigit() and int(content[2:6]) > 0 else 1.0
        factors |= {(system, name): factor for name in content[10:].split() or types.get(system, [])}
    return factors


def _read_types(path: str, header: Sequence[tuple[str, str]]) -> dict[str, list[str]]:
    """Observation types by system, in the order of the columns."""
    types: dict[str, list[str]] = {}
    announced: dict[str, str] = {}
    system = ""
    for content, label in header:
        if label != "SYS / # / OBS TYPES":
            continue
        if content[:1].strip():
            system = content[0]
            announced[system] = content[3:6].strip()
            types[system] = []
        types.setdefault(system, []).extend(content[6:].split())
    for system, codes in types.items():
        if announced.get(system) != str(len(codes)):
            said = announced.get(system) or "no number of"
            raise LogError(
                f"{path}: its header announces {said} observation types for {system or '?'} but lists {len(codes)}; the header "
                "is damaged, and the columns cannot be told"
            )
    return types


def _satellite_lines(
    text: RinexText, marks: NDArray[np.intp], leap: LeapSeconds, rejected: Counter[str]
) -> tuple[NDArray[np.intp], Times]:
    """Lines of satellites and their receive times; lines of damaged epochs and event records are left out."""
    lines = text.lines
    every = np.arange(len(lines))
    t_ns, timed = _epoch_times(text, marks, leap)
    flag, count = (plain_numbers(lines.field(marks, first, width)) for first, width in ((31, 1), (32, 3)))
    follow = np.diff(np.append(marks, len(lines))) - 1
    event = np.isin(flag, _EVENTS)
    rejected["epoch without satellites"] += int((~event & timed & (follow == 0)).sum())
    epoch = np.searchsorted(marks, every, side="right") - 1
    body = np.setdiff1d(every, marks, assume_unique=True)
    body = body[epoch[body] >= 0]
    comment = (lines.field(body, _LABEL, len(_COMMENT)) == np.frombuffer(_COMMENT, np.uint8)).all(axis=1) & ~event[epoch[body]]
    body = body[~comment]
    before = np.cumsum(np.bincount(epoch[body], minlength=len(marks))) - np.bincount(epoch[body], minlength=len(marks))
    place = np.arange(len(body)) - before[epoch[body]] + 1
    of_event = event[epoch[body]]
    surplus = ~of_event & (place > np.where(np.isnan(count), follow, count)[epoch[body]])
    untimed = ~of_event & ~timed[epoch[body]] & ~surplus
    rejected["more satellites than the epoch announces"] += int(surplus.sum())
    rejected["epoch line damaged"] += int(untimed.sum())
    good = body[~of_event & ~surplus & ~untimed]
    return good, t_ns[epoch[good]]


def _epoch_times(text: RinexText, marks: NDArray[np.intp], leap: LeapSeconds) -> tuple[Times, NDArray[np.bool_]]:
    """GPS time of the epochs, and whether each can be read."""
    unix_ns, good = calendar_ns(text.lines, marks, _CALENDAR)
    told = next((content[48:51] for content, label in text.header if label == "TIME OF FIRST OBS"), "")
    scale = told.strip() or _OWN_SCALE.get(_only_system(text), "GPS")
    if scale == "GLO":
        return gps_from_utc(unix_ns, leap), good
    return unix_ns - GPS_EPOCH_UNIX_S * _S + (_BDT_BEHIND_GPS_S * _S if scale == "BDT" else 0), good


def _only_system(text: RinexText) -> str:
    """The one system of a file, empty where there are several."""
    listed = {content[:1] for content, label in text.header if label == "SYS / # / OBS TYPES"} - {" "}
    return text.system if text.system not in ("", "M") else listed.pop() if len(listed) == 1 else ""


def _read_system(
    lines: Lines,
    rows: NDArray[np.intp],
    t_ns: Times,
    types: list[str],
    scales: list[float],
    codes: list[str],
    channels: Mapping[str, float],
    rejected: Counter[str],
) -> list[dict[str, np.ndarray]]:
    """Columns of each code, of the lines of one system. scales: of each type, what its numbers were multiplied by."""
    width = 3 + _STRIDE * len(types)
    surplus = lines.stop[rows] - lines.start[rows] > width
    surplus[surplus] = (lines.field(rows[surplus], width, _STRIDE * _MORE) != ord(" ")).any(axis=1)
    rejected["more observations than the header's types"] += int(surplus.sum())
    rows, t_ns = rows[~surplus], t_ns[~surplus]
    sat = lines.satellites(rows)
    channel = np.array([channels.get(str(name), np.nan) for name in sat])
    seen = np.zeros(len(rows), dtype=bool)
    parts = []
    for code in codes:
        chars = lines.field(rows, 3 + _STRIDE * types.index(f"C{code}"), _FIELD)
        there = (chars != ord(" ")).any(axis=1)
        seen |= there
        signal = np.full(int(there.sum()), code)
        carrier = carrier_hz(sat[there], signal, channel[there])
        pseudorange = plain_numbers(chars[there]) / scales[types.index(f"C{code}")]
        part = {"t_gps_ns": t_ns[there], "sat": sat[there], "signal": signal, "pseudorange": pseudorange}
        for key, kind, factor in (("range_rate", "D", -SPEED_OF_LIGHT / carrier), ("cn0", "S", 1.0)):
            name = f"{kind}{code}"
            values = np.full(len(signal), np.nan)
            if name in types:
                place = types.index(name)
                values = plain_numbers(lines.field(rows[there], 3 + _STRIDE * place, _FIELD)) / scales[place]
            part[key] = values * factor
        parts.append(part)
    rejected["no pseudorange"] += int((~seen).sum())
    return [part for part in parts if len(part["sat"])]


def _glonass_channels(header: Sequence[tuple[str, str]]) -> dict[str, float]:
    """Frequency numbers of the header, by satellite; some programs write them without the blanks between."""
    words = " ".join(content for content, label in header if label.startswith("GLONASS SLOT / FRQ"))
    return {f"R{int(number):02d}": float(channel) for number, channel in _SLOT.findall(words)}
