"""RINEX 3 and 4 observation files: pseudoranges, Doppler and C/N0 of the preferred signals, by the column.

Source: RINEX 4.01 (IGS/RTCM), table A2 and A3. What a header says about the types decides what the columns mean, so a header
that contradicts itself is refused, and lines with more in them than it allows are rejected.
"""

from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from importers.rinex.text import Lines, RinexText, calendar_ns, plain_numbers, read_rinex
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


def is_rinex_observation(head: str) -> bool:
    """Whether the beginning of a file is a RINEX observation header."""
    first = head.split("\n", 1)[0]
    return first[60:80].startswith("RINEX VERSION") and first[20:21] == "O"


def read_rinex_observation(path: str, settings: RangeInput, leap: LeapSeconds) -> Table:
    """A row per satellite and preferred signal that has a pseudorange, columns as `importers.rows.ranges.range_rows` takes
    them.
    read counts these rows and the satellite lines that gave none. Raises LogError where the header contradicts itself, has
    none of the signals, or the file holds no observation.
    """
    text = read_rinex(path, "O")
    types = _read_types(path, text)
    wanted = {
        system: [code for code in settings.signals.get(system) or DEFAULT_SIGNALS[system] if f"C{code}" in types[system]]
        for system in settings.systems
        if system in types
    }
    if not any(wanted.values()):
        there = "; ".join(f"{system}: {', '.join(codes)}" for system, codes in types.items()) or "none"
        raise LogError(f"{path}: has none of the signals of input.range.signals; its header lists the types {there}")
    rejected: Counter[str] = Counter()
    rows, t_ns = _satellite_lines(text, leap, rejected)
    system = text.lines.field(rows, 0, 1)[:, 0]
    known = np.isin(system, [ord(name) for name in wanted])
    rejected["system not in input.range.systems"] += int((~known).sum())
    channels = _glonass_channels(text)
    parts = []
    for name, codes in wanted.items():
        own = system == ord(name)
        parts += _read_system(text.lines, rows[own], t_ns[own], types[name], codes, channels, rejected)
    if not parts:
        raise LogError(f"{path}: the observation file holds no pseudorange of a chosen signal; is it cut behind its header?")
    columns = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    counts = {reason: count for reason, count in rejected.items() if count}
    return Table(columns["t_gps_ns"], columns, len(columns["sat"]) + sum(counts.values()), counts)


def _read_types(path: str, text: RinexText) -> dict[str, list[str]]:
    """Observation types by system, in the order of the columns."""
    types: dict[str, list[str]] = {}
    announced: dict[str, str] = {}
    system = ""
    for content, label in text.header:
        if label == "SYS / SCALE FACTOR" and content.strip():
            raise LogError(f"{path}: its header scales observations (SYS / SCALE FACTOR), which is not read; write it without")
        if label != "SYS / # / OBS TYPES":
            continue
        if content[:1].strip():
            system = content[0]
            announced[system] = content[3:6].strip()
        types.setdefault(system, []).extend(content[6:].split())
    for system, codes in types.items():
        if announced.get(system) != str(len(codes)):
            said = announced.get(system) or "no number of"
            raise LogError(
                f"{path}: its header announces {said} observation types for {system or '?'} but lists {len(codes)}; the header "
                "is damaged, and the columns cannot be told"
            )
    if not types:
        raise LogError(f"{path}: its header lists no observation types (SYS / # / OBS TYPES); the header is damaged")
    return types


def _satellite_lines(text: RinexText, leap: LeapSeconds, rejected: Counter[str]) -> tuple[NDArray[np.intp], Times]:
    """Lines of satellites and their receive times; lines of damaged epochs and event records are left out."""
    lines = text.lines
    every = np.arange(len(lines))
    marks = np.flatnonzero(lines.field(every, 0, 1)[:, 0] == ord(">")) if len(lines) else np.empty(0, dtype=np.intp)
    t_ns, timed = _epoch_times(text, marks, leap)
    flag, count = (plain_numbers(lines.field(marks, first, width)) for first, width in ((31, 1), (32, 3)))
    follow = np.diff(np.append(marks, len(lines))) - 1
    event = np.isin(flag, _EVENTS)
    rejected["epoch without satellites"] += int((~event & timed & (follow == 0)).sum())
    epoch = np.searchsorted(marks, every, side="right") - 1
    body = np.setdiff1d(every, marks, assume_unique=True)
    body = body[epoch[body] >= 0]
    place = body - marks[epoch[body]]
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
    scale = next((content[48:51] for content, label in text.header if label == "TIME OF FIRST OBS"), "GPS")
    if scale == "GLO":
        return gps_from_utc(unix_ns, leap), good
    return unix_ns - GPS_EPOCH_UNIX_S * _S + (_BDT_BEHIND_GPS_S * _S if scale == "BDT" else 0), good


def _read_system(
    lines: Lines,
    rows: NDArray[np.intp],
    t_ns: Times,
    types: list[str],
    codes: list[str],
    channels: Mapping[str, float],
    rejected: Counter[str],
) -> list[dict[str, np.ndarray]]:
    """Columns of each code, of the lines of one system."""
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
        part = {"t_gps_ns": t_ns[there], "sat": sat[there], "signal": signal, "pseudorange": plain_numbers(chars[there])}
        for key, kind, factor in (("range_rate", "D", -SPEED_OF_LIGHT / carrier), ("cn0", "S", 1.0)):
            name = f"{kind}{code}"
            known = name in types
            values = plain_numbers(lines.field(rows[there], 3 + _STRIDE * types.index(name), _FIELD)) if known else np.nan
            part[key] = values * factor * np.ones(len(signal))
        parts.append(part)
    rejected["no pseudorange"] += int((~seen).sum())
    return [part for part in parts if len(part["sat"])]


def _glonass_channels(text: RinexText) -> dict[str, float]:
    """Frequency numbers of the header, by satellite."""
    words = " ".join(content[3:] for content, label in text.header if label == "GLONASS SLOT / FRQ #").split()
    channels = {}
    for sat, number in zip(words[::2], words[1::2], strict=False):
        if number.lstrip("+-").isdigit():
            channels[sat] = float(number)
    return channels
