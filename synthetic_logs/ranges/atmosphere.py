"""Delays of ionosphere and troposphere: the correction models, and how the truth departs from them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy.time_scales import week_tow_from_gps
from navreplay.measurements.atmosphere import klobuchar_delay, saastamoinen_delay
from navreplay.timeline import Floats, Times
from synthetic_logs.ranges.receiver import Receiver
from synthetic_logs.ranges.sight import Sights
from synthetic_logs.ranges.signals import CARRIER_HZ, carrier_of
from synthetic_logs.sensors.seeding import generator_for

__all__ = ["KLOBUCHAR", "Delays", "draw_delays"]

KLOBUCHAR = (1.118e-8, 1.49e-8, -5.96e-8, -1.192e-7, 9.011e4, 3.277e4, -1.966e5, -6.554e4)
"""Broadcast alpha0..3 and beta0..3, with the digits that a RINEX header holds."""


@dataclass(frozen=True, eq=False, slots=True)
class Delays:
    """total [m]: delay of the signals (k,). unmodelled [m]: the part of it that the correction models do not know."""

    total: Floats
    unmodelled: Floats


def draw_delays(receiver: Receiver, sat: NDArray[np.str_], sights: Sights, t_ns: Times, lla: Floats, seed: int) -> Delays:
    """Delays of the sights to satellites sat (k,) from an antenna at lla (n, 3) [rad, rad, m] at the epochs t_ns (n,).

    Both mismatches stay for a log: a share of the ionosphere, and a zenith delay of the troposphere mapped by
    1 / sin(elevation).
    """
    lat, lon, height = lla[sights.epoch].T
    time_of_week = week_tow_from_gps(t_ns)[1][sights.epoch]
    at_l1 = klobuchar_delay(np.array(KLOBUCHAR), lat, lon, sights.elevation, sights.azimuth, time_of_week)
    ionosphere = at_l1 * (CARRIER_HZ["G"] / carrier_of(sat)) ** 2
    troposphere = saastamoinen_delay(lat, height, sights.elevation)
    share = receiver.ionosphere_mismatch * generator_for(seed, "ionosphere").standard_normal()
    zenith = receiver.troposphere_mismatch * generator_for(seed, "troposphere").standard_normal()
    unmodelled = share * ionosphere + zenith / np.sin(sights.elevation)
    return Delays(ionosphere + troposphere + unmodelled, unmodelled)
