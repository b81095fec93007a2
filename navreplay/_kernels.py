"""IMU-rate work, compiled: arrays in, arrays out. `.py_func` of each kernel is its reference in tests.

Packed state x (25 or longer): lat, lon [rad], height [m], v_N, v_E, v_D [m/s], q_nb (4), gyro bias (3) [rad/s], accelerometer
bias (3) [m/s^2], gyro scale (3), accelerometer scale (3), Gauss-Markov part of the gyro error (3) [rad/s]; what follows is
carried along. Error state (15, 18, 21 or 24), true minus computed: position NED [m], velocity NED [m/s], rotation vector phi in
n with C_nb true = (I + [phi x]) C_nb computed, gyro bias, accelerometer bias (, gyro scale, accelerometer scale) (,
Gauss-Markov part of the gyro error). Error equations: Groves, Principles of GNSS, Inertial, and Multisensor Integrated
Navigation Systems, 2nd ed. (2013), 14.2.4, with this sign of phi and position in metres.
"""

import math

import numpy as np
from numba import njit

from navreplay import earth

_A = earth.SEMI_MAJOR_AXIS
_E2 = earth.ECCENTRICITY_SQUARED
_RATE = earth.EARTH_RATE
_GM = earth.GM
_attract = njit(cache=True)(earth.attract)

BRIDGE_ACCEL = 1.0
"""Specific force [m/s^2] and angular rate [rad/s] that may go unseen while a gap of the IMU is bridged: standard deviations."""
BRIDGE_RATE = 0.1


@njit(cache=True, inline="always")
def _multiply(pw, px, py, pz, qw, qx, qy, qz):
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


@njit(cache=True, inline="always")
def _small_rotation(x, y, z):
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
def _fill_matrix(w, x, y, z, c):
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
def _step(x, dt, dtheta, dvel, c, dv_n, body):
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
    outward, northward = _attract(across, along, math.sqrt(across * across + along * along))
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

    pw, px, py, pz = _small_rotation(tx, ty, tz)
    qw, qx, qy, qz = _multiply(x[6], x[7], x[8], x[9], pw, px, py, pz)
    pw, px, py, pz = _small_rotation(-zx, -zy, -zz)
    qw, qx, qy, qz = _multiply(pw, px, py, pz, qw, qx, qy, qz)
    scale = 1 / math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    x[6], x[7], x[8], x[9] = qw * scale, qx * scale, qy * scale, qz * scale
    _fill_matrix(x[6], x[7], x[8], x[9], c)


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
    _fill_matrix(x[6], x[7], x[8], x[9], c)
    for i in range(dt.shape[0]):
        _step(x, dt[i], dtheta[i], dvel[i], c, dv_n, body)
        states[i] = x


@njit(cache=True)
def _fill_rate_matrix(x, span, c_dt, dv_n, c_theta, c_dvel, a):
    """a (9, n): integral of the error dynamics' rows of position, velocity and attitude over span [s]."""
    n = a.shape[1]
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
def _fill_transition(a, phi):
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
def _move_covariance(phi, decay, density, span, bridge, p, work):
    """p <- F p F' + noise of span [s] in place, half of the noise before and half after the transition (trapezoidal rule)."""
    _add_noise(p, density, span / 2, bridge / 2)
    _sandwich(phi, decay, p, work)
    _add_noise(p, density, span / 2, bridge / 2)


@njit(cache=True)
def _accumulate(h, c_start, c_end, dv_n, body, c_dt, f_dt, c_theta, c_dvel):
    """Adds a step of h [s] to the integrals that the error dynamics need: of C_nb, of specific force in n, and of C_nb times
    the body's rate and specific force, axis by axis."""
    for i in range(3):
        f_dt[i] += dv_n[i]
        for j in range(3):
            c_mean = 0.5 * (c_start[i, j] + c_end[i, j])
            c_dt[i, j] += c_mean * h
            c_theta[i, j] += c_mean * body[j]
            c_dvel[i, j] += c_mean * body[3 + j]


