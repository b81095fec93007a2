"""GPSNav, QZSNav, GALNav, BDSNav, GLONav and GPSIon: broadcast ephemerides that Septentrio receivers have decoded.

Source: Septentrio mosaic-X5 reference guide, 4.2.4 to 4.2.9. Angles are in semicircles; times of the week in the system's own
time, in the week nearest to the block's time; GLONASS in kilometres, its reference time in GPS time.
"""

import numpy as np
from numpy.typing import NDArray

from importers.decoding.blocks import Buffer, Offsets
from importers.decoding.byte_rows import records
from importers.satellites.ephemeris import GLONASS, KEPLER
from importers.septentrio.fixes import known
from navreplay.geodesy.time_scales import WEEK_S
from navreplay.timeline import Times

__all__ = ["EPHEMERIS_BLOCKS", "ephemerides"]

_WEEK_NS = WEEK_S * 10**9
_BDT_BEHIND_GPS_NS = 14 * 10**9
_ANGLES = ("m0", "i0", "omega", "omega0", "omega_dot", "idot", "delta_n")
_ORBIT = [("crs", "<f4"), ("delta_n", "<f4"), ("m0", "<f8"), ("cuc", "<f4"), ("e", "<f8"), ("cus", "<f4"), ("sqrt_a", "<f8")]
_ORBIT += [("toe", "<u4"), ("cic", "<f4"), ("omega0", "<f8"), ("cis", "<f4"), ("i0", "<f8"), ("crc", "<f4"), ("omega", "<f8")]
_ORBIT += [("omega_dot", "<f4"), ("idot", "<f4"), ("weeks", "<u2", 2)]
_CLOCK = [("toc", "<u4"), ("af2", "<f4"), ("af1", "<f4"), ("af0", "<f4")]
_GPS = np.dtype(
    [("svid", "u1"), ("reserved", "u1"), ("week", "<u2"), ("codes", "u1"), ("accuracy", "u1"), ("health", "u1"), ("flag", "u1")]
    + [("iodc", "<u2"), ("iode", "u1", 2), ("fit", "u1"), ("reserved2", "u1"), ("tgd", "<f4"), *_CLOCK, *_ORBIT]
)
_BEIDOU = np.dtype(
    [("svid", "u1"), ("reserved", "u1"), ("week", "<u2"), ("accuracy", "u1"), ("health", "u1"), ("issues", "u1", 2)]
    + [("reserved2", "<u2"), ("tgd", "<f4", 2), *_CLOCK, *_ORBIT]
)
_GALILEO = np.dtype(
    [("svid", "u1"), ("source", "u1"), ("sqrt_a", "<f8"), ("m0", "<f8"), ("e", "<f8"), ("i0", "<f8"), ("omega", "<f8")]
    + [("omega0", "<f8"), ("omega_dot", "<f4"), ("idot", "<f4"), ("delta_n", "<f4"), ("cuc", "<f4"), ("cus", "<f4")]
    + [("crc", "<f4"), ("crs", "<f4"), ("cic", "<f4"), ("cis", "<f4"), ("toe", "<u4"), ("toc", "<u4"), ("af2", "<f4")]
    + [("af1", "<f4"), ("af0", "<f8"), ("weeks", "<u2", 2), ("issue", "<u2"), ("health", "<u2"), ("prs", "u1")]
    + [("accuracies", "u1", 3), ("tgd", "<f4", 2), ("bgd_e6", "<f4"), ("encrypted", "u1")]
)
_GLONASS_BLOCK = np.dtype(
    [("svid", "u1"), ("frequency", "u1"), ("pos", "<f8", 3), ("vel", "<f4", 3), ("acc", "<f4", 3), ("gamma", "<f4")]
    + [("tau", "<f4"), ("dtau", "<f4"), ("toe", "<u4"), ("week", "<u2"), ("p", "u1", 2), ("age", "u1"), ("health", "u1")]
)
_IONOSPHERE = np.dtype([("svid", "u1"), ("reserved", "u1"), ("values", "<f4", 8)])
_ION = 5893
_KEPLER_BLOCKS = {5891: ("G", _GPS, 0), 4095: ("J", _GPS, 180), 4002: ("E", _GALILEO, 70), 4081: ("C", _BEIDOU, 140)}
"""By number of the block: system, layout, and what to subtract from the receiver's number of a satellite."""
_GLONASS_NUMBER, _GLONASS_LESS, _LATE_BEIDOU, _LATE_BEIDOU_LESS = 4004, 37, 223, 182
_FNAV = 16
EPHEMERIS_BLOCKS = (*_KEPLER_BLOCKS, _GLONASS_NUMBER, _ION)


