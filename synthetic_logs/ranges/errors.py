"""Errors of pseudoranges and range rates: white noise by C/N0, multipath, reflections, outliers; and their true moments."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats
from synthetic_logs.ranges.draws import Draws, exponential
from synthetic_logs.ranges.receiver import Receiver, Reception, noise_growth, open_sky_cn0
from synthetic_logs.ranges.sight import Sights
from synthetic_logs.ranges.surroundings import figure_at

__all__ = ["RangeErrors", "ToldNoise", "draw_range_errors", "tell_noise"]


@dataclass(frozen=True, eq=False, slots=True)
class RangeErrors:
    """What was drawn for the ranges of a log, row by row of them; all (k,).

    pseudorange [m], range_rate [m/s]: the whole errors but for clocks and atmosphere. correlated [m], rate_correlated
    [m/s]: the parts that are correlated in time (multipath, reflection). reflected, outlier: labels. pseudorange_mean [m],
    pseudorange_std [m], range_rate_std [m/s]: true mean and standard deviations, given the surroundings, the strength of the
    signal and whether it is reflected; outliers enter with their probability.
    """

    pseudorange: Floats
    range_rate: Floats
    correlated: Floats
    rate_correlated: Floats
    reflected: NDArray[np.bool_]
    outlier: NDArray[np.bool_]
    pseudorange_mean: Floats
    pseudorange_std: Floats
    range_rate_std: Floats


@dataclass(frozen=True, eq=False, slots=True)
class ToldNoise:
    """Standard deviations that the log tells: pseudorange_std [m], range_rate_std [m/s], (k,) each."""

    pseudorange_std: Floats
    range_rate_std: Floats


def tell_noise(receiver: Receiver, elevation: Floats) -> ToldNoise:
    """Noise and multipath as the receiver expects them under open sky at elevation (k,) [rad]."""
    growth = noise_growth(open_sky_cn0(elevation))
    return ToldNoise(
        np.hypot(receiver.pseudorange_std * growth, receiver.multipath_std),
        np.hypot(receiver.range_rate_std * growth, receiver.rate_multipath_std),
    )


def _window_scale(windows: tuple[tuple[float, float, float], ...], t_s: Floats) -> Floats:
    scale = np.ones(len(t_s))
    for start, end, factor in windows:
        scale[(t_s >= start) & (t_s < end)] *= factor
    return scale


def draw_range_errors(receiver: Receiver, sights: Sights, reception: Reception, t_s: Floats, draws: Draws) -> RangeErrors:
    """Errors of all sights (k rows) at the epochs t_s (n,) [s from the start of the log]."""

    def figure(name: str) -> Floats:
        """A figure of the surroundings (k,) at each sight."""
        return figure_at(receiver.surroundings, name, t_s)[sights.epoch]

    growth = noise_growth(reception.cn0) * _window_scale(receiver.noise_windows, t_s)[sights.epoch]
    white, rate_white = receiver.pseudorange_std * growth, receiver.range_rate_std * growth
    multipath = np.hypot(receiver.multipath_std, figure("multipath_std"))
    reflected = reception.reflected
    rate_multipath = np.hypot(receiver.rate_multipath_std, figure("rate_multipath_std"))
    rate_multipath = np.hypot(rate_multipath, reflected * figure("reflected_rate_std"))
    detour = reflected * figure("reflected_bias")
    probability, size, rate_size = figure("outlier_probability"), figure("outlier_std"), figure("outlier_rate_std")

    outlier = draws.uniform("range outliers") < probability
    correlated = multipath * draws.correlated("multipath") + detour * exponential(draws.correlated("reflected paths"))
    rate_correlated = rate_multipath * draws.correlated("rate multipath")
    return RangeErrors(
        pseudorange=white * draws.normal("pseudorange noise")
        + correlated
        + outlier * size * draws.normal("range outlier sizes"),
        range_rate=rate_white * draws.normal("range rate noise")
        + rate_correlated
        + outlier * rate_size * draws.normal("rate outlier sizes"),
        correlated=correlated,
        rate_correlated=rate_correlated,
        reflected=reflected,
        outlier=outlier,
        pseudorange_mean=detour,
        pseudorange_std=np.sqrt(white**2 + multipath**2 + detour**2 + probability * size**2),
        range_rate_std=np.sqrt(rate_white**2 + rate_multipath**2 + probability * rate_size**2),
    )
