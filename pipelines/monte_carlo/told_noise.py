"""What a filter is told of the noise in a synthetic log, and how the R it used compares with the true one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from navreplay.geodesy.earth import move_lla
from navreplay.solution import InnovationSeries
from navreplay.timeline import Floats, GnssFixSeries, RangeSeries, Timeline
from synthetic_logs.ranges.receiver import Receiver
from synthetic_logs.ranges.simulated import RangeTruth
from synthetic_logs.ranges.surroundings import figure_at
from synthetic_logs.sensors.gnss import FixErrors, GnssErrors
from synthetic_logs.simulation import SyntheticLog

__all__ = ["Knowledge", "NoiseRatio", "StartErrors", "compare_noise", "displace_start", "tell"]

Knowledge = Literal["log", "moments", "model"]
"""log: what the log tells. moments: the true mean and variance at every time (the moment oracle); what the atmosphere departs
from its models stays for a log, and belongs to the mean. model (the clairvoyant): also
which measurements are outliers or of a mixture's wide part, and, for errors that are correlated in time, a variance of white
noise with the same spectral density at low frequencies, sigma^2 (1 + rho) / (1 - rho): what a filter without shaping states
can make of the true coloured-noise model."""


@dataclass(frozen=True, eq=False, slots=True)
class NoiseRatio:
    """Per measurement of one kind: t_s (r,) from the start of the log, used (r,) the variance used, and its ratio (r,) to the
    true one. labels: of the m components that come in turn, m of them per epoch; empty where epochs differ in them."""

    t_s: Floats
    used: Floats
    ratio: Floats
    labels: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class StartErrors:
    """Errors NED, estimated minus true, of the position [m] and velocity [m/s] that a filter starts with; it is told their
    magnitudes as standard deviations."""

    position: tuple[float, float, float]
    velocity: tuple[float, float, float]


def tell(log: SyntheticLog, knowledge: Knowledge) -> Timeline:
    """The log as a filter of that knowledge sees it, with the truth as reference."""
    timeline = log.timeline()
    if knowledge == "log":
        return timeline
    clairvoyant = knowledge == "model"
    if log.fixes is not None and log.fix_errors is not None and log.scenario.gnss is not None:
        interval = 1 / log.scenario.journey.gnss_rate
        timeline = replace(timeline, fixes=_tell_fixes(log.fixes, log.fix_errors, log.scenario.gnss, interval, clairvoyant))
    if log.attitude is not None and log.attitude_errors is not None:
        timeline = replace(timeline, attitude=replace(log.attitude, cov=log.attitude_errors.cov))
    if log.ranges is not None and log.range_truth is not None and log.scenario.receiver is not None:
        timeline = replace(timeline, ranges=_tell_ranges(log, log.ranges, log.range_truth, log.scenario.receiver, clairvoyant))
    return timeline


def displace_start(timeline: Timeline, log: SyntheticLog, errors: StartErrors) -> Timeline:
    """The timeline of a log with fixes whose first fix, from which a filter starts, has those errors instead of its own."""
    if timeline.fixes is None or log.fix_errors is None:
        raise ValueError("initial errors are put into the first fix, but the scenario has no fixes")
    fixes, true = timeline.fixes, log.fix_errors.antenna
    lla, vel_n, cov_pos, cov_vel = (a.copy() for a in (fixes.lla, fixes.vel_n, fixes.cov_pos, fixes.cov_vel))
    lla[0] = move_lla(true.lla[0], np.array(errors.position))
    vel_n[0] = true.vel_n[0] + errors.velocity
    cov_pos[0], cov_vel[0] = np.diag(np.square(errors.position)), np.diag(np.square(errors.velocity))
    return replace(timeline, fixes=replace(fixes, lla=lla, vel_n=vel_n, cov_pos=cov_pos, cov_vel=cov_vel))


def _whitened(time_constant: float, interval: float) -> float:
    """(1 + rho) / (1 - rho) of a Gauss-Markov error."""
    rho = np.exp(-interval / time_constant)
    return float((1 + rho) / (1 - rho))


def _tell_fixes(
    fixes: GnssFixSeries, errors: FixErrors, settings: GnssErrors, interval: float, clairvoyant: bool
) -> GnssFixSeries:
    cov_pos, cov_vel = errors.cov_pos, np.where(fixes.has_velocity[:, None, None], errors.cov_vel, np.nan)
    if clairvoyant:
        steady = np.diag(np.square(settings.correlated_std))
        share = settings.mixture_probability
        mean_scale = 1 - share + share * settings.mixture_scale**2
        drawn = (np.where(errors.wide, settings.mixture_scale**2, 1.0) / mean_scale)[:, None, None]
        outlier = (errors.outlier * settings.outlier_size**2 / 3)[:, None, None] * np.eye(3)
        coloured = steady * _whitened(settings.correlation_time, interval)
        cov_pos, cov_vel = (cov_pos - steady) * drawn + coloured + outlier, cov_vel * drawn
    lla, vel_n = move_lla(fixes.lla, -errors.bias_pos), fixes.vel_n - errors.bias_vel
    return replace(fixes, lla=lla, vel_n=vel_n, cov_pos=cov_pos, cov_vel=cov_vel)


def _tell_ranges(
    log: SyntheticLog, ranges: RangeSeries, truth: RangeTruth, receiver: Receiver, clairvoyant: bool
) -> RangeSeries:
    errors = truth.errors
    variance, rate_variance = errors.pseudorange_std**2, errors.range_rate_std**2
    if clairvoyant:
        t_s = (ranges.t_ns - log.scenario.journey.start_ns) / 1e9

        def figure(name: str) -> Floats:
            """A figure of the surroundings (n,) at the times of the ranges."""
            return figure_at(receiver.surroundings, name, t_s)

        grown = _whitened(receiver.multipath_time, 1 / log.scenario.journey.gnss_rate) - 1
        correlated = receiver.multipath_std**2 + figure("multipath_std") ** 2 + errors.pseudorange_mean**2
        reflected = (errors.reflected * figure("reflected_rate_std")) ** 2
        rate_correlated = receiver.rate_multipath_std**2 + figure("rate_multipath_std") ** 2 + reflected
        known = errors.outlier - figure("outlier_probability")
        variance = variance + known * figure("outlier_std") ** 2 + grown * correlated
        rate_variance = rate_variance + known * figure("outlier_rate_std") ** 2 + grown * rate_correlated
    return replace(
        ranges,
        pseudorange=ranges.pseudorange - errors.pseudorange_mean - truth.delays.unmodelled,
        pseudorange_std=np.sqrt(variance),
        range_rate_std=np.sqrt(rate_variance),
    )


def compare_noise(innovations: Sequence[InnovationSeries], log: SyntheticLog) -> dict[str, NoiseRatio]:
    """By kind, the R that a filter used for each of its innovations against the variance in the log's truth."""
    truths = _true_variances(log)
    compared = {}
    for series in innovations:
        names = [(label,) for label in series.sources] if series.sources else [series.labels] * len(series.t_ns)
        true = [[truths[series.kind][t, name] for name in row] for t, row in zip(series.t_ns.tolist(), names, strict=True)]
        used = series.noise_std**2
        ratio = used / np.array(true)
        t_s = (np.repeat(series.t_ns, ratio.shape[1]) - log.scenario.journey.start_ns) / 1e9
        labels = () if series.sources else series.labels
        compared[series.kind] = NoiseRatio(t_s, used.ravel(), ratio.ravel(), labels)
    return compared