@njit(cache=True)
def _fade(x, h, tau, n):
    """Lets the sensor errors in x decay over h [s], tau (n - 9) being their correlation times."""
    for i in range(6):
        x[10 + i] *= math.exp(-h / tau[i])
    if n == 18 or n == 24:
        for i in range(3):
            x[22 + i] *= math.exp(-h / tau[n - 12 + i])


@njit(cache=True)
def _multiply_left(phi, decay, total, work):
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
    """Transition F = [phi; diag(decay)] and noise of a node's first covariance step, as `_multiply_left` and
    `_move_covariance` would make them of I and of zero."""
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
def propagate(
    start,
    p_start,
    cross_start,
    dt,
    dtheta,
    dvel,
    bridged,
    ends,
    density,
    tau,
    interval,
    states,
    covariances,
    crosses,
    transitions,
    noises,
):
    """Mechanisation and covariance over k nodes.

    start (w), p_start (n, n): at the beginning; cross_start (n, c): covariance with c states that do not move. dt, dtheta,
    dvel, bridged: steps. ends (k): number of steps up to and with each node, the first counted from 0; nodes share no
    step. density (n): white-noise densities. tau (n - 9): correlation times of the sensor errors, inf for random walks.
    interval [s]: longest covariance step. Filled: states (k, w), covariances (k, n, n), crosses (k, n, c) and, unless they have
    no rows, transitions and noises (k, n, n) of the node's whole interval.
    """
    n = p_start.shape[0]
    x = start.copy()
    p = p_start.copy()
    cross = cross_start.copy()
    a = np.empty((9, n))
    phi = np.empty((9, n))
    work = np.empty((9, max(n, cross.shape[1])))
    decay = np.ones(n - 9)
    c = np.empty((3, 3))
    c_start = np.empty((3, 3))
    dv_n = np.empty(3)
    body = np.empty(6)
    c_dt = np.zeros((3, 3))
    c_theta = np.zeros((3, 3))
    c_dvel = np.zeros((3, 3))
    f_dt = np.zeros(3)
    keep = transitions.shape[0] > 0
    fading = np.isfinite(tau).any()
    total_phi = np.eye(n)
    total_q = np.zeros((n, n))
    step = 0
    _fill_matrix(x[6], x[7], x[8], x[9], c)
    for node in range(ends.shape[0]):
        fresh = True
        span = 0.0
        bridge = 0.0
        while step < ends[node]:
            h = dt[step]
            c_start[:, :] = c
            _step(x, h, dtheta[step], dvel[step], c, dv_n, body)
            _accumulate(h, c_start, c, dv_n, body, c_dt, f_dt, c_theta, c_dvel)
            if fading:
                _fade(x, h, tau, n)
            if bridged[step]:
                bridge += h * h
            span += h
            step += 1
            if span < interval and step < ends[node]:
                continue
            _fill_rate_matrix(x, span, c_dt, f_dt, c_theta, c_dvel, a)
            _fill_transition(a, phi)
            for i in range(n - 9):
                decay[i] = math.exp(-span / tau[i])
            _move_covariance(phi, decay, density, span, bridge, p, work)
            if cross.shape[1] > 0:
                _multiply_left(phi, decay, cross, work)
            if keep and fresh:
                _begin_totals(phi, decay, density, span, bridge, total_phi, total_q)
            elif keep:
                _multiply_left(phi, decay, total_phi, work)
                _move_covariance(phi, decay, density, span, bridge, total_q, work)
            fresh = False
            span = 0.0
            bridge = 0.0
            c_dt[:, :] = 0
            f_dt[:] = 0
            c_theta[:, :] = 0
            c_dvel[:, :] = 0
        states[node] = x
        covariances[node] = p
        crosses[node] = cross
        if keep:
            transitions[node] = total_phi
            noises[node] = total_q
