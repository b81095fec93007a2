"""Mechanisation and error dynamics in the launch-inertial frame, compiled; the counterpart of `_ned_kernel`.

Packed state (16): position (3) [m] and velocity (3) [m/s] in launch axes, q_lb (4), gyro bias (3) [rad/s], accelerometer bias
(3) [m/s^2]. Error state (15), true minus computed: position, velocity, rotation vector phi in launch axes with C_lb true =
(I + [phi x]) C_lb computed, gyro bias, accelerometer bias. Si, Wang and Niu (SINS/CNS integrated navigation), (19)-(24), whose
phi has this sign but whose eps and nabla are errors of the sensors' readings, the negative of ours:
    dX' = dV, dV' = -[a x] phi + F_a dX - C nabla, phi' = -C eps, F_a = -GM / l^3 (I - 3 r r' / l^2).
They put the Earth's centre on the y axis; here r counts from where it is, off the plumb line. Gravitation itself is that of the
ellipsoid, the point mass serves for its gradient alone.
"""

import math

import numpy as np
from numba import njit

from navreplay.geodesy import earth
from navreplay.mechanisation._ned_kernel import fill_transition, move_covariance, multiply_left
from navreplay.mechanisation._strapdown_kernel import attract, fill_matrix, multiply, small_rotation

_GM = earth.GM

__all__ = ["fill_gradient", "propagate_launch"]


@njit(cache=True)
def fill_gradient(r, gradient):
    """gradient (3, 3) of point-mass gravitation at r (3) [m] from the Earth's centre: (23)."""
    square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    scale = _GM / (square * math.sqrt(square))
    for i in range(3):
        for j in range(3):
            gradient[i, j] = 3 * scale * r[i] * r[j] / square
        gradient[i, i] -= scale


@njit(cache=True)
def _fill_gravitation(c_il, r_l, g_l):
    """g_l (3) of the ellipsoid at r_l (3) [m] from the Earth's centre, both in launch axes."""
    x = c_il[0, 0] * r_l[0] + c_il[0, 1] * r_l[1] + c_il[0, 2] * r_l[2]
    y = c_il[1, 0] * r_l[0] + c_il[1, 1] * r_l[1] + c_il[1, 2] * r_l[2]
    z = c_il[2, 0] * r_l[0] + c_il[2, 1] * r_l[1] + c_il[2, 2] * r_l[2]
    across = math.sqrt(x * x + y * y)
    outward, northward = attract(across, z, math.sqrt(across * across + z * z))
    gx, gy = outward * x / across, outward * y / across
    for i in range(3):
        g_l[i] = c_il[0, i] * gx + c_il[1, i] * gy + c_il[2, i] * northward


@njit(cache=True)
def _step(x, dt, dtheta, dvel, c, c_il, centre, force, middle, g_l):
    """Moves x over one step. c: C_lb, at its start on entry, at its end on return. centre (3): launch point from the Earth's
    centre, launch axes. Filled: force (3) integral of specific force, middle (3) place from the centre amid the step."""
    tx, ty, tz = dtheta[0] - x[10] * dt, dtheta[1] - x[11] * dt, dtheta[2] - x[12] * dt
    ux, uy, uz = dvel[0] - x[13] * dt, dvel[1] - x[14] * dt, dvel[2] - x[15] * dt
    # rotation of the body during the step, to second order: u + t x u / 2 + t x (t x u) / 6
    sx, sy, sz = ty * uz - tz * uy, tz * ux - tx * uz, tx * uy - ty * ux
    bx = ux + 0.5 * sx + (ty * sz - tz * sy) / 6
    by = uy + 0.5 * sy + (tz * sx - tx * sz) / 6
    bz = uz + 0.5 * sz + (tx * sy - ty * sx) / 6
    for i in range(3):
        force[i] = c[i, 0] * bx + c[i, 1] * by + c[i, 2] * bz
        middle[i] = centre[i] + x[i] + 0.5 * x[3 + i] * dt
    _fill_gravitation(c_il, middle, g_l)
    for i in range(3):
        change = force[i] + g_l[i] * dt
        x[i] += (x[3 + i] + 0.5 * change) * dt
        x[3 + i] += change
    pw, px, py, pz = small_rotation(tx, ty, tz)
    qw, qx, qy, qz = multiply(x[6], x[7], x[8], x[9], pw, px, py, pz)
    scale = 1 / math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    x[6], x[7], x[8], x[9] = qw * scale, qx * scale, qy * scale, qz * scale
    fill_matrix(x[6], x[7], x[8], x[9], c)


@njit(cache=True)
def _fill_rate_matrix(span, gradient, c_dt, force, a):
    """a (9, 15): integral of the error dynamics' rows of position, velocity and attitude over span [s]."""
    a[:, :] = 0
    for i in range(3):
        a[i, 3 + i] = span
        for j in range(3):
            a[3 + i, j] = gradient[i, j] * span
            a[3 + i, 12 + j] = -c_dt[i, j]
            a[6 + i, 9 + j] = -c_dt[i, j]
    a[3, 7], a[3, 8] = force[2], -force[1]
    a[4, 6], a[4, 8] = -force[2], force[0]
    a[5, 6], a[5, 7] = force[1], -force[0]


@njit(cache=True)
def propagate_launch(start, steps, ends, driving, interval, c_il, centre, states, transitions, noises):
    """Mechanisation and error dynamics over k nodes.

    start (16): at the beginning. steps, ends (k), driving and interval [s] as in `_ned_kernel.propagate`. c_il (3, 3), centre
    (3): of the frame. Filled: states (k, 16), transitions and noises (k, 15, 15) from the node before to each.
    """
    tau, density = driving.tau, driving.density
    x = start.copy()
    a, phi, work, decay = np.empty((9, 15)), np.empty((9, 15)), np.empty((9, 15)), np.ones(6)
    c, c_start, c_dt, gradient = np.empty((3, 3)), np.empty((3, 3)), np.zeros((3, 3)), np.empty((3, 3))
    force, middle, g_l, f_dt = np.empty(3), np.empty(3), np.empty(3), np.zeros(3)
    step = 0
    fill_matrix(x[6], x[7], x[8], x[9], c)
    for node in range(ends.shape[0]):
        transitions[node] = np.eye(15)
        noises[node] = 0
        span = 0.0
        bridge = 0.0
        while step < ends[node]:
            h = steps.dt[step]
            c_start[:, :] = c
            _step(x, h, steps.dtheta[step], steps.dvel[step], c, c_il, centre, force, middle, g_l)
            for i in range(3):
                f_dt[i] += force[i]
                for j in range(3):
                    c_dt[i, j] += 0.5 * (c_start[i, j] + c[i, j]) * h
            for i in range(6):
                x[10 + i] *= math.exp(-h / tau[i])
            if steps.bridged[step]:
                bridge += h * h
            span += h
            step += 1
            if span < interval and step < ends[node]:
                continue
            fill_gradient(middle, gradient)
            _fill_rate_matrix(span, gradient, c_dt, f_dt, a)
            fill_transition(a, phi)
            for i in range(6):
                decay[i] = math.exp(-span / tau[i])
            multiply_left(phi, decay, transitions[node], work)
            move_covariance(phi, decay, density, span, bridge, noises[node], work)
            span = 0.0
            bridge = 0.0
            c_dt[:, :] = 0
            f_dt[:] = 0
        states[node] = x
