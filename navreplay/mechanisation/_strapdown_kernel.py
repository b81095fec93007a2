"""Mechanisation in NED, compiled: arrays in, arrays out. `.py_func` of each kernel is its reference in tests.

Packed state x (25 or longer): lat, lon [rad], height [m], v_N, v_E, v_D [m/s], q_nb (4), gyro bias (3) [rad/s], accelerometer
bias (3) [m/s^2], gyro scale (3), accelerometer scale (3), Gauss-Markov part of the gyro error (3) [rad/s]; what follows is
carried along.
"""

import math

import numpy as np
from numba import njit

from navreplay.geodesy import earth

__all__ = ["attract", "fade", "fill_matrix", "fill_steps", "integrate", "multiply", "small_rotation", "take_step"]

_A = earth.SEMI_MAJOR_AXIS
_E2 = earth.ECCENTRICITY_SQUARED
_RATE = earth.EARTH_RATE
attract = njit(cache=True)(earth.attract)


@njit(cache=True, inline="always")
def multiply(pw, px, py, pz, qw, qx, qy, qz):
    """Hamilton product of quaternions, scalar first: as rotations q first, then p."""
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


@njit(cache=True, inline="always")
def small_rotation(x, y, z):
    """Unit quaternion, scalar first, of a rotation vector [rad]."""
    square = x * x + y * y + z * z
    if square < 1e-4:  # sine and cosine of half the angle to beyond double precision
        quarter = square / 4
        scale = 0.5 * (1 - quarter / 6 * (1 - quarter / 20 * (1 - quarter / 42)))
        scalar = 1 - quarter / 2 * (1 - quarter / 12 * (1 - quarter / 30 * (1 - quarter / 56)))
    else:
        angle = math.sqrt(square)
        scale = math.sin(angle / 2) / angle
        scalar = math.cos(angle / 2)
    return scalar, scale * x, scale * y, scale * z


@njit(cache=True)
def fill_matrix(w, x, y, z, c):
    """c (3, 3): rotation matrix of a unit quaternion, scalar first."""
    c[0, 0] = 1 - 2 * (y * y + z * z)
    c[0, 1] = 2 * (x * y - w * z)
    c[0, 2] = 2 * (x * z + w * y)
    c[1, 0] = 2 * (x * y + w * z)
    c[1, 1] = 1 - 2 * (x * x + z * z)
    c[1, 2] = 2 * (y * z - w * x)
    c[2, 0] = 2 * (x * z - w * y)
    c[2, 1] = 2 * (y * z + w * x)
    c[2, 2] = 1 - 2 * (x * x + y * y)


@njit(cache=True)
def take_step(x, dt, dtheta, dvel, c, dv_n, body):
    """Moves x over one step. c: C_nb, at its start on entry, at its end on return. dv_n: specific force integral in n. body:
    the step's corrected rotation (3) and velocity increment (3), for the scale-factor columns."""
    vn, ve, vd = x[3], x[4], x[5]
    # place in the middle of the step, for gravity and the rates of the frames
    lat, height = x[0] + 0.5 * vn * dt / _A, x[2] - 0.5 * vd * dt
    tx = (dtheta[0] - (x[10] + x[22]) * dt) / (1 + x[16])
    ty = (dtheta[1] - (x[11] + x[23]) * dt) / (1 + x[17])
    tz = (dtheta[2] - (x[12] + x[24]) * dt) / (1 + x[18])
    ux = (dvel[0] - x[13] * dt) / (1 + x[19])
    uy = (dvel[1] - x[14] * dt) / (1 + x[20])
    uz = (dvel[2] - x[15] * dt) / (1 + x[21])
    body[0], body[1], body[2], body[3], body[4], body[5] = tx, ty, tz, ux, uy, uz
    # rotation of the body during the step, to second order: u + t x u / 2 + t x (t x u) / 6
    sx, sy, sz = ty * uz - tz * uy, tz * ux - tx * uz, tx * uy - ty * ux
    bx = ux + 0.5 * sx + (ty * sz - tz * sy) / 6
    by = uy + 0.5 * sy + (tz * sx - tx * sz) / 6
    bz = uz + 0.5 * sz + (tx * sy - ty * sx) / 6
    fx = c[0, 0] * bx + c[0, 1] * by + c[0, 2] * bz
    fy = c[1, 0] * bx + c[1, 1] * by + c[1, 2] * bz
    fz = c[2, 0] * bx + c[2, 1] * by + c[2, 2] * bz

    sine, cosine = math.sin(lat), math.cos(lat)
    w2 = 1 - _E2 * sine * sine
    normal = _A / math.sqrt(w2)
    meridian = normal * (1 - _E2) / w2
    across, along = (normal + height) * cosine, (normal * (1 - _E2) + height) * sine
    outward, northward = attract(across, along, math.sqrt(across * across + along * along))
    outward += _RATE * _RATE * across
    gn, gd = northward * cosine - outward * sine, -outward * cosine - northward * sine
    ien, ied, tangent = _RATE * cosine, -_RATE * sine, sine / cosine
    # velocity in the middle of the step, for Coriolis and transport
    east = ve / (normal + height)
    rx, ry, rz = 2 * ien + east, -vn / (meridian + height), 2 * ied - east * tangent
    mn = vn + 0.5 * (fx + (gn - (ry * vd - rz * ve)) * dt)
    me = ve + 0.5 * (fy - (rz * vn - rx * vd) * dt)
    md = vd + 0.5 * (fz + (gd - (rx * ve - ry * vn)) * dt)
    east = me / (normal + height)
    enn, ene, end = east, -mn / (meridian + height), -east * tangent
    zx, zy, zz = (ien + enn) * dt, ene * dt, (ied + end) * dt
    # rotation of the navigation frame during the step
    gx = fx - 0.5 * (zy * fz - zz * fy)
    gy = fy - 0.5 * (zz * fx - zx * fz)
    gz = fz - 0.5 * (zx * fy - zy * fx)
    dv_n[0], dv_n[1], dv_n[2] = gx, gy, gz
    rx, ry, rz = 2 * ien + enn, ene, 2 * ied + end
    new_n = vn + gx + (gn - (ry * md - rz * me)) * dt
    new_e = ve + gy - (rz * mn - rx * md) * dt
    new_d = vd + gz + (gd - (rx * me - ry * mn)) * dt

    x[1] += 0.5 * (ve + new_e) * dt / ((normal + height) * cosine)
    x[0] += 0.5 * (vn + new_n) * dt / (meridian + height)
    x[2] -= 0.5 * (vd + new_d) * dt
    x[3], x[4], x[5] = new_n, new_e, new_d

    pw, px, py, pz = small_rotation(tx, ty, tz)
    qw, qx, qy, qz = multiply(x[6], x[7], x[8], x[9], pw, px, py, pz)
    pw, px, py, pz = small_rotation(-zx, -zy, -zz)
    qw, qx, qy, qz = multiply(pw, px, py, pz, qw, qx, qy, qz)
    scale = 1 / math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    x[6], x[7], x[8], x[9] = qw * scale, qx * scale, qy * scale, qz * scale
    fill_matrix(x[6], x[7], x[8], x[9], c)