def ephemerides(
    buffer: Buffer, start: Offsets, size: NDArray[np.int64], number: NDArray[np.int64], t_ns: Times
) -> dict[str, np.ndarray]:
    """Columns as those of a navigation file, a row per ephemeris, of blocks at start (n,) of a number (n,)."""
    kepler = [np.empty(0, KEPLER)]
    for kind, (system, layout, less) in _KEPLER_BLOCKS.items():
        own = (number == kind) & (size >= layout.itemsize) & (t_ns > 0)
        kepler.append(_kepler(records(buffer, start[own], layout), t_ns[own], system, less))
    own = (number == _GLONASS_NUMBER) & (size >= _GLONASS_BLOCK.itemsize) & (t_ns > 0)
    glonass = _glonass(records(buffer, start[own], _GLONASS_BLOCK), t_ns[own])
    own = (number == _ION) & (size >= _IONOSPHERE.itemsize)
    told = records(buffer, start[own], _IONOSPHERE)["values"].astype(np.float64)
    all_kepler = np.concatenate(kepler)
    n, k = len(all_kepler) + len(glonass), len(all_kepler)
    columns = {"kepler": np.zeros(n, KEPLER), "glonass": np.zeros(n, GLONASS)}
    columns["kepler"][:k], columns["glonass"][k:] = all_kepler, glonass
    columns["klobuchar"] = np.tile(told[-1] if len(told) else np.full(8, np.nan), (n, 1))
    columns["klobuchar_system"] = np.full(n, "G")
    columns["t_gps_ns"] = np.concatenate([all_kepler["toe_ns"], glonass["toe_ns"]]).astype(np.int64)
    return columns


def _near(seconds: NDArray[np.integer], near_ns: Times) -> Times:
    """Seconds of the week (n,) as times in the weeks nearest to near_ns (n,)."""
    return near_ns + (seconds.astype(np.int64) * 10**9 - near_ns + _WEEK_NS // 2) % _WEEK_NS - _WEEK_NS // 2


def _kepler(rows: NDArray[np.void], t_ns: Times, system: str, less: int) -> NDArray[np.void]:
    out = np.zeros(len(rows), KEPLER)
    numbers = rows["svid"].astype(np.int64)
    numbers -= np.where((system == "C") & (numbers >= _LATE_BEIDOU), _LATE_BEIDOU_LESS, less)
    out["sat"] = [f"{system}{value:02d}" if 0 < value < 100 else "" for value in numbers]
    for name in set(KEPLER.names or ()) & set(rows.dtype.names or ()) - {"health", "tgd"}:
        out[name] = rows[name]
    for name in _ANGLES:
        out[name] *= np.pi
    own_ns = _BDT_BEHIND_GPS_NS if system == "C" else 0
    out["toe_sow"] = rows["toe"]
    out["toe_ns"], out["toc_ns"] = (_near(rows[name], t_ns - own_ns) + own_ns for name in ("toe", "toc"))
    tgd = np.nan_to_num(known(rows["tgd"]))
    out["tgd"] = tgd if tgd.ndim == 2 else np.column_stack([tgd, np.zeros(len(rows))])
    health = rows["health"].astype(np.int64)
    out["health"] = _galileo_health(health) if system == "E" else health
    out["fnav"] = rows["source"] == _FNAV if system == "E" else False
    usable = (out["sat"] != "") & _finite(out, ("sqrt_a", "e", "m0", "af0", "i0", "omega0", "omega"))
    return out[usable]


def _finite(rows: NDArray[np.void], names: tuple[str, ...]) -> NDArray[np.bool_]:
    return np.logical_and.reduce([np.isfinite(known(rows[name])) for name in names])


def _galileo_health(health: NDArray[np.int64]) -> NDArray[np.int64]:
    """As RINEX packs it: data validity and signal health of E1-B, and of E5b six bits up; what is not valid is left out."""
    e1, e5b = health & 1, (health >> 4) & 1
    return e1 * ((health >> 1) & 1 | (health >> 2 & 3) << 1) | e5b * ((health >> 5 & 1) << 6 | (health >> 6 & 3) << 7)


def _glonass(rows: NDArray[np.void], t_ns: Times) -> NDArray[np.void]:
    out = np.zeros(len(rows), GLONASS)
    numbers = rows["svid"].astype(np.int64) - _GLONASS_LESS
    out["sat"] = [f"R{value:02d}" if 0 < value < 30 else "" for value in numbers]
    out["toe_ns"] = _near(rows["toe"], t_ns)
    for name in ("pos", "vel", "acc"):
        out[name] = rows[name] * 1e3
    out["tau"], out["gamma"], out["channel"] = rows["tau"], rows["gamma"], rows["frequency"].astype(np.float64) - 8
    out["health"] = rows["health"]
    usable = (out["sat"] != "") & np.isfinite(known(rows["pos"])).all(axis=1) & _finite(out, ("tau", "gamma"))
    return out[usable]
