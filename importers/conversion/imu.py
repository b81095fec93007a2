"""IMU rows as a series in SI units and vehicle axes."""

import numpy as np

from importers.roles.sources import Joined, account
from importers.rows.axes import axes_matrix
from importers.rows.screening import Screening
from importers.rows.tables import Rows
from importers.settings import ImuInput
from navreplay.timeline import ChannelUse, Floats, ImuSeries, LogError

__all__ = ["convert_imu"]

_STANDARD_GRAVITY = 9.80665
_FACTORS = {"rad/s": 1.0, "deg/s": np.pi / 180, "m/s2": 1.0, "g": _STANDARD_GRAVITY}
_BEYOND_ANY_SENSOR = 1e6
_G_RANGE = (0.5, 1.5)
_DEGREES_MEDIAN = 1.0
_DEGREES_PEAK = 20.0


def convert_imu(
    joined: Joined, settings: ImuInput
) -> tuple[ImuSeries, tuple[ChannelUse, ...], tuple[str, ...], dict[str, str]]:
    """The series, its accounting, what was assumed, and the settings recognised. Raises LogError where no sample is usable."""
    rows = joined.rows
    if rows.gyro is None or rows.accel is None:
        what, key = ("angular rates", "channel") if rows.gyro is None else ("accelerations", "accel_channel")
        raise LogError(
            f"{joined.name}: holds no {what} (zero throughout, or said to be missing by a first covariance element of -1), so "
            f"it cannot serve as IMU; where another channel holds them, name that one with input.imu.{key}"
        )
    screening = Screening(joined.name, len(joined.t_ns))
    both = rows.gyro, rows.accel  # apart, since of a long log each copy is much memory
    screening.reject(~np.logical_and(*(np.isfinite(one).all(axis=1) for one in both)), "not finite")
    beyond = np.logical_or(*((np.abs(one) > _BEYOND_ANY_SENSOR).any(axis=1) for one in both))
    screening.reject(beyond, "beyond any sensor")
    order = screening.order(joined.t_ns)
    if len(order) == 0:
        why = ", ".join(f"{count} {reason}" for reason, count in screening.rejected(slice(None)).items())
        raise LogError(f"{joined.name}: none of its {len(joined.t_ns)} samples is usable ({why})")
    gyro_unit, accel_unit, notes = _find_units(joined.name, rows, order, settings)
    axes = rows.sensor_axes if settings.axes == "auto" else settings.axes
    gyro_axes = axes if settings.gyro_axes == "auto" else settings.gyro_axes
    turn = axes_matrix(axes, settings.mounting_deg)
    if axes != "frd" or any(settings.mounting_deg):
        mounted = f", mounted at {settings.mounting_deg} deg" if any(settings.mounting_deg) else ""
        notes.append(f"{joined.name}: sensor axes {axes}{mounted} were turned to forward-right-down")
    elif settings.axes == "auto" and not rows.units_known:
        notes.append(f"{joined.name}: its axes are taken as forward, right, down")
    if gyro_axes != axes:
        notes.append(f"{joined.name}: the axes of its angular rates are taken as {gyro_axes}")
    series = ImuSeries(
        joined.t_ns[order],
        _turn(rows.gyro[order] * _FACTORS[gyro_unit], axes_matrix(gyro_axes, settings.mounting_deg)),
        _turn(rows.accel[order] * _FACTORS[accel_unit], turn),
        settings.increments or rows.means,
    )
    found = {"axes": axes, "gyro_unit": gyro_unit, "accel_unit": accel_unit}
    found = {key: value for key, value in found.items() if key != "axes" or not any(settings.mounting_deg)}
    recognised = {f"input.imu.{key}": value for key, value in found.items() if getattr(settings, key) == "auto"}
    return series, account(joined, screening), (*joined.notes, *screening.notes, *notes), recognised


def _turn(vectors: Floats, matrix: Floats) -> Floats:
    """A mere relabelling is done without arithmetic, so that it is exact."""
    if np.array_equal(matrix, np.rint(matrix)):
        source = np.argmax(np.abs(matrix), axis=1)
        return np.ascontiguousarray(vectors[:, source] * matrix[range(3), source])
    return np.asarray(vectors @ matrix.T)


def _find_units(name: str, rows: Rows, order: np.ndarray, settings: ImuInput) -> tuple[str, str, list[str]]:
    """Units of angular rate and specific force, and sentences on what was recognised."""
    assert rows.gyro is not None
    assert rows.accel is not None
    notes = []
    gyro_unit, accel_unit = settings.gyro_unit, settings.accel_unit
    if accel_unit == "auto":
        force = float(np.median(np.linalg.norm(rows.accel[order], axis=1)))
        steady = float(
            np.linalg.norm(np.median(rows.accel[order], axis=0))
        )  # gravity is; the rest of a drive points everywhere
        in_g = not rows.units_known and _G_RANGE[0] < force < _G_RANGE[1] and steady > force / 2
        accel_unit = "g" if in_g else "m/s2"
        if in_g:
            notes.append(f"{name}: its specific force has a median of {force:.3f}, so it is taken as g")
    if gyro_unit == "auto":
        rate = np.linalg.norm(rows.gyro[order], axis=1)
        middle, peak = float(np.median(rate)), float(np.quantile(rate, 0.999))
        in_degrees = not rows.units_known and (middle > _DEGREES_MEDIAN or peak > _DEGREES_PEAK)
        gyro_unit = "deg/s" if in_degrees else "rad/s"
        if in_degrees:
            notes.append(
                f"{name}: its angular rate has a median of {middle:.2f} and a peak of {peak:.1f}, so it is taken as deg/s"
            )
    return gyro_unit, accel_unit, notes
