"""Rows of wheels as a series: speed of the vehicle, ticks as speeds, turns by the difference of left and right."""

import numpy as np

from importers.roles.sources import Joined, account
from importers.rows.screening import Screening
from importers.rows.tables import Rows, drop_absurd
from importers.settings import SpeedInput
from navreplay.timeline import ChannelUse, Floats, LogError, SpeedSeries, Times

__all__ = ["convert_speed"]

_BITS = (8, 16, 32, 52)
"""Of counters of ticks."""
_WILD = 100.0
"""Against the usual rate of a counter: it was set back."""


def convert_speed(joined: Joined, settings: SpeedInput) -> tuple[SpeedSeries, tuple[ChannelUse, ...], tuple[str, ...]]:
    """The series, its accounting, and what was assumed. Raises LogError where no row is usable."""
    rows, name = joined.rows, joined.name
    if rows.wheels is None and rows.ticks is None:
        raise LogError(f"{name}: holds neither speed nor ticks of wheels")
    values = drop_absurd(rows.wheels if rows.wheels is not None else _known_counts(rows))
    whole = values[:, 0] if np.isfinite(values[:, 0]).any() else values[:, 1:].mean(axis=1)
    screening = Screening(name, len(whole))
    screening.reject(~np.isfinite(whole), "not finite")
    order = screening.order(joined.t_ns)
    if rows.ticks is not None and rows.wheels is None and len(order) < 2:
        raise LogError(f"{name}: {len(order)} counts of ticks make no speed")
    if len(order) == 0:
        raise LogError(f"{name}: none of its {len(whole)} speeds is usable: {screening.rejected(slice(None))}")
    t_ns, values, whole = joined.t_ns[order], values[order], whole[order]
    if rows.wheels is None:
        whole, values = _rates(t_ns, whole), np.column_stack([_rates(t_ns, column) for column in values.T])
    factor = 1.0 if settings.scale is None else settings.scale
    turn = (values[:, 1] - values[:, 2]) * factor / (settings.track_m or 1.0)
    if rows.turn is not None and np.isfinite(rows.turn[order]).any():
        turn = rows.turn[order]
    notes = [f"{name}: its speeds are taken as those of a land vehicle's wheels, forward positive"]
    return SpeedSeries(t_ns, whole * factor, turn), account(joined, screening), (*joined.notes, *notes, *screening.notes)


def _known_counts(rows: Rows) -> Floats:
    assert rows.ticks is not None
    return rows.ticks


def _rates(t_ns: Times, counts: Floats) -> Floats:
    """Counts (n,) a second, each over the interval that ends at its row. A counter of 8, 16 or 32 bits goes on where it turned
    over; where it was set back, the rate before stays."""
    if not np.isfinite(counts).any():
        return counts
    steps = np.diff(counts)
    bits = next((bits for bits in _BITS if np.nanmax(np.abs(counts)) < 2.0**bits), _BITS[-1])
    steps = np.where(np.abs(steps) > 2.0 ** (bits - 1), steps - np.copysign(2.0**bits, steps), steps)
    rates = steps / (np.diff(t_ns) / 1e9)
    wild = np.flatnonzero(np.abs(rates) > _WILD * max(float(np.nanquantile(np.abs(rates), 0.9)), 1e-9))
    for i in wild.tolist():
        rates[i] = rates[i - 1] if i else 0.0
    return np.concatenate([rates[:1], rates])
