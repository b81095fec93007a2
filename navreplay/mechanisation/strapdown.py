"""Strapdown inertial navigation: from IMU samples to steps, and from steps to a trajectory in NED.

Corrections for coning and sculling follow Savage, Strapdown Inertial Navigation Integration Algorithm Design, parts 1 and 2
(JGCD 21 (1998) 19 and 208), with angular rate and specific force linear in time over two samples.
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from navreplay.mechanisation import _strapdown_kernel
from navreplay.mechanisation._kernel_arrays import StepRows
from navreplay.timeline import Floats, ImuSeries, LogError, Times, Trajectory

__all__ = [
    "Leg",
    "NavState",
    "Steps",
    "find_gaps",
    "idle_steps",
    "integrate_steps",
    "make_steps",
    "mechanise",
    "split_at_long_gaps",
]

GAP_FACTOR = 2.5
"""An interval beyond this many median intervals is a gap: one lost sample is interpolated without further notice."""


@dataclass(frozen=True, eq=False, slots=True)
class Steps:
    """Body increments from one time to the next, what the mechanisation consumes.

    start_ns: beginning of the first step. t_ns: (k,) end of each step. dt: (k,) [s]. dtheta: (k, 3) rotation vector [rad]
    with coning. dvel: (k, 3) integral of specific force [m/s] with sculling, in the body axes at the step's start but for the
    rotation during the step itself. bridged: (k,) True inside a gap of the IMU.
    """

    start_ns: int
    t_ns: Times
    dt: Floats
    dtheta: Floats
    dvel: Floats
    bridged: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.t_ns)

    def after(self, t_ns: int) -> "Steps":
        """The steps that begin at or after t_ns, which must be an end of a step or the beginning of the first."""
        rest = slice(int(np.searchsorted(self.t_ns, t_ns, side="right")), None)
        return Steps(t_ns, self.t_ns[rest], self.dt[rest], self.dtheta[rest], self.dvel[rest], self.bridged[rest])


@dataclass(frozen=True, eq=False, slots=True)
class Leg:
    """What is moved over at a time: from before step `first` to the nodes behind ends (k,) steps, counted from the first of all
    steps. interval [s]: longest step of the covariance. keep: transitions and noises between the nodes are asked for."""

    steps: Steps
    first: int
    ends: NDArray[np.intp]
    interval: float
    keep: bool = False

    @property
    def part(self) -> slice:
        """The leg's steps among all."""
        return slice(self.first, int(self.ends[-1]))

    @property
    def rows(self) -> StepRows:
        """The leg's steps, as kernels take them."""
        steps, part = self.steps, self.part
        return StepRows(steps.dt[part], steps.dtheta[part], steps.dvel[part], steps.bridged[part])

    @property
    def counts(self) -> NDArray[np.intp]:
        """(k,) steps from the beginning of the leg to each node."""
        return self.ends - self.first

    @property
    def elapsed(self) -> Floats:
        """(k,) time [s] from the beginning of the leg to each node."""
        return np.concatenate([[0.0], np.cumsum(self.steps.dt[self.part])])[self.counts]

    def keeping(self) -> "Leg":
        """The same, with transitions and noises."""
        return replace(self, keep=True)


@dataclass(frozen=True, eq=False, slots=True)
class NavState:
    """Position (3,) [rad, rad, m], velocity NED (3,) [m/s], attitude q_nb (4,), gyro bias (3,) [rad/s], accelerometer bias
    (3,) [m/s^2], scale-factor errors (3,) of gyro and accelerometer [1], Gauss-Markov part of the gyro error (3,) [rad/s],
    which adds to the gyro bias; acceleration NED (3,) [m/s^2] where no IMU measures it; and, where ranges are used, the
    receiver clock (c,): offsets [m] and, last, drift [m/s], or in its place the correlated error of fixes (3,) NED [m]."""

    lla: Floats
    vel_n: Floats
    q_nb: Floats
    gyro_bias: Floats
    accel_bias: Floats
    gyro_scale: Floats
    accel_scale: Floats
    gyro_markov: Floats = field(default_factory=lambda: np.zeros(3))
    acceleration: Floats = field(default_factory=lambda: np.zeros(3))
    clock: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def at(cls, lla: Floats, vel_n: Floats, q_nb: Floats) -> "NavState":
        """A state without sensor errors."""
        return cls(lla, vel_n, q_nb, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3))

    def pack(self) -> Floats:
        """(28 + c,) the layout of the kernels, and what they carry along behind it; (k, 28 + c) of k states."""
        sensors = [self.gyro_bias, self.accel_bias, self.gyro_scale, self.accel_scale, self.gyro_markov]
        return np.concatenate([self.lla, self.vel_n, self.q_nb, *sensors, self.acceleration, self.clock], axis=-1)

    @classmethod
    def unpack(cls, x: Floats) -> "NavState":
        """The inverse of `pack`; x (28 + c,) of one state, (k, 28 + c) of k at once, whose parts are then (k, ...)."""
        ends = (0, 3, 6, 10, 13, 16, 19, 22, 25, 28, x.shape[-1])
        return cls(*(x[..., first:end] for first, end in pairwise(ends)))

    @property
    def gyro_error(self) -> Floats:
        """(3,) all that adds to the angular rate [rad/s]: bias and Gauss-Markov part."""
        return self.gyro_bias + self.gyro_markov


