"""Cubature points through the mechanisation, compiled: arrays in, arrays out. `.py_func` of each kernel is its reference.

State and error as in `navreplay.mechanisation._ned_kernel`. With P = L L' and N = n + extra the points are +-sqrt(N) L_i, i = 1
... n, and, where extra is 1, a pair at the nominal state: that of a direction in which the error cannot lie (Gao et al. 2021,
(17)-(19), with P singular along the quaternion). From the halves a_i = (d_i+ - d_i-) / (2 sqrt(N)) and s_i = (d_i+ + d_i-) / 2
of the differences d at the end, mean and covariance (21), (22) are sum s_i / N and sum a_i a_i' + sum s_i s_i' / N - mean mean'
+ Q: the first sum is F P F' with F = A L^-1, the statistically linearised transition.
"""

import math

import numpy as np
from numba import njit

from navreplay.geodesy import earth
from navreplay.mechanisation._strapdown_kernel import fade, fill_matrix, multiply, small_rotation, take_step

_A = earth.SEMI_MAJOR_AXIS
_E2 = earth.ECCENTRICITY_SQUARED
_LEAST_PIVOT = 1e-13
"""Of a variance, given the states before it in the order: less is rounding, and counts as zero."""
_WIDEST = 1.0
"""Attitude error of a point [rad] beyond which points mean nothing: there the linear transition is taken."""


