"""Sources: the channels chosen for a role, read and joined, with their times and their accounting."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from importers.roles.heights import fill_unknown_heights
from importers.roles.messages import kind_of, stamp_column
from importers.rows.clock import LONGEST_ON_NS, NOMINAL_NS, gps_from_stamps
from importers.rows.log import Channel, Table
from importers.rows.message_fields import either_spelling
from importers.rows.screening import Screening
from importers.rows.stamps import mend_stamps
from importers.rows.tables import Rows
from importers.settings import AttitudeInput, BaroInput, FixInput, ImuInput, ReferenceInput, SpeedInput
from navreplay.geodesy.time_scales import LeapSeconds
from navreplay.timeline import ChannelUse, LogError, Times

__all__ = ["Clock", "Joined", "Source", "account", "join_sources"]

_EARLIEST_UNIX_NS = 631_152_000 * 10**9
_MOST_DELAY_NS = 5e9
_RESTART_NS = 10**9
_WITHOUT_ORIENTATION = frozenset({"imu", "accel"})
"""Roles that an orientation beside the rates serves nothing; of a long log it would be the larger part."""


@dataclass(frozen=True, eq=False, slots=True)
class Source:
    """A channel of a file with its table, to serve in a role."""

    file: str
    channel: Channel
    table: Table
    role: str


@dataclass(frozen=True, eq=False, slots=True)
class Clock:
    """What turns stamps into GPS time. time_references: tables of TimeReference channels, for stamps that count from
    power-on."""

    leap: LeapSeconds
    time_references: tuple[Table, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class Joined:
    """The rows of one or several sources in a row. name: for messages. t_ns: (n,) GPS time. parts: the slice of each source.
    notes: assumptions made."""

    name: str
    t_ns: Times
    rows: Rows
    sources: tuple[Source, ...]
    parts: tuple[slice, ...]
    notes: tuple[str, ...]


def join_sources(
    sources: Sequence[Source],
    settings: ImuInput | FixInput | AttitudeInput | BaroInput | SpeedInput | ReferenceInput,
    clock: Clock,
) -> Joined:
    """Joins the parts of a channel (a recording split into files) in the order of their first stamps. Raises LogError."""
    notes: list[str] = []
    timed = [(_mended(source, _times(source, settings, clock, notes), notes), source) for source in sources]
    timed.sort(key=lambda pair: int(pair[0][0]) if len(pair[0]) else 0)
    ordered = tuple(source for _, source in timed)
    rows = []
    for source in ordered:
        kind = kind_of(source.channel)
        if kind is None:
            raise LogError(
                f"{source.file}: channel {source.channel.name} of type {source.channel.type} cannot serve as {source.role}"
            )
        extracted, told = fill_unknown_heights(_extract(source))
        rows.append(extracted)
        if told:
            notes.append(f"{source.channel.name}: {told}")
        notes += [f"{source.channel.name}: {note}" for note in (kind.note, source.channel.note, *source.table.notes) if note]
    ends = np.cumsum([len(times) for times, _ in timed])
    parts = tuple(slice(int(end - len(times)), int(end)) for end, (times, _) in zip(ends, timed, strict=True))
    t_ns = np.concatenate([times for times, _ in timed])
    if len(t_ns) == 0:
        raise _nothing_readable(ordered[0])
    return Joined(ordered[0].channel.name, t_ns, _concatenate(rows), ordered, parts, tuple(dict.fromkeys(notes)))


def _mended(source: Source, t_ns: Times, notes: list[str]) -> Times:
    """Stamps without the batches of a driver and the steps of a clock."""
    by_recorder = (
        source.table.log_time_ns if source.channel.encoding != "text" and len(source.table.log_time_ns) == len(t_ns) else None
    )
    mended, told = mend_stamps(t_ns, by_recorder)
    notes += [f"{source.channel.name}: {note}" for note in told]
    return mended


def account(joined: Joined, screening: Screening) -> tuple[ChannelUse, ...]:
    """The accounting of every source."""
    uses = []
    for source, part in zip(joined.sources, joined.parts, strict=True):
        rejected = dict(source.table.rejected)
        for reason, count in screening.rejected(part).items():
            rejected[reason] = rejected.get(reason, 0) + count
        used = source.table.read - sum(rejected.values())
        uses.append(
            ChannelUse(source.channel.name, source.file, source.channel.type, source.role, source.table.read, used, rejected)
        )
    return tuple(uses)


def _extract(source: Source) -> Rows:
    kind = kind_of(source.channel)
    assert kind is not None
    if len(source.table.log_time_ns) == 0:
        return Rows()
    columns = source.table.columns
    if source.role in _WITHOUT_ORIENTATION:
        columns = {name: column for name, column in columns.items() if not name.startswith("orientation")}
    try:
        return kind.rows(either_spelling(columns))
    except KeyError as error:
        raise LogError(
            f"{source.file}: channel {source.channel.name} says it is {source.channel.type} but has no field {error.args[0]}"
        ) from error


def _nothing_readable(source: Source) -> LogError:
    lost = ", ".join(f"{count} {reason}" for reason, count in source.table.rejected.items())
    of = f" of {source.table.read} ({lost})" if lost else ""
    return LogError(f"{source.file}: channel {source.channel.name} holds no readable message{of}; {_LEAVE_OUT}")


_LEAVE_OUT = "name another channel, or leave it out (the setting that names the channel, set to 'none')"


def _concatenate(rows: Sequence[Rows]) -> Rows:
    """Rows end to end; a field that some of the parts lack is unknown there."""
    if len(rows) == 1:
        return rows[0]
    lengths = [_length(part) for part in rows]
    arrays: dict[str, Any] = {}
    for field in fields(Rows):
        values = [getattr(part, field.name) for part in rows]
        known = next((value for value in values if isinstance(value, np.ndarray)), None)
        if known is not None:
            parts = [_unknown(known, n) if value is None else value for value, n in zip(values, lengths, strict=True)]
            arrays[field.name] = np.concatenate(parts)
    filled = next((part for part, n in zip(rows, lengths, strict=True) if n), rows[0])
    return replace(filled, **arrays)


def _length(rows: Rows) -> int:
    return max((len(value) for field in fields(Rows) if isinstance(value := getattr(rows, field.name), np.ndarray)), default=0)


def _unknown(like: np.ndarray, n: int) -> np.ndarray:
    return np.full((n, *like.shape[1:]), np.nan if like.dtype.kind == "f" else 0, like.dtype)


def _times(
    source: Source,
    settings: ImuInput | FixInput | AttitudeInput | BaroInput | SpeedInput | ReferenceInput,
    clock: Clock,
    notes: list[str],
) -> Times:
    offset_ns = round(settings.time_offset_s * 1e9)
    name, table = source.channel.name, source.table
    if offset_ns:
        notes.append(f"{name}: {settings.time_offset_s:g} s were added to its stamps")
    if "t_gps_ns" in table.columns:
        t_ns = np.asarray(table.columns["t_gps_ns"], dtype=np.int64) + offset_ns
        return _dated(source.channel, t_ns, notes)
    stamps = stamp_column(table) if getattr(settings, "stamp", "header") == "header" else None
    if stamps is None:
        notes.append(f"{name}: timed by the clock of the recorder, taken as UTC")
        return gps_from_stamps(table.log_time_ns, "utc", clock.leap) + offset_ns
    stamps = np.asarray(stamps, dtype=np.int64)
    if settings.time_base == "boot" or (settings.time_base == "auto" and _counts_from_power_on(stamps, table)):
        shift, told = _boot_shift(stamps, table, clock)
        notes.append(f"{name}: its stamps count from power-on; {told}")
        return gps_from_stamps(stamps + shift, "utc", clock.leap) + offset_ns
    if settings.time_base == "auto":
        notes.append(f"{name}: its stamps are taken as UTC")
    return gps_from_stamps(stamps, settings.time_base, clock.leap) + offset_ns


def _dated(channel: Channel, t_ns: Times, notes: list[str]) -> Times:
    """Times of a table that count from power-on, on a day of their own, the same for all such tables: sensors of one clock
    agree though nobody knows the date."""
    if not channel.type.startswith("csv/") or len(t_ns) == 0 or not 0 <= t_ns.min() <= t_ns.max() < LONGEST_ON_NS:
        return t_ns
    notes.append(
        f"{channel.name}: its times count from power-on; they are told as if that had been at 2020-01-05 00:00 GPS time"
    )
    return t_ns + NOMINAL_NS


def _counts_from_power_on(stamps: Times, table: Table) -> bool:
    """Whether stamps are of no calendar, but advance with the clock of the recorder, which is."""
    if len(stamps) < 2 or np.median(stamps) >= _EARLIEST_UNIX_NS or np.median(table.log_time_ns) < _EARLIEST_UNIX_NS:
        return False
    delay = table.log_time_ns - stamps - _least_delays(stamps, table.log_time_ns)
    return bool(np.quantile(delay.astype(np.float64), 0.95) < _MOST_DELAY_NS)


def _boot_shift(stamps: Times, table: Table, clock: Clock) -> tuple[Times, str]:
    """What to add to stamps (n,) from power-on to get UTC [ns]. By the recorder it is the least delay seen, since delays only
    add."""
    for reference in clock.time_references:
        own = stamp_column(reference)
        if own is not None and len(own) and "time_ref" in reference.columns:
            shift = int(np.median(reference.columns["time_ref"].astype(np.int64) - own.astype(np.int64)))
            return np.full(len(stamps), shift), "they were set to UTC by the time-reference channel"
    restarts = int((np.diff(stamps) < -_RESTART_NS).sum())
    told = "they were set to UTC by the clock of the recorder (smallest delay)"
    if restarts:
        told += f", anew behind each of {restarts} restarts" if restarts > 1 else ", anew behind a restart"
    return _least_delays(stamps, table.log_time_ns), told


def _least_delays(stamps: Times, log_time_ns: Times) -> Times:
    """The least delay (n,) between stamp and recorder [ns] since the sensor's clock last began again."""
    shift = np.empty(len(stamps), dtype=np.int64)
    begins = np.flatnonzero(np.diff(stamps) < -_RESTART_NS) + 1
    for piece in np.split(np.arange(len(stamps)), begins):
        if len(piece):
            shift[piece] = np.min(log_time_ns[piece] - stamps[piece])
    return shift
