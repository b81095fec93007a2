"""Error dynamics in NED beside the mechanisation, compiled: arrays in, arrays out. `.py_func` is the reference in tests.

Packed state: see `navreplay.mechanisation._strapdown_kernel`. Error state (15, 18, 21 or 24), true minus computed: position NED
[m], velocity NED [m/s], rotation vector phi in n with C_nb true = (I + [phi x]) C_nb computed, gyro bias, accelerometer bias (,
gyro scale, accelerometer scale) (, Gauss-Markov part of the gyro error). Error equations: Groves, Principles of GNSS, Inertial,
and Multisensor Integrated Navigation Systems, 2nd ed. (2013), 14.2.4, with this sign of phi and position in metres.
"""

import math

import numpy as np
from numba import njit

from navreplay.geodesy import earth
from navreplay.mechanisation._kernel_arrays import Sums
from navreplay.mechanisation._strapdown_kernel import fade, fill_matrix, take_step

__all__ = ["BRIDGE_ACCEL", "BRIDGE_RATE", "fill_transition", "move_covariance", "multiply_left", "propagate"]

_A = earth.SEMI_MAJOR_AXIS
_E2 = earth.ECCENTRICITY_SQUARED
_RATE = earth.EARTH_RATE
_GM = earth.GM

BRIDGE_ACCEL = 1.0
"""Specific force [m/s^2] and angular rate [rad/s] that may go unseen while a gap of the IMU is bridged: standard deviations."""
BRIDGE_RATE = 0.1


@njit(cache=True)
def _fill_rate_matrix(x, span, sums, a):
    """a (9, n): integral of the error dynamics' rows of position, velocity and attitude over span [s]."""
    n = a.shape[1]
    c_dt, dv_n, c_theta, c_dvel = sums.c_dt, sums.f_dt, sums.c_theta, sums.c_dvel
    a[:, :] = 0
    lat, height = x[0], x[2]
    vn, ve, vd = x[3], x[4], x[5]
    sine, cosine = math.sin(lat), math.cos(lat)
    tangent = sine / cosine
    w2 = 1 - _E2 * sine * sine
    normal = _A / math.sqrt(w2)
    rm = normal * (1 - _E2) / w2 + height
    rn = normal + height
    enn, ene, end = ve / rn, -vn / rm, -ve * tangent / rn
    ien, ied = _RATE * cosine, -_RATE * sine
    # position
    a[0, 0] = -vd / rm * span
    a[0, 2] = vn / rm * span
    a[1, 0] = ve * tangent / rm * span
    a[1, 1] = -(vd / rn + vn * tangent / rm) * span
    a[1, 2] = ve / rn * span
    for i in range(3):
        a[i, 3 + i] = span
    # changes of the frame rates with position: dlat = dN / rm, dh = -dD
    die_n, die_d = -_RATE * sine / rm, -_RATE * cosine / rm
    den_n_down = ve / (rn * rn)
    den_e_down = -vn / (rm * rm)
    den_d_north = -ve / (rn * cosine * cosine * rm)
    den_d_down = -ve * tangent / (rn * rn)
    # ... and with velocity: den_n / dvE = 1 / rn, den_e / dvN = -1 / rm, den_d / dvE = -tangent / rn
    # velocity: -(2 die + den) x v, first with position
    sn, se, sd = 2 * die_n, 0.0, 2 * die_d + den_d_north
    a[3, 0] = -(se * vd - sd * ve) * span
    a[4, 0] = -(sd * vn - sn * vd) * span
    a[5, 0] = -(sn * ve - se * vn) * span
    sn, se, sd = den_n_down, den_e_down, den_d_down
    a[3, 2] = -(se * vd - sd * ve) * span
    a[4, 2] = -(sd * vn - sn * vd) * span
    a[5, 2] = -(sn * ve - se * vn) * span + 2 * _GM / (rm * rn * math.sqrt(rm * rn)) * span
    # ... then with velocity: -(2 ie + en) x dv - (den x v)
    wx, wy, wz = 2 * ien + enn, ene, 2 * ied + end
    a[3, 3] = vd / rm * span
    a[3, 4] = (wz - ve * tangent / rn) * span
    a[3, 5] = -wy * span
    a[4, 3] = -wz * span
    a[4, 4] = (vn * tangent + vd) / rn * span
    a[4, 5] = wx * span
    a[5, 3] = (wy - vn / rm) * span
    a[5, 4] = (-wx - ve / rn) * span
    # velocity with attitude: -[f x] phi
    a[3, 7] = dv_n[2]
    a[3, 8] = -dv_n[1]
    a[4, 6] = -dv_n[2]
    a[4, 8] = dv_n[0]
    a[5, 6] = dv_n[1]
    a[5, 7] = -dv_n[0]
    # attitude: -dw_in - [w_in x] phi
    a[6, 0] = -die_n * span
    a[8, 0] = -(die_d + den_d_north) * span
    a[6, 2] = -den_n_down * span
    a[7, 2] = -den_e_down * span
    a[8, 2] = -den_d_down * span
    a[6, 4] = -span / rn
    a[7, 3] = span / rm
    a[8, 4] = tangent / rn * span
    zx, zy, zz = ien + enn, ene, ied + end
    a[6, 7] = zz * span
    a[6, 8] = -zy * span
    a[7, 6] = -zz * span
    a[7, 8] = zx * span
    a[8, 6] = zy * span
    a[8, 7] = -zx * span
    for i in range(3):
        for j in range(3):
            a[6 + i, 9 + j] = -c_dt[i, j]
            a[3 + i, 12 + j] = -c_dt[i, j]
            if n >= 21:
                a[6 + i, 15 + j] = -c_theta[i, j]
                a[3 + i, 18 + j] = -c_dvel[i, j]
            if n == 18 or n == 24:
                a[6 + i, n - 3 + j] = -c_dt[i, j]