@njit(cache=True)
def fill_root(p, root):
    """Lower root (n, n) with p = root root' of p (n, n); states without variance of their own get a column of zeros."""
    n = p.shape[0]
    root[:, :] = 0.0
    for j in range(n):
        pivot = p[j, j]
        for k in range(j):
            pivot -= root[j, k] * root[j, k]
        if pivot <= _LEAST_PIVOT * p[j, j]:
            continue
        root[j, j] = math.sqrt(pivot)
        for i in range(j + 1, n):
            total = p[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = total / root[j, j]


@njit(cache=True)
def divide_by_root(a, root, f):
    """f (n, n) = a' root^-1, with a (n, n) the images of the root's columns in rows; zero where root has a column of zeros."""
    n = a.shape[0]
    rows = a.copy()
    for j in range(n - 1, -1, -1):
        if root[j, j] == 0:
            rows[j] = 0.0
            continue
        for k in range(j + 1, n):
            for i in range(n):
                rows[j, i] -= root[k, j] * rows[k, i]
        for i in range(n):
            rows[j, i] /= root[j, j]
    f[:, :] = rows.T


@njit(cache=True)
def add_moments(a, s, count, mean, p, q):
    """From the halves a, s (n, n), point by point in rows, of a rule with 2 count points: fills mean (n), adds to q (n, n) what
    lies in s, and sets p (n, n) to the covariance with that."""
    mean[:] = s.sum(axis=0) / count
    q += s.T @ s / count - np.outer(mean, mean)
    p[:, :] = a.T @ a + q
    p[:, :] = (p + p.T) / 2


@njit(cache=True)
def merge_steps(dt, dtheta, dvel, ends, interval, h, theta, vel, merged_ends):
    """Adds up steps until they last interval [s] or a node of ends (k) is reached: fills h (m), theta, vel (m, 3), of which
    the last entry of merged_ends (k), the ends counted in them, says how many there are. What the steps of an interval do not
    commute by is left out: it hardly differs between points."""
    h[:] = 0.0
    theta[:, :] = 0.0
    vel[:, :] = 0.0
    m, step = 0, 0
    for node in range(ends.shape[0]):
        while step < ends[node]:
            h[m] += dt[step]
            for j in range(3):
                theta[m, j] += dtheta[step, j]
                vel[m, j] += dvel[step, j]
            step += 1
            if h[m] >= interval or step == ends[node]:
                m += 1
        merged_ends[node] = m


@njit(cache=True)
def metres_per_radian(x):
    """Of latitude and of longitude at x."""
    sine = math.sin(x[0])
    w2 = 1 - _E2 * sine * sine
    normal = _A / math.sqrt(w2)
    return normal * (1 - _E2) / w2 + x[2], (normal + x[2]) * math.cos(x[0])


@njit(cache=True)
def retract(x, north, east, error, additive):
    """Moves packed x, where a radian has north and east metres, by an error (n). additive: half the attitude error times q is
    added to q, which is then normalised."""
    n = error.shape[0]
    x[0] += error[0] / north
    x[1] += error[1] / east
    x[2] -= error[2]
    if additive:
        pw, px, py, pz = 1.0, 0.5 * error[6], 0.5 * error[7], 0.5 * error[8]
    else:
        pw, px, py, pz = small_rotation(error[6], error[7], error[8])
    qw, qx, qy, qz = multiply(pw, px, py, pz, x[6], x[7], x[8], x[9])
    scale = 1 / math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    x[6], x[7], x[8], x[9] = qw * scale, qx * scale, qy * scale, qz * scale
    for i in range(3):
        x[3 + i] += error[3 + i]
        if n == 18 or n == 24:
            x[22 + i] += error[n - 3 + i]
    for i in range(12 if n >= 21 else 6):
        x[10 + i] += error[9 + i]


@njit(cache=True)
def fill_difference(moved, x, north, east, additive, error):
    """The error (n) by which `retract` takes x, where a radian has north and east metres, to moved."""
    n = error.shape[0]
    error[0] = (moved[0] - x[0]) * north
    error[1] = (moved[1] - x[1]) * east
    error[2] = x[2] - moved[2]
    w, a, b, c = multiply(moved[6], moved[7], moved[8], moved[9], x[6], -x[7], -x[8], -x[9])
    if additive:
        scale = 2 / w
    else:
        sine = math.sqrt(a * a + b * b + c * c)
        scale = 2 * math.atan(sine / w) / sine if sine > 0 else 2.0
    error[6], error[7], error[8] = scale * a, scale * b, scale * c
    for i in range(3):
        error[3 + i] = moved[3 + i] - x[3 + i]
        if n == 18 or n == 24:
            error[n - 3 + i] = moved[22 + i] - x[22 + i]
    for i in range(12 if n >= 21 else 6):
        error[9 + i] = moved[10 + i] - x[10 + i]


@njit(cache=True)
def _carry(x, dt, dtheta, dvel, first, last, tau, fading, n, c, dv_n, body):
    """Moves packed x over the steps from first up to, not with, last."""
    fill_matrix(x[6], x[7], x[8], x[9], c)
    for i in range(first, last):
        take_step(x, dt[i], dtheta[i], dvel[i], c, dv_n, body)
        if fading:
            fade(x, dt[i], tau, n)


@njit(cache=True)
def propagate(start, p_start, cross_start, steps, ends, tau, interval, extra, nodes):
    """Moments over k nodes, from points drawn anew behind each.

    start (w), p_start (n, n), cross_start (n, c), steps, ends (k), tau (n - 9) and interval as in `_ned_kernel.propagate`;
    points and a nominal state beside them take merged steps. extra: 1 for the additive quaternion, 0 for the rotation vector.
    nodes: filled; its transitions and noises are on entry those of the linear model, on return the statistically linearised
    transition and what makes the covariance complete beside it.
    """
    n, w, k = p_start.shape[0], start.shape[0], ends.shape[0]
    dt, dtheta, dvel, transitions, noises = steps.dt, steps.dtheta, steps.dvel, nodes.transitions, nodes.noises
    additive = extra == 1
    count = n + extra
    reach = math.sqrt(count)
    fading = np.isfinite(tau).any()
    h, theta, vel, merged = np.empty(len(dt)), np.empty((len(dt), 3)), np.empty((len(dt), 3)), np.empty_like(ends)
    merge_steps(dt, dtheta, dvel, ends, interval, h, theta, vel, merged)
    x, p, cross = start.copy(), p_start.copy(), cross_start.copy()
    before, beside, point = np.empty(w), np.empty(w), np.empty(w)
    root, a, s = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    error, mean = np.empty(n), np.zeros(n)
    c, dv_n, body = np.empty((3, 3)), np.empty(3), np.empty(6)
    step, coarse = 0, 0
    for node in range(k):
        before[:] = x
        _carry(x, dt, dtheta, dvel, step, ends[node], tau, fading, n, c, dv_n, body)
        if count * (p[6, 6] + p[7, 7] + p[8, 8]) < _WIDEST**2:
            beside[:] = before
            _carry(beside, h, theta, vel, coarse, merged[node], tau, fading, n, c, dv_n, body)
            fill_root(p, root)
            here, there = metres_per_radian(before), metres_per_radian(beside)
            for i in range(n):
                for j in range(n):
                    error[j] = reach * root[j, i]
                for target in (a, s):
                    point[:] = before
                    retract(point, here[0], here[1], error, additive)
                    _carry(point, h, theta, vel, coarse, merged[node], tau, fading, n, c, dv_n, body)
                    fill_difference(point, beside, there[0], there[1], additive, target[i])
                    for j in range(n):
                        error[j] = -error[j]
                for j in range(n):
                    there_j, back_j = a[i, j], s[i, j]
                    a[i, j], s[i, j] = (there_j - back_j) / (2 * reach), (there_j + back_j) / 2
            divide_by_root(a, root, transitions[node])
            add_moments(a, s, count, mean, p, noises[node])
            north, east = metres_per_radian(x)
            retract(x, north, east, mean, additive)
        else:
            p = transitions[node] @ p @ transitions[node].T + noises[node]
        if cross.shape[1] > 0:
            cross = transitions[node] @ cross
        step, coarse = ends[node], merged[node]
        nodes.states[node] = x
        nodes.covariances[node] = p
        nodes.crosses[node] = cross
