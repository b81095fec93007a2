"""A log whose messages are read by mappings: those of the configuration, and what is known of drivers."""

from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase

import numpy as np

from importers.decoding.channel_reading import require_channels
from importers.drivers.packages import meanings_of
from importers.meanings.esf_messages import ESF_NOTE, esf_samples
from importers.meanings.mapped_messages import fits_fields, map_table
from importers.meanings.nmea_messages import sentence_fixes
from importers.meanings.novatel_release import check_release
from importers.message_settings import MessageMapping, MessageTime
from importers.rows.log import Channel, Log, Table
from navreplay.geodesy.time_scales import LeapSeconds
from navreplay.timeline import LogError

__all__ = ["CONVERTED", "MappedLog", "unused_mappings"]

_FIRST_RANK = 1
_LAST_RANK = 9

Conversion = Callable[[Table, LeapSeconds], Table]
CONVERTED: Mapping[str, tuple[Conversion, str, str]] = {
    "nmea_msgs/Sentence": (sentence_fixes, "nmea", ""),
    "ublox_msgs/EsfRAW": (esf_samples, "message/imu_si", ESF_NOTE),
    "ublox_msgs/EsfMEAS": (esf_samples, "message/imu_si", ESF_NOTE),
    "ublox_ubx_msgs/UBXEsfMeas": (esf_samples, "message/imu_si", ESF_NOTE),
}
"""Types whose messages are no rows each: what makes a table of them, its layout, and a note."""