def find_gaps(t_ns: Times) -> NDArray[np.bool_]:
    """(n - 1,) True for the intervals of a time column (n,) that are gaps."""
    dt = np.diff(t_ns)
    return dt > GAP_FACTOR * np.median(dt)


def make_steps(imu: ImuSeries, cut_ns: Times) -> Steps:
    """Steps between all IMU stamps, cut further at the times cut_ns (any order; those outside the IMU's span are ignored).

    A cut inside an interval divides its increments in proportion to time. Across a gap an integrating sensor's mean is taken
    as the mean of the two samples about the gap.
    """
    if len(imu) < 2:
        raise LogError("imu: one sample is not enough to navigate")
    bridged = find_gaps(imu.t_ns)
    inside = cut_ns[(cut_ns > imu.t_ns[0]) & (cut_ns < imu.t_ns[-1])]
    ends = np.sort(np.concatenate([imu.t_ns[1:], inside]), kind="stable")
    ends = ends[np.diff(ends, prepend=imu.t_ns[0]) > 0]
    k = len(ends)
    steps = Steps(int(imu.t_ns[0]), ends, np.empty(k), np.empty((k, 3)), np.empty((k, 3)), np.empty(k, dtype=np.bool_))
    _strapdown_kernel.fill_steps(
        imu.t_ns, imu.gyro, imu.accel, imu.increments, bridged, ends, steps.dt, steps.dtheta, steps.dvel, steps.bridged
    )
    return steps


def idle_steps(start_ns: int, t_ns: Times) -> Steps:
    """Steps from start_ns to each of the times t_ns (k,) that carry no motion, where there is no IMU."""
    dt = np.diff(t_ns, prepend=start_ns) / 1e9
    return Steps(start_ns, t_ns, dt, np.zeros((len(dt), 3)), np.zeros((len(dt), 3)), np.zeros(len(dt), dtype=np.bool_))


def integrate_steps(steps: Steps, start: NavState) -> Floats:
    """(k, w) packed states at the ends of the steps, from start at the beginning of the first."""
    packed = start.pack()
    states = np.empty((len(steps), len(packed)))
    _strapdown_kernel.integrate(packed, steps.dt, steps.dtheta, steps.dvel, states)
    return states


def mechanise(imu: ImuSeries, start: NavState) -> Trajectory:
    """Unaided navigation from start at the first stamp: states at all later stamps."""
    steps = make_steps(imu, np.empty(0, dtype=np.int64))
    x = integrate_steps(steps, start)
    unknown = np.full((len(steps), 3, 3), np.nan)
    return Trajectory(steps.t_ns, x[:, 0:3].copy(), x[:, 3:6].copy(), x[:, 6:10].copy(), unknown)


def split_at_long_gaps(imu: ImuSeries, longest_ns: int) -> list[ImuSeries]:
    """The pieces of imu between gaps longer than longest_ns; a piece of a single sample is dropped."""
    cuts = np.flatnonzero(np.diff(imu.t_ns) > longest_ns) + 1
    edges = [0, *cuts.tolist(), len(imu)]
    return [ImuSeries(imu.t_ns[a:b], imu.gyro[a:b], imu.accel[a:b], imu.increments) for a, b in pairwise(edges) if b - a > 1]