@njit(cache=True)
def fill_transition(a, phi):
    """phi (9, n) = rows of I + a + a^2 / 2."""
    n = a.shape[1]
    for i in range(9):
        for j in range(n):
            square = 0.0
            for k in range(9):
                square += a[i, k] * a[k, j]
            phi[i, j] = a[i, j] + 0.5 * square
        phi[i, i] += 1


@njit(cache=True)
def _sandwich(phi, decay, p, work):
    """p <- F p F' in place, F = [phi; diag(decay)], phi (9, n), decay (n - 9)."""
    n = p.shape[0]
    for i in range(9):
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += phi[i, k] * p[k, j]
            work[i, j] = total
    for i in range(9):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += work[i, k] * phi[j, k]
            p[i, j] = total
            p[j, i] = total
        for j in range(9, n):
            p[i, j] = work[i, j] * decay[j - 9]
            p[j, i] = p[i, j]
    for i in range(9, n):
        for j in range(9, n):
            p[i, j] *= decay[i - 9] * decay[j - 9]


@njit(cache=True)
def _add_noise(p, density, span, bridge):
    """Adds density (n) times span [s] and what a bridged gap may hide to the diagonal of p."""
    for i in range(p.shape[0]):
        p[i, i] += density[i] * span
    for i in range(3):
        p[3 + i, 3 + i] += bridge * BRIDGE_ACCEL**2
        p[6 + i, 6 + i] += bridge * BRIDGE_RATE**2


@njit(cache=True)
def move_covariance(phi, decay, density, span, bridge, p, work):
    """p <- F p F' + noise of span [s] in place, half of the noise before and half after the transition (trapezoidal rule)."""
    _add_noise(p, density, span / 2, bridge / 2)
    _sandwich(phi, decay, p, work)
    _add_noise(p, density, span / 2, bridge / 2)


@njit(cache=True)
def _accumulate(h, c_start, c_end, dv_n, body, sums):
    """Adds a step of h [s] to the integrals that the error dynamics need: of C_nb, of specific force in n, and of C_nb times
    the body's rate and specific force, axis by axis."""
    for i in range(3):
        sums.f_dt[i] += dv_n[i]
        for j in range(3):
            c_mean = 0.5 * (c_start[i, j] + c_end[i, j])
            sums.c_dt[i, j] += c_mean * h
            sums.c_theta[i, j] += c_mean * body[j]
            sums.c_dvel[i, j] += c_mean * body[3 + j]


@njit(cache=True)
def multiply_left(phi, decay, total, work):
    """total (n, c) <- F total in place, F = [phi; diag(decay)]; work has c columns at least."""
    n, c = total.shape
    for i in range(9):
        for j in range(c):
            value = 0.0
            for k in range(n):
                value += phi[i, k] * total[k, j]
            work[i, j] = value
    total[:9] = work[:, :c]
    for i in range(9, n):
        total[i] *= decay[i - 9]


