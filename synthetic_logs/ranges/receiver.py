"""A receiver of raw measurements: its settings, and the signals that reach it."""

from dataclasses import dataclass, field
from math import pi

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats
from synthetic_logs.ranges.draws import Draws, exponential
from synthetic_logs.ranges.receiver_clock import ReceiverClock
from synthetic_logs.ranges.sight import Sights
from synthetic_logs.ranges.surroundings import Surroundings, figure_at, is_blocked, visit_at

__all__ = ["Receiver", "Reception", "noise_growth", "open_sky_cn0", "receive"]

_REFERENCE_CN0 = 45.0
_ZENITH_CN0, _HORIZON_LOSS = 49.0, 9.0
_TRACKING_CN0 = 22.0


@dataclass(frozen=True, slots=True)
class Receiver:
    """Settings of a receiver and what disturbs its measurements.

    systems: letters of `synthetic_logs.ranges.constellation`. elevation_mask [rad]. pseudorange_std [m], range_rate_std [m/s]:
    white noise at 45 dB-Hz; it grows as the amplitude of the signal falls, with lower elevation and attenuation. multipath_std
    [m], rate_multipath_std [m/s] with multipath_time [s]: Gauss-Markov errors under open sky. noise_windows: (start, end,
    scale) of the white noise, in seconds from the start of the log. surroundings: stretches that are not open sky, later ones
    replacing earlier. ionosphere_mismatch: standard deviation of the share by which the ionosphere is not as broadcast.
    troposphere_mismatch [m]: that of the zenith delay against the standard atmosphere. system_offset_std [m]: of the clock
    offsets of the second and further systems against the first.

    The standard deviations told in the log are those of noise and multipath under open sky at the satellite's elevation:
    noise_windows and surroundings are never told.
    """

    systems: str = "GEC"
    elevation_mask: float = 10 * pi / 180
    pseudorange_std: float = 0.8
    range_rate_std: float = 0.05
    clock: ReceiverClock = field(default_factory=ReceiverClock)
    multipath_std: float = 0.0
    rate_multipath_std: float = 0.0
    multipath_time: float = 20.0
    noise_windows: tuple[tuple[float, float, float], ...] = ()
    surroundings: tuple[Surroundings, ...] = ()
    ionosphere_mismatch: float = 0.0
    troposphere_mismatch: float = 0.0
    system_offset_std: float = 0.0


@dataclass(frozen=True, eq=False, slots=True)
class Reception:
    """Signals as they arrive, (k,) each: cn0 [dB-Hz]; reflected: no direct signal; received: strong enough to be tracked."""

    cn0: Floats
    reflected: NDArray[np.bool_]
    received: NDArray[np.bool_]

    def rows(self, kept: NDArray[np.bool_]) -> "Reception":
        """The rows where kept (k,) is true."""
        return Reception(self.cn0[kept], self.reflected[kept], self.received[kept])


def open_sky_cn0(elevation: Floats) -> Floats:
    """Carrier-to-noise density [dB-Hz] of an unobstructed signal at elevation (k,) [rad]."""
    return _ZENITH_CN0 - _HORIZON_LOSS * (1 - np.sin(elevation))


def noise_growth(cn0: Floats) -> Floats:
    """White noise at cn0 (k,) [dB-Hz] over that at 45 dB-Hz: inverse to the amplitude, as in a delay or frequency lock loop
    above its threshold (P. D. Groves, Principles of GNSS, Inertial and Multisensor Integrated Navigation Systems, 9.3.3)."""
    return np.asarray(10 ** ((_REFERENCE_CN0 - cn0) / 20))


def receive(receiver: Receiver, sights: Sights, course: Floats, t_s: Floats, draws: Draws) -> Reception:
    """What of the sights reaches the receiver, that stands along course (n,) [rad] at its epochs t_s (n,) [s]."""
    places = receiver.surroundings

    def figure(name: str) -> Floats:
        """A figure of the surroundings (k,) at each sight."""
        return figure_at(places, name, t_s)[sights.epoch]

    blocked = is_blocked(sights.azimuth, sights.elevation, course[sights.epoch], figure("roof_elevation"))
    visits = visit_at(places, t_s)
    reflected = blocked & (draws.per_visit("reflections", visits, len(places)) < figure("reflected_share"))
    fade = exponential(draws.correlated("attenuation"))
    cn0 = open_sky_cn0(sights.elevation) - figure("attenuation") * fade - reflected * figure("reflected_attenuation")
    return Reception(cn0, reflected, (~blocked | reflected) & (cn0 > _TRACKING_CN0))
