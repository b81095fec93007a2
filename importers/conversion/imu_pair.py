"""An inertial sensor on two channels: angular rates on one, accelerations on the other."""

from dataclasses import replace

import numpy as np

from importers.roles.sources import Joined
from navreplay.timeline import ChannelUse, Floats, LogError, Times

__all__ = ["join_accelerations"]

_LONGEST_GAP = 4.0


def join_accelerations(rates: Joined, forces: Joined, told: bool) -> tuple[Joined, tuple[ChannelUse, ...]]:
    """The rows of the angular rates with the accelerations of another channel, straight between its samples, and the use of
    that channel; as they are where they have accelerations of their own, unless told otherwise.

    Rows beyond the accelerations, or in a gap of more than four of their usual intervals, have none. Raises LogError where the
    other channel holds no accelerations.
    """
    if rates.rows.accel is not None and not told:
        return rates, tuple(_use(forces, used=False))
    if forces.rows.accel is None:
        raise LogError(
            f"{forces.name}: holds no accelerations (zero throughout), so it cannot serve as input.imu.accel_channel"
        )
    accel = _at(rates.t_ns, forces.t_ns, forces.rows.accel)
    note = f"{rates.name}: the accelerations are those of {forces.name}, taken between its samples at the times of the rates"
    notes = tuple(dict.fromkeys((*rates.notes, *forces.notes, note)))
    return replace(rates, rows=replace(rates.rows, accel=accel), notes=notes), tuple(_use(forces, used=True))


def _at(wanted: Times, t_ns: Times, vectors: Floats) -> Floats:
    """Vectors (n, 3) at the wanted times (n,), NaN where none are near."""
    known = np.flatnonzero(np.isfinite(vectors).all(axis=1))
    _, first = np.unique(t_ns[known], return_index=True)
    t_ns, vectors = t_ns[known][first], vectors[known][first]
    if len(t_ns) < 2:
        return np.full((len(wanted), 3), np.nan)
    after = np.clip(np.searchsorted(t_ns, wanted), 1, len(t_ns) - 1)
    step = t_ns[after] - t_ns[after - 1]
    near = (wanted >= t_ns[0]) & (wanted <= t_ns[-1]) & (step <= _LONGEST_GAP * np.median(np.diff(t_ns)))
    seconds, own = (wanted - t_ns[0]) / 1e9, (t_ns - t_ns[0]) / 1e9
    between = np.column_stack([np.interp(seconds, own, vectors[:, axis]) for axis in range(3)])
    return np.where(near[:, None], between, np.nan)


def _use(forces: Joined, used: bool) -> list[ChannelUse]:
    uses = []
    for source in forces.sources:
        rejected = dict(source.table.rejected) if used else {}
        read = source.table.read if used else 0
        role = source.role if used else "unused"
        uses.append(
            ChannelUse(
                source.channel.name, source.file, source.channel.type, role, read, read - sum(rejected.values()), rejected
            )
        )
    return uses
