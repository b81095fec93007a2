"""When a log was made, by the channel that tells it soonest."""

from importers.roles.messages import kind_of
from importers.rows.log import Log
from navreplay.geodesy.time_scales import gps_from_utc
from navreplay.timeline import LogError

__all__ = ["AIDS", "Span", "roles_of", "shared_time", "time_span"]

Span = tuple[int, int]
"""First and last time [ns of GPS time]."""
AIDS = frozenset({"fix", "range", "attitude"})
_TELLING = AIDS | {"velocity", "imu"}
_RECORDED = frozenset({"cdr", "ros1", "json", "protobuf"})
"""Encodings of messages, whose recorders count in UTC; all other formats come in GPS time."""
_CALENDAR_NS = 10**17
"""Three years: what lies before is no date, but counts from power-on or in a week."""
_SCALES_APART_NS = 20 * 10**9


def roles_of(log: Log) -> frozenset[str]:
    """What the channels of a log can serve as."""
    kinds = [kind_of(channel) for channel in log.channels()]
    return frozenset(kind.roles[0] for kind in kinds if kind is not None and kind.automatic)


def time_span(log: Log) -> Span | None:
    """By the receive times of its smallest channel of measurements, which costs least to read; None where these are no dates,
    or it cannot be read."""
    telling = []
    for channel in log.channels():
        kind = kind_of(channel)
        if kind is not None and kind.automatic and kind.roles[0] in _TELLING:
            telling.append((kind.roles[0] == "imu", channel.count or 0, channel.name, channel.encoding))
    if not telling:
        return None
    _, _, name, encoding = min(telling)
    try:
        t_ns = log.read((name,))[name].log_time_ns
    except LogError:
        return None  # the drive tells why when it is processed
    if not len(t_ns) or t_ns.min() < _CALENDAR_NS:
        return None
    if encoding in _RECORDED:
        t_ns = gps_from_utc(t_ns)
    return int(t_ns.min()), int(t_ns.max())


def shared_time(one: Span, other: Span) -> int:
    """How long both last [ns], 0 where that is less than half of the shorter. Some recorders count in
    GPS time, whatever they say, hence the leap seconds."""
    overlap = min(one[1], other[1]) - max(one[0], other[0]) + _SCALES_APART_NS
    return overlap if overlap > 0.5 * min(one[1] - one[0], other[1] - other[0]) + _SCALES_APART_NS / 2 else 0
