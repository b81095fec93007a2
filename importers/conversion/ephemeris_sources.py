"""Reading the ephemerides of all channels that hold some."""

from collections.abc import Sequence

from importers.roles.ephemeris_messages import EPHEMERIS_TYPES
from importers.roles.sources import Source
from importers.satellites.ephemeris import Ephemerides, join_ephemerides
from navreplay.geodesy.time_scales import LeapSeconds
from navreplay.timeline import ChannelUse, LogError

__all__ = ["read_ephemerides"]


def read_ephemerides(sources: Sequence[Source], near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, tuple[ChannelUse, ...]]:
    """All ephemerides of the sources, and the accounting. Raises LogError where fields of a type are missing."""
    parts, uses = [], []
    for source in sources:
        table, channel = source.table, source.channel
        try:
            part, useless = EPHEMERIS_TYPES[channel.type.replace("/msg/", "/")](table, near_ns, leap)
        except KeyError as error:
            raise LogError(
                f"{source.file}: channel {channel.name} says it is {channel.type} but has no field {error.args[0]}"
            ) from error
        parts.append(part)
        rejected = dict(table.rejected)
        for reason, count in useless.items():
            rejected[reason] = rejected.get(reason, 0) + count
        used = table.read - sum(rejected.values())
        uses.append(ChannelUse(channel.name, source.file, channel.type, "ephemeris", table.read, used, rejected))
    return join_ephemerides(parts), tuple(uses)