class MappedLog:
    """A log of messages, with the mappings that fit its channels.

    The first role of a channel keeps its name; each further one is a channel of its own, named ``topic#role``. A channel that
    no mapping fits stays as it is.
    """

    def __init__(self, log: Log, told: Sequence[MessageMapping], leap: LeapSeconds) -> None:
        self.path, self.format = log.path, log.format
        self._log = log
        self._leap = leap
        self._mapped: dict[str, tuple[Channel, tuple[MessageMapping, ...], bool]] = {}
        self._channels: list[Channel] = []
        for channel in log.channels():
            self._add(channel, told)

    def _add(self, channel: Channel, told: Sequence[MessageMapping]) -> None:
        """Takes up a channel, once for each role that its mappings give it."""
        bundled = tuple(mapping for mapping in meanings_of(channel.type.partition("/")[0]) if _fits(channel, mapping))
        time = next((mapping.time for mapping in bundled if mapping.time is not None), None)
        own = tuple(_timed(mapping, time) for mapping in told if _fits(channel, mapping))
        known = own or bundled
        conversion = CONVERTED.get(channel.type.replace("/msg/", "/")) if not own else None
        if conversion is not None:
            layout, note = conversion[1:]
            self._channels.append(
                Channel(channel.name, channel.type, channel.encoding, channel.count, layout, _LAST_RANK, note)
            )
        elif not known:
            self._channels.append(channel)
        for place, role in enumerate(dict.fromkeys(mapping.role for mapping in known)):
            variants = tuple(mapping for mapping in known if mapping.role == role)
            rank = 0 if own else _FIRST_RANK + variants[0].rank
            name = channel.name if place == 0 else f"{channel.name}#{role}"
            layout = f"message/{_imu_layout(variants[0]) if role == 'imu' else role}"
            mapped = Channel(name, channel.type, channel.encoding, channel.count, layout, rank, variants[0].note)
            self._channels.append(mapped)
            self._mapped[name] = (channel, variants, bool(own))

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Log`."""
        return self._log.notes

    def channels(self) -> tuple[Channel, ...]:
        """See `Log`."""
        return tuple(self._channels)

    def read(self, names: tuple[str, ...]) -> dict[str, Table]:
        """See `Log`. Where a mapping names a field that the messages do not have, they are rejected for that."""
        require_channels(self.path, names, self._channels)
        beside = {name: self._beside(name) for name in names if name in self._mapped}
        wanted = [self._mapped[name][0].name if name in self._mapped else name for name in names]
        joined = [channel for channels in beside.values() for channel in channels.values()]
        tables = self._log.read(tuple(dict.fromkeys([*wanted, *joined])))
        return {
            name: self._map(name, tables[base], {kind: tables[channel] for kind, channel in beside.get(name, {}).items()})
            for name, base in zip(names, wanted, strict=True)
        }

    def _beside(self, name: str) -> dict[str, str]:
        """By type, the channels whose messages are joined to those of a channel."""
        channel, variants, _ = self._mapped[name]
        package = channel.type.partition("/")[0]
        types = {f"{package}/msg/{kind}": kind for mapping in variants for kind in mapping.beside}
        return {types[other.type]: other.name for other in self._log.channels() if other.type in types}

    def _map(self, name: str, table: Table, beside: Mapping[str, Table]) -> Table:
        """The table by its mapping; where that does not fit, every message is rejected for it."""
        if len(table.log_time_ns) == 0:
            return table
        try:
            return self._mapped_table(name, table, beside)
        except LogError as error:
            rejected = dict(table.rejected) | {str(error): len(table.log_time_ns)}
            return Table(np.empty(0, dtype=np.int64), {}, table.read, rejected)

    def _mapped_table(self, name: str, table: Table, beside: Mapping[str, Table]) -> Table:
        """Raises LogError where the mapping does not fit the messages."""
        if name not in self._mapped:
            type = next(channel.type for channel in self._channels if channel.name == name).replace("/msg/", "/")
            conversion = CONVERTED.get(type)
            return table if conversion is None else conversion[0](table, self._leap)
        channel, variants, told = self._mapped[name]
        if channel.type.startswith("novatel_") and not told:
            check_release(table.columns, channel.type)
        joined = _joined(table, beside, variants[0].key)
        mapping = next((variant for variant in variants if fits_fields(joined, variant)), variants[0])
        source = "the mapping [[input.message]]" if told else f"what is known of {channel.type}"
        return map_table(joined, mapping, self._leap, source)


def _timed(mapping: MessageMapping, time: MessageTime | None) -> MessageMapping:
    """The mapping, with the time that is known of its type where it names none."""
    return mapping if mapping.time is not None or time is None else mapping.model_copy(update={"time": time})


def unused_mappings(logs: Sequence[Log], told: Sequence[MessageMapping]) -> list[str]:
    """Sentences on mappings of the configuration that fit no channel of any log."""
    channels = [channel for log in logs for channel in log.channels()]
    unused = [mapping for mapping in told if not any(_fits(channel, mapping) for channel in channels)]
    there = ", ".join(f"{channel.name} ({channel.type})" for channel in channels) or "no channel at all"
    names = [" and ".join(name for name in (mapping.topic, mapping.type) if name is not None) for mapping in unused]
    return [f"the mapping [[input.message]] for {name} fits no channel and is not used; there is {there}" for name in names]


def _fits(channel: Channel, mapping: MessageMapping) -> bool:
    type = channel.type.replace("/msg/", "/")
    topic = channel.name.partition("#")[0]
    return (mapping.topic is None or fnmatchcase(topic, mapping.topic)) and (
        mapping.type is None or fnmatchcase(type, mapping.type.replace("/msg/", "/"))
    )


def _imu_layout(mapping: MessageMapping) -> str:
    if mapping.increments:
        return "imu_mean"
    return "imu_si" if mapping.units.keys() & {"gyro", "gyro_x"} and mapping.units.keys() & {"accel", "accel_x"} else "imu"


def _joined(table: Table, beside: Mapping[str, Table], key: str | None) -> Table:
    """The table with the fields of other types, by the key they share; NaN where none has the same."""
    columns = dict(table.columns)
    for kind, other in beside.items():
        if key is None or key not in table.columns or key not in other.columns or not len(other.log_time_ns):
            continue
        keys, first = np.unique(other.columns[key], return_index=True)
        place = np.minimum(np.searchsorted(keys, table.columns[key]), len(keys) - 1)
        found = keys[place] == table.columns[key]
        for name, column in other.columns.items():
            if column.dtype.kind in "fiu":
                values = column.astype(np.float64)[first[place]]
                values[~found] = np.nan
                columns[f"{kind}.{name}"] = values
    return Table(table.log_time_ns, columns, table.read, table.rejected)
