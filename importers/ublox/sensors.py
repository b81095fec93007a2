"""The inertial sensor inside u-blox receivers: ESF-RAW and ESF-MEAS as samples of angular rate and specific force.

Source: u-blox F9 HPS 1.30 interface description (UBX-22010984), 3.11; types and scales of the data: ZED-F9K integration manual
(UBX-20046189), table 11. The ticks of the sensors are on no known clock. They are tied to GPS time by the order of the messages
in the stream: what stands between two navigation epochs was measured between them, but for the delays of both.
"""

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import gather
from navreplay.timeline import Floats, Times

__all__ = ["samples_of_data", "sensor_samples", "signed_field", "unwrapped_ticks"]

_GYRO = ((14, 13, 5), np.pi / 180 * 2.0**-12)
_ACCEL = ((16, 17, 18), 2.0**-10)
_WRAP = 1 << 32
_MANY = 10


def sensor_samples(
    buffer: Buffer, start: Offsets, length: NDArray[np.int64], raw: bool, epoch_start: Offsets, epoch_ns: Times
) -> dict[str, np.ndarray]:
    """Columns ``t_gps_ns``, ``gyro`` (n, 3) [rad/s] and ``accel`` (n, 3) [m/s^2], in the axes of the sensor, one row per tick
    at which the gyroscope was read.

    start, length: of the payloads of ESF-RAW (raw) or ESF-MEAS. epoch_start, epoch_ns: where the navigation epochs stand in
    the stream, and their GPS times.
    """
    place, tick, kind, value = _data(buffer, start, length, raw)
    tick = unwrapped_ticks(tick)
    return samples_of_data(tick, kind, value, *_tied(place, tick, epoch_start, epoch_ns))


def samples_of_data(
    tick: NDArray[np.int64], kind: NDArray[np.int64], value: Floats, first: int, nanoseconds: float
) -> dict[str, np.ndarray]:
    """Columns as `sensor_samples`, of data (n,) with their types and ticks that count on. first: GPS time of tick 0 [ns], and
    nanoseconds per tick, 0 where they are unknown (then all times are 0)."""
    base = np.unique(tick[kind == _GYRO[0][2]])
    gyro, accel = (
        np.column_stack([_at(base, tick[kind == code], value[kind == code]) for code in codes]) * scale
        for codes, scale in (_GYRO, _ACCEL)
    )
    t_ns = first + np.rint(base * nanoseconds).astype(np.int64) if nanoseconds else np.zeros(len(base), dtype=np.int64)
    return {"t_gps_ns": t_ns, "gyro": gyro, "accel": accel}


def _data(
    buffer: Buffer, start: Offsets, length: NDArray[np.int64], raw: bool
) -> tuple[Offsets, NDArray[np.int64], NDArray[np.int64], Floats]:
    """Place in the stream, tick, type and value of every datum."""
    head, each = (4, 8) if raw else (8, 4)
    heads = gather(buffer, start, 8)
    announced = (heads[:, 5].astype(np.int64) >> 3) if not raw else (length - head) // each
    count = np.minimum(announced, (length - head) // each)
    message = np.repeat(np.arange(len(start)), count)
    within = np.arange(len(message)) - np.repeat(np.cumsum(count) - count, count)
    words = np.ascontiguousarray(gather(buffer, start[message] + head + within * each, each)).view("<u4").astype(np.int64)
    tick = words[:, 1] if raw else np.ascontiguousarray(heads[:, :4]).view("<u4")[:, 0].astype(np.int64)[message]
    return start[message], tick, (words[:, 0] >> 24) & 0x3F, signed_field(words[:, 0])


def signed_field(word: NDArray[np.int64]) -> Floats:
    """The lower 24 bits of data words (n,), signed."""
    field = word & 0xFFFFFF
    return np.where(field >= 1 << 23, field - (1 << 24), field).astype(float)


def unwrapped_ticks(tick: NDArray[np.int64]) -> NDArray[np.int64]:
    """Ticks (n,) of 32 bits that count on."""
    step = (np.diff(tick, prepend=tick[:1]) + _WRAP // 2) % _WRAP - _WRAP // 2
    return np.cumsum(step)


def _tied(place: Offsets, tick: NDArray[np.int64], epoch_start: Offsets, epoch_ns: Times) -> tuple[int, float]:
    """GPS time of tick 0, and nanoseconds per tick: the straight line through the middles of the navigation epochs between
    which each datum stands; (0, 0) where there are too few of either."""
    after = np.searchsorted(epoch_start, place)
    inside = (after > 0) & (after < len(epoch_start))
    if inside.sum() < _MANY or len(np.unique(tick[inside])) < _MANY:
        return 0, 0.0
    first = int(epoch_ns[0])
    middle = (epoch_ns[after[inside] - 1] - first) / 2 + (epoch_ns[after[inside]] - first) / 2
    slope, offset = np.polyfit(tick[inside].astype(float), middle, 1)
    return first + round(offset), float(slope)


def _at(base: NDArray[np.int64], tick: NDArray[np.int64], value: Floats) -> Floats:
    """Values (n,) at the ticks base (n,), straight between their own; NaN beyond these, and where there are none."""
    if len(tick) == 0:
        return np.full(len(base), np.nan)
    order = np.argsort(tick, kind="stable")
    return np.interp(base, tick[order], value[order], left=np.nan, right=np.nan)
