"""Errors of an IMU: turn-on and in-run bias, scale factor, misalignment, white noise, quantisation.

measured = (I + diag(scale) + misalignment) true + bias + noise, rounded to the quantum. The noise figures are those of
`navreplay.options.ImuNoise`, so that a filter can be told exactly what was drawn.
"""

from dataclasses import dataclass
from math import exp, inf, sqrt

import numpy as np
from numpy.random import Generator

from navreplay.options import ImuNoise
from navreplay.timeline import Floats, ImuSeries
from synthetic_logs.sensors.seeding import generator_for
from synthetic_logs.sensors.windows import ScaledWindow, scale_in

__all__ = ["ImuErrors", "SensorErrors", "disturb_imu", "draw_gauss_markov"]


@dataclass(frozen=True, slots=True)
class ImuErrors:
    """Errors of an IMU beside its noise model.

    noise: densities, turn-on and in-run biases, scale factors. gyro_misalignment_std, accel_misalignment_std [rad]: of each of
    the six cross-axis terms. gyro_quantum [rad/s], accel_quantum [m/s^2]: resolution of the samples (0: none).
    noise_windows: (start, end, scale) of the standard deviation of the white noise of both, which `noise` does not tell.
    """

    noise: ImuNoise
    gyro_misalignment_std: float = 0.0
    accel_misalignment_std: float = 0.0
    gyro_quantum: float = 0.0
    accel_quantum: float = 0.0
    noise_windows: tuple[ScaledWindow, ...] = ()


@dataclass(frozen=True, slots=True)
class _Triad:
    """The figures of one triad, gyros or accelerometers, in its unit."""

    name: str
    density: float
    bias_std: float
    walk: float
    tau: float
    scale_std: float
    misalignment_std: float
    quantum: float
    markov_std: float = 0.0
    markov_tau: float = 1.0


@dataclass(frozen=True, eq=False, slots=True)
class SensorErrors:
    """What was drawn for one triad: bias (n, 3) at the stamps in its unit, Gauss-Markov error included; matrix (3, 3) of scale
    factors and misalignments (added to the identity)."""

    bias: Floats
    matrix: Floats


def draw_gauss_markov(rng: Generator, start: Floats, walk: float, tau: float, dt: float, n: int) -> Floats:
    """First-order Gauss-Markov process (n, k), exactly discretised: db = -b/tau dt + walk dW; a random walk where tau is inf.

    start: (k,) value one step dt [s] before the first sample. walk: [unit/sqrt(s)]. tau: [s].
    """
    drive = rng.standard_normal((n, len(start)))
    if tau == inf:
        return start + walk * sqrt(dt) * np.cumsum(drive, axis=0)
    from scipy.signal import lfilter  # slow to import and seldom needed

    decay = exp(-dt / tau)
    drive *= walk * sqrt(tau / 2 * (1 - decay**2))
    drive[0] += decay * start
    return np.asarray(lfilter([1.0], [1.0, -decay], drive, axis=0))


def _draw_markov(model: _Triad, dt: float, n: int, seed: int) -> Floats:
    rng = generator_for(seed, f"{model.name} Gauss-Markov error")
    walk = model.markov_std * sqrt(2 / model.markov_tau)
    return draw_gauss_markov(rng, model.markov_std * rng.standard_normal(3), walk, model.markov_tau, dt, n)


def _disturb(true: Floats, dt: float, model: _Triad, noise_scale: Floats, seed: int) -> tuple[Floats, SensorErrors]:
    turn_on = model.bias_std * generator_for(seed, f"{model.name} turn-on bias").standard_normal(3)
    bias = draw_gauss_markov(generator_for(seed, f"{model.name} bias walk"), turn_on, model.walk, model.tau, dt, len(true))
    if model.markov_std > 0:
        bias = bias + _draw_markov(model, dt, len(true), seed)
    matrix = model.misalignment_std * generator_for(seed, f"{model.name} misalignment").standard_normal((3, 3))
    np.fill_diagonal(matrix, model.scale_std * generator_for(seed, f"{model.name} scale").standard_normal(3))
    white = model.density / sqrt(dt) * generator_for(seed, f"{model.name} noise").standard_normal(true.shape)
    noise = noise_scale[:, None] * white
    measured = true + true @ matrix.T + bias + noise
    if model.quantum > 0:
        measured = model.quantum * np.rint(measured / model.quantum)
    return measured, SensorErrors(bias, matrix)


def disturb_imu(true: ImuSeries, dt: float, errors: ImuErrors, seed: int) -> tuple[ImuSeries, SensorErrors, SensorErrors]:
    """The series as a real IMU would give it, and the errors of its gyros and accelerometers.

    dt: sampling interval [s]. Every kind of error draws from its own generator (`synthetic_logs.sensors.seeding`).
    """
    noise = errors.noise
    gyro_model = _Triad(
        "gyro",
        noise.gyro_noise,
        noise.gyro_bias_std,
        noise.gyro_bias_walk,
        noise.gyro_bias_tau,
        noise.gyro_scale_std,
        errors.gyro_misalignment_std,
        errors.gyro_quantum,
        noise.gyro_markov_std,
        noise.gyro_markov_tau,
    )
    accel_model = _Triad(
        "accel",
        noise.accel_noise,
        noise.accel_bias_std,
        noise.accel_bias_walk,
        noise.accel_bias_tau,
        noise.accel_scale_std,
        errors.accel_misalignment_std,
        errors.accel_quantum,
    )
    noise_scale = scale_in(errors.noise_windows, (true.t_ns - true.t_ns[0]) / 1e9)
    gyro, gyro_errors = _disturb(true.gyro, dt, gyro_model, noise_scale, seed)
    accel, accel_errors = _disturb(true.accel, dt, accel_model, noise_scale, seed)
    return ImuSeries(true.t_ns, gyro, accel, true.increments), gyro_errors, accel_errors
