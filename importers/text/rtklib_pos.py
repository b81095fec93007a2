"""RTKLIB position files (``.pos``): geodetic or Earth-fixed positions, by date or by week, with optional velocities.

Layout: RTKLIB manual 2.4.2, appendix B.1. A covariance is written as the square root of its magnitude with its sign.
"""

import numpy as np

from importers.rows.clock import gps_from_gps_unix
from importers.rows.log import Table
from importers.rows.tables import NO_FIX, drop_absurd, status_codes
from importers.text.table import Selection, parse_text, read_bytes, select_columns
from importers.text.times import read_dates
from navreplay.geodesy.earth import lla_from_ecef, matrix_en
from navreplay.geodesy.time_scales import WEEK_S, LeapSeconds, gps_from_utc, gps_from_week_tow
from navreplay.timeline import FixStatus, Floats, LogError, Times

__all__ = ["is_pos", "read_pos"]

_GEODETIC = ("latitude(deg)", "longitude(deg)", "height(m)")
_EARTH_FIXED = ("x-ecef(m)", "y-ecef(m)", "z-ecef(m)")
_LAST_WEEK = 10_000
_SEPARATORS = bytes.maketrans(b",;|\t", b"    ")
"""What ``out-fieldsep`` may say; date and time of day, or week and seconds, are two fields with any of them."""
_JAPAN_NS = 9 * 3600 * 10**9
_STATUS = {
    "0": NO_FIX,
    "1": int(FixStatus.FIXED),
    "2": int(FixStatus.FLOAT),
    "3": int(FixStatus.DIFFERENTIAL),
    "4": int(FixStatus.DIFFERENTIAL),
    "5": int(FixStatus.SINGLE),
    "6": int(FixStatus.FLOAT),
    "7": int(FixStatus.DEAD_RECKONING),
}


def is_pos(head: str) -> bool:
    """Whether the beginning of a file holds RTKLIB's column header."""
    return any(line.startswith("%") and ("latitude(" in line or "-ecef(m)" in line or "-baseline(m)" in line)
               for line in head.splitlines())  # fmt: skip


def read_pos(path: str, leap: LeapSeconds) -> Table:
    """A position file. Raises LogError for baselines, degrees-minutes-seconds, and files without rows."""
    import pandas as pd

    data = read_bytes(path)
    names = _read_names(path, data)
    text = parse_text(data.translate(_SEPARATORS), " ", header=False, comment="%")
    if text.read == 0:
        raise LogError(f"{path}: the position file holds no rows; did the receiver or the processing have any fix?")
    index = {name: i + 2 for i, name in enumerate(names[1:]) if i + 2 in text.frame.columns}
    if not index.keys() >= set(names[1:4]):
        raise LogError(f"{path}: its lines have {text.frame.shape[1]} fields, too few for what its header names; is it cut?")
    dated = not pd.api.types.is_numeric_dtype(text.frame.get(0, pd.Series(dtype=float)))
    clock = {"first": 0, "second": 1}
    selection = select_columns(text, index if dated else index | clock, clock if dated else None)
    t_ns, timed = _read_times(path, selection, names[0], dated, leap)
    columns = {name: values[timed] for name, values in selection.columns.items()}
    rejected = dict(selection.rejected)
    if not timed.all():
        rejected["no time"] = int((~timed).sum())
    return Table(t_ns, _build_columns(columns) | {"t_gps_ns": t_ns}, selection.read, rejected)


def _read_names(path: str, data: bytes) -> list[str]:
    head = data[:20_000].decode(errors="replace")
    line = next(line for line in head.splitlines() if is_pos(line))
    names = line.encode().translate(_SEPARATORS).decode(errors="replace").lstrip("% ").split()
    if names[1:4] == list(_GEODETIC) or names[1:4] == list(_EARTH_FIXED):
        return names
    raise LogError(
        f"{path}: its columns are {', '.join(names[1:4])}; only latitude and longitude in degrees or Earth-fixed x, y, z can "
        "be read, so write the file again with such an output format"
    )


def _read_times(path: str, selection: Selection, scale: str, dated: bool, leap: LeapSeconds) -> tuple[Times, np.ndarray]:
    first, second = selection.columns["first"], selection.columns["second"]
    if not dated:
        timed = (first >= 0) & (first < _LAST_WEEK) & (second >= 0) & (second < WEEK_S)
        t_ns = gps_from_week_tow(first[timed].astype(np.int64), second[timed])
        return t_ns, timed
    unix_ns, timed = read_dates(
        np.array([" ".join(pair) for pair in zip(first, second, strict=True)], dtype=object), None, path
    )
    if scale == "GPST":
        return gps_from_gps_unix(unix_ns), timed
    return gps_from_utc(unix_ns - (_JAPAN_NS if scale == "JST" else 0), leap), timed


def _build_columns(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    geodetic = _GEODETIC[0] in columns
    position = _stack(columns, _GEODETIC if geodetic else _EARTH_FIXED)
    out: dict[str, np.ndarray] = {"lla": position * [np.pi / 180, np.pi / 180, 1.0] if geodetic else lla_from_ecef(position)}
    axes = "neu" if geodetic else "xyz"
    vel = tuple(f"v{axis}(m/s)" for axis in axes)
    if columns.keys() >= set(vel):
        out["vel_n" if geodetic else "vel_ecef"] = _stack(columns, vel) * ([1.0, 1.0, -1.0] if geodetic else 1.0)
    for key, prefix, unit in (("cov_pos", "sd", "(m)"), ("cov_vel", "sdv", "")):
        names = tuple(f"{prefix}{pair}{unit}" for pair in (*axes, axes[:2], axes[1:], axes[2] + axes[0]))
        if columns.keys() >= set(names):
            cov = _covariance(_stack(columns, names))
            out[key] = _flip_down(cov) if geodetic else cov
    if "cov_pos" in out and not geodetic:
        c_en = matrix_en(out["lla"][:, 0], out["lla"][:, 1])
        out["cov_pos"] = np.einsum("nji,njk,nkl->nil", c_en, out["cov_pos"], c_en)
    if "Q" in columns:
        out["status"] = status_codes(columns["Q"], _STATUS)
    return out


def _stack(columns: dict[str, np.ndarray], names: tuple[str, ...]) -> Floats:
    return drop_absurd(np.column_stack([columns[name] for name in names]).astype(np.float64))


def _covariance(deviations: Floats) -> Floats:
    """Covariances (n, 3, 3) of the six deviations: three variances, then first-second, second-third, third-first; NaN where a
    variance is zero, which RTKLIB writes for unknown."""
    squares = np.sign(deviations) * deviations**2
    cov = squares[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]
    cov[~(deviations[:, :3] > 0).all(axis=1)] = np.nan
    return np.asarray(cov)


def _flip_down(cov: Floats) -> Floats:
    down = np.array([1.0, 1.0, -1.0])
    return np.asarray(cov * down[:, None] * down)