def _true_variances(log: SyntheticLog) -> dict[str, Mapping[tuple[int, str], float]]:
    """By kind: variance by time and label."""
    truths: dict[str, Mapping[tuple[int, str], float]] = {}
    if log.fixes is not None and log.fix_errors is not None:
        times = log.fixes.t_ns.tolist()
        for kind, cov in (("position", log.fix_errors.cov_pos), ("velocity", log.fix_errors.cov_vel)):
            truths[kind] = {
                (t, axis): float(cov[i, j, j]) for i, t in enumerate(times) for j, axis in enumerate(("north", "east", "down"))
            }
    if log.attitude is not None and log.attitude_errors is not None:
        truths["attitude"] = {
            (t, axis): float(cov[j, j])
            for t, cov in zip(log.attitude.t_ns.tolist(), log.attitude_errors.cov, strict=True)
            for j, axis in enumerate(("north", "east", "down"))
        }
    if log.ranges is not None and log.range_truth is not None:
        keys = list(zip(log.ranges.t_ns.tolist(), log.ranges.sat.tolist(), strict=True))
        errors = log.range_truth.errors
        for kind, std in (("range", errors.pseudorange_std), ("range_rate", errors.range_rate_std)):
            truths[kind] = dict(zip(keys, (std**2).tolist(), strict=True))
    return truths