@njit(cache=True)
def _begin_totals(phi, decay, density, span, bridge, total_phi, total_q):
    """Transition F = [phi; diag(decay)] and noise of a node's first covariance step, as `multiply_left` and
    `move_covariance` would make them of I and of zero."""
    n = total_phi.shape[0]
    total_phi[:, :] = 0
    total_q[:, :] = 0
    _add_noise(total_q, density, span / 2, bridge / 2)
    half = np.diag(total_q).copy()
    total_phi[:9] = phi
    for i in range(9, n):
        total_phi[i, i] = decay[i - 9]
        total_q[i, i] = half[i] * decay[i - 9] * decay[i - 9]
    for i in range(9):
        for j in range(9, n):
            total_q[i, j] = phi[i, j] * half[j] * decay[j - 9]
            total_q[j, i] = total_q[i, j]
        for j in range(i + 1):
            value = 0.0
            for k in range(n):
                value += phi[i, k] * half[k] * phi[j, k]
            total_q[i, j] = value
            total_q[j, i] = value
    _add_noise(total_q, density, span / 2, bridge / 2)


@njit(cache=True)
def _gather_totals(phi, decay, density, span, bridge, fresh, total_phi, total_q, work):
    """Transition and noise of a node's interval, with one covariance step more; fresh: it is the interval's first."""
    if fresh:
        _begin_totals(phi, decay, density, span, bridge, total_phi, total_q)
    else:
        multiply_left(phi, decay, total_phi, work)
        move_covariance(phi, decay, density, span, bridge, total_q, work)


@njit(cache=True)
def _clear(sums):
    """Empties what `_accumulate` has summed up."""
    sums.c_dt[:, :] = 0
    sums.f_dt[:] = 0
    sums.c_theta[:, :] = 0
    sums.c_dvel[:, :] = 0


@njit(cache=True)
def _mechanise(x, steps, first, last, tau, interval, c, sums):
    """Moves packed x and its matrix c over steps from first until interval [s] is full or last is reached, and fills sums.

    Returns the next step, the time moved over [s], and the sum of squares of what was bridged [s^2]."""
    c_start, dv_n, body = np.empty((3, 3)), np.empty(3), np.empty(6)
    fading = np.isfinite(tau).any()
    step, span, bridge = first, 0.0, 0.0
    while True:
        h = steps.dt[step]
        c_start[:, :] = c
        take_step(x, h, steps.dtheta[step], steps.dvel[step], c, dv_n, body)
        _accumulate(h, c_start, c, dv_n, body, sums)
        if fading:
            fade(x, h, tau, 9 + tau.shape[0])
        if steps.bridged[step]:
            bridge += h * h
        span += h
        step += 1
        if span >= interval or step >= last:
            return step, span, bridge


@njit(cache=True)
def propagate(start, p_start, cross_start, steps, ends, driving, interval, nodes):
    """Mechanisation and covariance over k nodes.

    start (w), p_start (n, n): at the beginning; cross_start (n, c): covariance with c states that do not move. steps:
    `StepRows`. ends (k): number of steps up to and with each node, the first counted from 0; nodes share no step. driving:
    `Driving`. interval [s]: longest covariance step. nodes: `navreplay.error_models.ned.Propagated`, filled; transitions and
    noises unless they have no rows.
    """
    n = p_start.shape[0]
    x, p, cross = start.copy(), p_start.copy(), cross_start.copy()
    a, phi, decay = np.empty((9, n)), np.empty((9, n)), np.ones(n - 9)
    work = np.empty((9, max(n, cross.shape[1])))
    c, sums = np.empty((3, 3)), Sums(np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)))
    keep = nodes.transitions.shape[0] > 0
    total_phi, total_q = np.eye(n), np.zeros((n, n))
    step = 0
    fill_matrix(x[6], x[7], x[8], x[9], c)
    for node in range(ends.shape[0]):
        fresh = True
        while step < ends[node]:
            step, span, bridge = _mechanise(x, steps, step, ends[node], driving.tau, interval, c, sums)
            _fill_rate_matrix(x, span, sums, a)
            _clear(sums)
            fill_transition(a, phi)
            for i in range(n - 9):
                decay[i] = math.exp(-span / driving.tau[i])
            move_covariance(phi, decay, driving.density, span, bridge, p, work)
            if cross.shape[1] > 0:
                multiply_left(phi, decay, cross, work)
            if keep:
                _gather_totals(phi, decay, driving.density, span, bridge, fresh, total_phi, total_q, work)
            fresh = False
        nodes.states[node] = x
        nodes.covariances[node] = p
        nodes.crosses[node] = cross
        if keep:
            nodes.transitions[node] = total_phi
            nodes.noises[node] = total_q
