"""A made-up sky over a place, for tests of ranges: satellites that stand still in directions given by elevation and azimuth."""

import numpy as np

from navreplay.geodesy import earth
from navreplay.timeline import Floats, RangeSeries

PLACE = np.array([np.radians(39.1), np.radians(117.2), 60.0])
START_NS = 1_400_000_000_000_000_000
SKY = {
    "G01": (80, 10),
    "G05": (35, 60),
    "G12": (25, 200),
    "G17": (50, 300),
    "G23": (20, 130),
    "G30": (60, 160),
    "E04": (40, 250),
    "E11": (30, 20),
    "E19": (65, 100),
    "C08": (55, 220),
    "C21": (28, 330),
}
OFFSETS = {"G": 3000.0, "E": 3012.0, "C": 2950.0}
DRIFT = 40.0


def satellite_states(place: Floats = PLACE) -> dict[str, tuple[Floats, Floats]]:
    """Position and velocity, Earth-fixed, of each satellite of the sky."""
    here, c_en = earth.ecef_from_lla(place), earth.matrix_en(place[0], place[1])
    states = {}
    for i, (name, (elevation_deg, azimuth_deg)) in enumerate(SKY.items()):
        elevation, azimuth = np.radians([elevation_deg, azimuth_deg])
        sight_n = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
        velocity = 3000.0 * np.array([np.cos(i), np.sin(i), np.cos(2 * i)])
        states[name] = here + (2.1e7 + 4e5 * i) * c_en @ sight_n, velocity
    return states


def make_ranges(
    epochs: int = 20,
    names: tuple[str, ...] = tuple(SKY),
    noise: tuple[float, float] = (0.0, 0.0),
    vel_n: tuple[float, float, float] = (0.0, 0.0, 0.0),
    told: tuple[float, float] = (1.0, 0.05),
    seed: int = 0,
) -> RangeSeries:
    """One epoch a second from an antenna at PLACE that moves with vel_n, in vacuum; satellites move evenly."""
    rng = np.random.default_rng(seed)
    states = satellite_states()
    c_en = earth.matrix_en(PLACE[0], PLACE[1])
    rows = []
    for k in range(epochs):
        for name in names:
            position, velocity = states[name]
            offset = OFFSETS[name[0]] + DRIFT * k
            when = k - offset / 299792458.0
            antenna = earth.ecef_from_lla(PLACE) + c_en @ np.array(vel_n) * when
            satellite = position + velocity * k
            distance = float(np.linalg.norm(satellite - antenna))
            sight = (satellite - antenna) / distance
            rate = float(sight @ (velocity - c_en @ np.array(vel_n))) + DRIFT
            errors = rng.standard_normal(2) * noise
            rows.append((k, name, distance + offset + errors[0], rate + errors[1], satellite, velocity))
    n = len(rows)
    return RangeSeries(
        t_ns=START_NS + np.array([row[0] for row in rows]) * 1_000_000_000,
        sat=np.array([row[1] for row in rows]),
        signal=np.full(n, "1C"),
        pseudorange=np.array([row[2] for row in rows]),
        range_rate=np.array([row[3] for row in rows]),
        pseudorange_std=np.full(n, told[0]),
        range_rate_std=np.full(n, told[1]),
        cn0=np.full(n, 45.0),
        sat_pos_e=np.array([row[4] for row in rows]),
        sat_vel_e=np.array([row[5] for row in rows]),
        ionosphere_removed=True,
        troposphere_removed=True,
    )
