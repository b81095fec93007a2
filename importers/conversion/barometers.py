"""Rows of a barometer as a series."""

import numpy as np

from importers.roles.sources import Joined, account
from importers.rows.screening import Screening
from importers.rows.tables import drop_absurd
from navreplay.timeline import BaroSeries, ChannelUse, LogError

__all__ = ["convert_baro"]


def convert_baro(joined: Joined) -> tuple[BaroSeries, tuple[ChannelUse, ...], tuple[str, ...]]:
    """The series, its accounting, and what was assumed. Raises LogError where no row is usable."""
    rows, name = joined.rows, joined.name
    if rows.baro is None:
        raise LogError(f"{name}: holds no pressure")
    height = drop_absurd(rows.baro)
    screening = Screening(name, len(height))
    screening.reject(~np.isfinite(height), "not finite, or no pressure of air in pascal")
    order = screening.order(joined.t_ns)
    if len(order) == 0:
        raise LogError(f"{name}: none of its {len(height)} pressures is usable: {screening.rejected(slice(None))}")
    note = f"{name}: only changes of its height count, by the standard atmosphere"
    series = BaroSeries(joined.t_ns[order], height[order])
    return series, account(joined, screening), (*joined.notes, note, *screening.notes)