@njit(cache=True)
def fade(x, h, tau, n):
    """Lets the sensor errors in x decay over h [s], tau (n - 9) being their correlation times."""
    for i in range(6):
        x[10 + i] *= math.exp(-h / tau[i])
    if n == 18 or n == 24:
        for i in range(3):
            x[22 + i] *= math.exp(-h / tau[n - 12 + i])


@njit(cache=True)
def fill_steps(t_ns, gyro, accel, increments, in_gap, ends, dt, dtheta, dvel, bridged):
    """Increments with coning and sculling over the steps that end at ends (k), which include all t_ns (n) but the first.

    gyro, accel (n, 3): instantaneous samples, or means over the interval before each (increments). in_gap (n - 1): intervals
    without slopes. With w = w0 + b t and f = f0 + d t over an interval T: coning T^3 / 12 (w x b), sculling
    T^3 / 12 (w x d - b x f), w and f being means. Filled: dt (k), dtheta, dvel (k, 3), bridged (k).
    """
    w, f, b, d = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    begin = t_ns[0]
    k = 0
    for i in range(1, t_ns.shape[0]):
        span = (t_ns[i] - t_ns[i - 1]) / 1e9
        before = (t_ns[i - 1] - t_ns[i - 2]) / 1e9 if i > 1 else span
        apart = (span + before) / 2 if increments else span
        own = 1.0 if increments and not in_gap[i - 1] else 0.5
        slope = 0.0 if in_gap[i - 1] else 1.0
        for j in range(3):
            w[j] = own * gyro[i, j] + (1 - own) * gyro[i - 1, j]
            f[j] = own * accel[i, j] + (1 - own) * accel[i - 1, j]
            b[j] = slope * (gyro[i, j] - gyro[i - 1, j]) / apart
            d[j] = slope * (accel[i, j] - accel[i - 1, j]) / apart
        square = span * span / 12
        while k < ends.shape[0] and ends[k] <= t_ns[i]:
            h = (ends[k] - begin) / 1e9
            for j in range(3):
                m, n = (j + 1) % 3, (j + 2) % 3
                coning = w[m] * b[n] - w[n] * b[m]
                sculling = w[m] * d[n] - w[n] * d[m] - (b[m] * f[n] - b[n] * f[m])
                dtheta[k, j] = (w[j] + square * coning) * h
                dvel[k, j] = (f[j] + square * sculling) * h
            dt[k] = h
            bridged[k] = in_gap[i - 1]
            begin = ends[k]
            k += 1


@njit(cache=True)
def integrate(start, dt, dtheta, dvel, states):
    """Mechanisation only: states (k, w) at the ends of k steps, from start (w)."""
    x = start.copy()
    c = np.empty((3, 3))
    dv_n = np.empty(3)
    body = np.empty(6)
    fill_matrix(x[6], x[7], x[8], x[9], c)
    for i in range(dt.shape[0]):
        take_step(x, dt[i], dtheta[i], dvel[i], c, dv_n, body)
        states[i] = x
