"""Types and layouts that hold ephemerides, and their tables as ephemerides."""

from collections.abc import Callable, Mapping

import numpy as np

from importers.broadcast.words import decode_words
from importers.rinex.sp3 import precise_orbits
from importers.roles.gnss_messages import gnss_comm_ephemerides, gnss_comm_glonass, sfrbx_columns
from importers.rows.log import Table
from importers.satellites.ephemeris import GLONASS, KEPLER, Ephemerides
from navreplay.geodesy.time_scales import LeapSeconds

__all__ = ["EPHEMERIS_TYPES"]

_CHANNEL_ZERO = 7

Reader = Callable[[Table, int, LeapSeconds], tuple[Ephemerides, Mapping[str, int]]]
"""Ephemerides of a table, and how many of its rows are of no use, by reason. The second argument is a GPS time near that of the
observations, by which weeks and days are told."""


def _rinex(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    kepler, glonass = table.columns["kepler"].astype(KEPLER), table.columns["glonass"].astype(GLONASS)
    klobuchar = table.columns["klobuchar"]
    known = klobuchar[np.isfinite(klobuchar).all(axis=1)]
    return (
        Ephemerides(
            kepler[kepler["sat"] != ""],
            glonass[glonass["sat"] != ""],
            known[-1] if len(known) else None,
            str(table.columns["klobuchar_system"][0]) if len(known) else "G",
        ),
        {},
    )


def _sp3(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    return Ephemerides(np.empty(0, KEPLER), np.empty(0, GLONASS), precise=precise_orbits(table)), {}


def _words(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    columns = sfrbx_columns(table.columns)
    gnss, number, frequency = (columns[name].astype(np.int64) for name in ("gnssId", "svId", "freqId"))
    ephemerides, known = decode_words(gnss, number, frequency - _CHANNEL_ZERO, columns["dwrd"], near_ns, leap)
    return ephemerides, {"message of another kind": int((~known).sum())} if not known.all() else {}


def _gnss_comm(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    return _told(gnss_comm_ephemerides(table.columns), np.empty(0, GLONASS), table)


def _gnss_comm_glonass(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    return _told(np.empty(0, KEPLER), gnss_comm_glonass(table.columns), table)


def _told(kepler: np.ndarray, glonass: np.ndarray, table: Table) -> tuple[Ephemerides, Mapping[str, int]]:
    lost = len(table.log_time_ns) - len(kepler) - len(glonass)
    return Ephemerides(kepler, glonass), {"no such satellite": lost} if lost else {}


def _ionosphere(table: Table, near_ns: int, leap: LeapSeconds) -> tuple[Ephemerides, Mapping[str, int]]:
    """Klobuchar's coefficients, as the u-blox driver beside gnss_comm publishes them."""
    arrays = [np.asarray(data, dtype=np.float64) for data in table.columns["data"]]
    known = [data for data in arrays if data.shape == (8,) and np.isfinite(data).all()]
    lost = len(table.log_time_ns) - len(known)
    nothing = np.empty(0, KEPLER), np.empty(0, GLONASS)
    return Ephemerides(*nothing, known[-1] if known else None), {"not eight numbers": lost} if lost else {}


EPHEMERIS_TYPES: Mapping[str, Reader] = {
    "rinex/navigation": _rinex,
    "rtcm/ephemerides": _rinex,
    "sbf/ephemerides": _rinex,
    "sp3": _sp3,
    "ubx/RXM-SFRBX": _words,
    "ublox_msgs/RxmSFRBX": _words,
} | {
    f"{package}/{name}": reader
    for package in ("gnss_comm", "gnss_comm_msgs")
    for name, reader in (
        ("GnssEphemMsg", _gnss_comm),
        ("GnssGloEphemMsg", _gnss_comm_glonass),
        ("StampedFloat64Array", _ionosphere),
    )
}
"""By type (without the ``/msg/`` of ROS 2)."""
