"""Where satellites were when they sent what was received, and what their clocks showed.

The time of transmission by the satellite's clock is the receiver's stamp minus pseudorange / c, whatever the receiver's clock
shows; the satellite's own clock offset then gives it in GPS time (IS-GPS-200N, 20.3.3.3.3).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.rows.signals import SPEED_OF_LIGHT, carrier_hz
from importers.satellites.ephemeris import Ephemerides, nearest_records
from importers.satellites.glonass import glonass_clock, glonass_states
from importers.satellites.kepler import kepler_clock, kepler_states
from navreplay.timeline import Floats, Times

__all__ = ["FAULTS", "SatelliteStates", "satellite_states"]

FAULTS = ("", "no ephemeris", "ephemeris beyond its validity", "satellite unhealthy", "damaged ephemeris")
"""Why a satellite has no state; the first means that it has one."""

_NONE, _OLD, _UNHEALTHY, _DAMAGED = 1, 2, 3, 4
_HEALTH_BITS = {"G": 0x3F, "C": 0x1, "J": 0x3E, "E": 0x7, "R": 0x7}
"""The bits that concern L1, E1 or B1; of QZSS the lowest is that of L6."""
_LOWEST_M, _HIGHEST_M = 8e6, 6e7
"""Of the largest coordinate."""


@dataclass(frozen=True, eq=False, slots=True)
class SatelliteStates:
    """pos, vel: (n, 3) at transmission, in Earth-fixed axes of that time. clock: (n,) [s] with relativity and group delay of
    the signal; drift: (n,). fault: (n,) index into `FAULTS`; where it is not zero, the rest is NaN."""

    pos: Floats
    vel: Floats
    clock: Floats
    drift: Floats
    fault: NDArray[np.int8]


def satellite_states(
    ephemerides: Ephemerides, sat: np.ndarray, signal: np.ndarray, t_ns: Times, pseudorange: Floats
) -> SatelliteStates:
    """States at transmission of the signals (n,) of satellites (n,) that were received at t_ns (n,) with a pseudorange (n,) [m]
    as measured."""
    n = len(sat)
    states = SatelliteStates(
        np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.full(n, np.nan), np.full(n, np.nan), np.full(n, _NONE, np.int8)
    )
    flight_s = pseudorange / SPEED_OF_LIGHT
    glonass = sat.astype("U1") == "R"
    for rows, records in ((~glonass, ephemerides.kepler), (glonass, ephemerides.glonass)):
        _fill_broadcast(states, np.flatnonzero(rows), records, sat, signal, t_ns, flight_s)
    if ephemerides.precise is not None:
        _fill_precise(states, ephemerides, sat, signal, t_ns, flight_s)
    reach = np.abs(states.pos).max(axis=1)
    damaged = (states.fault == 0) & ~((reach > _LOWEST_M) & (reach < _HIGHEST_M) & (np.abs(states.clock) < 0.1))
    states.fault[damaged] = _DAMAGED
    for values in (states.pos, states.vel, states.clock, states.drift):
        values[states.fault != 0] = np.nan
    return states


def _fill_broadcast(
    states: SatelliteStates,
    rows: NDArray[np.intp],
    records: NDArray[np.void],
    sat: np.ndarray,
    signal: np.ndarray,
    t_ns: Times,
    flight_s: Floats,
) -> None:
    index, valid = nearest_records(records, sat[rows], t_ns[rows])
    known = index >= 0
    states.fault[rows[known & ~valid]] = _OLD
    rows, index = rows[known & valid], index[known & valid]
    if len(rows) == 0:
        return
    when, flight = t_ns[rows], flight_s[rows]
    with np.errstate(all="ignore"):  # damaged records give NaN, which is told as a fault
        if "pos" in (records.dtype.names or ()):
            before = flight + glonass_clock(records, index, when, flight)
            pos, vel, clock, drift = glonass_states(records, index, when, before)
        else:
            before = flight + kepler_clock(records, index, when, flight)
            pos, vel, clock, drift = kepler_states(records, index, when, before)
            clock = clock - _group_delay(records, index, signal[rows])
    states.pos[rows], states.vel[rows], states.clock[rows], states.drift[rows] = pos, vel, clock, drift
    system = records["sat"].astype("U1")
    mask = np.select([system == name for name in _HEALTH_BITS], list(_HEALTH_BITS.values()), 0)
    states.fault[rows] = np.where(((records["health"] & mask) != 0)[index], _UNHEALTHY, 0)


def _fill_precise(
    states: SatelliteStates, ephemerides: Ephemerides, sat: np.ndarray, signal: np.ndarray, t_ns: Times, flight_s: Floats
) -> None:
    """Precise states where the table has them, with the group delay of the broadcast."""
    precise = ephemerides.precise
    assert precise is not None
    before = flight_s + np.nan_to_num(precise.clocks(sat, t_ns, flight_s))
    pos, vel, clock, drift = precise.states(sat, t_ns, before)
    known = np.isfinite(pos).all(axis=1) & np.isfinite(vel).all(axis=1) & np.isfinite(clock)
    known &= states.fault != _UNHEALTHY
    relativity = -2 * np.einsum("nx,nx->n", pos, vel) / SPEED_OF_LIGHT**2
    clock = clock + relativity
    index, valid = nearest_records(ephemerides.kepler, sat, t_ns)
    delayed = known & (index >= 0) & valid
    clock[delayed] -= _group_delay(ephemerides.kepler, index[delayed], signal[delayed])
    states.pos[known], states.vel[known] = pos[known], vel[known]
    states.clock[known], states.drift[known] = clock[known], np.nan_to_num(drift[known])
    states.fault[known] = 0


def _group_delay(records: NDArray[np.void], index: NDArray[np.intp], signal: np.ndarray) -> Floats:
    """Delay (n,) [s] of a signal (n,) against what the clock of its record describes. GPS, QZSS, Galileo: it grows with the
    inverse square of the carrier (IS-GPS-200N, 20.3.3.3.3.2). BeiDou: TGD1 for B1, TGD2 for B2I, none for B3I, on which its
    clock rests."""
    if len(index) == 0:
        return np.empty(0)
    names, code = np.unique(signal, return_inverse=True)
    table = np.stack([_record_delays(records, str(name)) for name in names], axis=1)
    return np.asarray(table[index, code])


def _record_delays(records: NDArray[np.void], signal: str) -> Floats:
    """Delays (m,) of one kind of signal by all records."""
    system = records["sat"].astype("U1")
    ratio = np.nan_to_num((1575.42e6 / carrier_hz(records["sat"], np.full(len(records), signal))) ** 2, nan=1.0)
    galileo = np.where(records["fnav"], records["tgd"][:, 0], records["tgd"][:, 1])
    beidou = records["tgd"][:, 0] if signal[:1] in ("1", "2") else records["tgd"][:, 1] * (signal[:1] == "7")
    return np.select([system == "E", system == "C"], [ratio * galileo, beidou], ratio * records["tgd"][:, 0])
