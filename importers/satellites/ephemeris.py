"""Broadcast ephemerides as tables of records, and choosing the record for a satellite and a time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from importers.satellites.precise import PreciseOrbits
from navreplay.timeline import Floats, Times

__all__ = ["GLONASS", "KEPLER", "Ephemerides", "join_ephemerides", "nearest_records"]

KEPLER = np.dtype(
    [("sat", "U3"), ("toe_ns", "i8"), ("toc_ns", "i8")]
    + [(name, "f8") for name in ("af0", "af1", "af2", "toe_sow", "sqrt_a", "e", "m0", "delta_n", "i0", "idot", "omega0")]
    + [(name, "f8") for name in ("omega_dot", "omega", "cuc", "cus", "crc", "crs", "cic", "cis")]
    + [("tgd", "f8", 2), ("health", "i8"), ("fnav", "?")]
)
"""GPS, Galileo, BeiDou, QZSS. Names as in IS-GPS-200 (SI, radians). toe_ns, toc_ns: GPS time; toe_sow: toe in seconds of the
week of the system's own time. tgd: TGD; BGD of E5a and of E5b; TGD1 and TGD2 [s]. fnav: Galileo F/NAV."""

GLONASS = np.dtype(
    [("sat", "U3"), ("toe_ns", "i8"), ("pos", "f8", 3), ("vel", "f8", 3), ("acc", "f8", 3), ("tau", "f8"), ("gamma", "f8")]
    + [("channel", "f8"), ("health", "i8")]
)
"""GLONASS, PZ-90 [m, m/s, m/s^2]. toe_ns: GPS time. tau: offset of the satellite's clock with its sign turned, as broadcast
(RINEX holds -tau) [s]. channel: frequency number."""

_VALID_S = {"G": 7200.0, "E": 14400.0, "C": 21600.0, "J": 7200.0, "R": 1800.0}
"""How far from its reference time a record is good."""


@dataclass(frozen=True, eq=False, slots=True)
class Ephemerides:
    """What satellites have broadcast, and precise orbits beside it. kepler, glonass: records of the two dtypes, in any order.
    klobuchar: (8,) alpha0..3, beta0..3, None where unknown. klobuchar_system: the system whose model they belong to, G or C
    (QZSS uses that of GPS)."""

    kepler: NDArray[np.void]
    glonass: NDArray[np.void]
    klobuchar: Floats | None = None
    klobuchar_system: str = "G"
    precise: PreciseOrbits | None = None

    def __bool__(self) -> bool:
        return bool(len(self.kepler) or len(self.glonass) or self.precise is not None)


def join_ephemerides(parts: Sequence[Ephemerides]) -> Ephemerides:
    """All records; of the ionosphere's coefficients the last, BeiDou's only where there are none of GPS; of precise orbits the
    last."""
    ionosphere = [part for part in parts if part.klobuchar is not None]
    ionosphere.sort(key=lambda part: part.klobuchar_system == "G")
    precise = [part.precise for part in parts if part.precise is not None]
    return Ephemerides(
        np.concatenate([np.empty(0, KEPLER), *(part.kepler for part in parts)]),
        np.concatenate([np.empty(0, GLONASS), *(part.glonass for part in parts)]),
        ionosphere[-1].klobuchar if ionosphere else None,
        ionosphere[-1].klobuchar_system if ionosphere else "G",
        precise[-1] if precise else None,
    )


def nearest_records(records: NDArray[np.void], sat: np.ndarray, t_ns: Times) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Index (n,) of the record whose reference time is nearest to t_ns (n,), -1 where the satellite (n,) has none, and whether
    it is valid then. Of records for the same time the last counts; Galileo's I/NAV goes before its F/NAV."""
    index = np.full(len(sat), -1, dtype=np.intp)
    valid = np.zeros(len(sat), dtype=bool)
    if len(records) == 0 or len(sat) == 0:
        return index, valid
    names, inverse = np.unique(sat, return_inverse=True)
    rows_by_name = np.split(np.argsort(inverse, kind="stable"), np.cumsum(np.bincount(inverse))[:-1])
    for name, rows in zip(names, rows_by_name, strict=True):
        own = np.flatnonzero(records["sat"] == name)
        if "fnav" in (records.dtype.names or ()) and not records["fnav"][own].all():
            own = own[~records["fnav"][own]]
        if len(own) == 0:
            continue
        own = own[np.argsort(records["toe_ns"][own], kind="stable")]
        toe = records["toe_ns"][own]
        last = np.append(np.diff(toe) > 0, True)
        own, toe = own[last], toe[last]
        after = np.clip(np.searchsorted(toe, t_ns[rows]), 0, len(toe) - 1)
        before = np.maximum(after - 1, 0)
        best = np.where(np.abs(toe[after] - t_ns[rows]) <= np.abs(toe[before] - t_ns[rows]), after, before)
        index[rows] = own[best]
        valid[rows] = np.abs(toe[best] - t_ns[rows]) <= _VALID_S[str(name)[0]] * 1e9
    return index, valid
