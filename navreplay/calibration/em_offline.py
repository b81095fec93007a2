"""R and Q by expectation maximisation over the whole log, with a fixed-interval smoother (the EMAKF of Lai et al.).

Source: Shumway and Stoffer, An approach to time series smoothing and forecasting using the EM algorithm, J. Time Series
Analysis 3 (1982) 253, for one factor per kind of measurement and per white noise that drives the error model. R_k = r T_k with
T_k the told one, and Q_k = sum of q_s Q_k,s over the sources. With the smoothed noise in terms of the adjoints (linear_log.py)
    r <- r (1 + sum of tr(R_k (u u' - D)) / m), q_s <- q_s (1 + sum over k of tr(q_s Q_k,s (l l' - L)) / n_s),
m components of the kind in all; n_s states that the source reaches, summed over k. This is the M-step for each source's own
noise as a hidden variable, so that the likelihood of the log never falls.
The log is linearised about a pass with the noise as told, and again about one with the noise found.
Assumes: Gaussian white noise whose told size is wrong by constant factors; the error model is right but for them.
Fails: noise that changes or is correlated gets one factor (see `auto`). What the log does not show (the walk of biases in a
short log) stays nearly as told: EM moves slowly where the likelihood is flat. Few epochs: a factor's relative error in variance
is sqrt(2 / m) at best.
When well specified: mean NEES per state 0.9 to 1.1, NIS per component 0.95 to 1.05.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from navreplay.adapt.fixed import Fixed
from navreplay.calibration.linear_log import LinearLog, adjoin, process_noise, scale_rows
from navreplay.calibration.settled import Settled, Trace
from navreplay.error_models.noise_sources import IMU_SOURCES, MOTION_SOURCES, scale_sources
from navreplay.options import FilterOptions
from navreplay.timeline import LogError

__all__ = [
    "SCALED_KINDS",
    "EmOffline",
    "Factors",
    "apply_factors",
    "estimated_figures",
    "improve_factors",
    "maximise_likelihood",
]

Factors = Mapping[str, float]
"""Of variances, by kind of measurement and by source of process noise."""

_GROWTH = 1.5
"""Of the stretch of EM's steps."""
_KIND_SCALES = {"position": "position_noise_scale", "velocity": "velocity_noise_scale"}
_RANGE_SCALES = {"range": "pseudorange_noise_scale", "range_rate": "range_rate_noise_scale"}
SCALED_KINDS = (*_KIND_SCALES, *_RANGE_SCALES)
"""Kinds of measurement of GNSS whose told noise the options scale."""
_ATTITUDE_KINDS = ("attitude", "heading")
"""A log has one of them."""


def improve_factors(logs: Sequence[LinearLog], factors: Factors) -> tuple[Factors, float]:
    """One step of expectation and maximisation, and the log-likelihood with the factors as given."""
    total, gained, count = 0.0, dict.fromkeys(factors, 0.0), dict.fromkeys(factors, 0)
    for log in logs:
        noise = scale_rows(log, log.by_kind(factors))
        found = adjoin(log, process_noise(log, factors), noise)
        total += found.log_likelihood
        excess = found.pulls[:, :, None] * found.pulls[:, None, :] - found.holds
        rows = (noise * excess).sum(axis=2)[log.epochs, log.places]
        for kind, at in log.rows_by_kind.items():
            if kind in factors:
                gained[kind] += float(rows[at].sum())
                count[kind] += len(at)
        state_excess = found.state_pulls[:, :, None] * found.state_pulls[:, None, :] - found.state_holds
        for name, part in log.sources.items():
            gained[name] += factors[name] * float((part * state_excess).sum())
            count[name] += int((np.diagonal(part, axis1=1, axis2=2) > 0).sum())
    return {name: value * (1 + gained[name] / count[name]) for name, value in factors.items()}, total


def maximise_likelihood(
    logs: Sequence[LinearLog], factors: Factors, steps: int, tolerance: float
) -> tuple[Factors, list[float]]:
    """Factors after at most so many steps, fewer where the log-likelihood gains less than tolerance; and its course.

    Where the likelihood is flat EM creeps, so its steps are stretched, the more the longer that goes well; a stretched step
    that loses likelihood is taken back for the plain one (Salakhutdinov and Roweis, Adaptive overrelaxed bound optimization
    methods, ICML 2003).
    """
    improved, value = improve_factors(logs, factors)
    course, stretch = [value], 1.0
    for _ in range(steps):
        stretched = {name: factors[name] * (improved[name] / factors[name]) ** stretch for name in factors}
        onward, value = improve_factors(logs, stretched)
        if value < course[-1] and stretch > 1:
            stretched, stretch = dict(improved), 1.0
            onward, value = improve_factors(logs, stretched)
        course.append(value)
        factors, improved = stretched, onward
        if course[-1] - course[-2] < tolerance:
            break
        stretch *= _GROWTH
    return factors, course


@dataclass(frozen=True, slots=True)
class EmOffline:
    """passes: linearisations of the log. steps: of EM in each, at most; tolerance: gain of log-likelihood that ends them.

    The first pass estimates R alone: the covariance that it starts from rests on the told R, and what is wrong with that would
    be taken for Q.
    """

    passes: int = 3
    steps: int = 100
    tolerance: float = 0.01

    @property
    def traces(self) -> int:
        """How many passes it asks for."""
        return self.passes

    def settle(self, options: FilterOptions, trace: Trace) -> Settled:
        """The options with the scales and densities found. Raises LogError for a log without measurements."""
        found, notes = options, []
        for i in range(self.passes):
            logs = trace(found, Fixed(), () if i == 0 else IMU_SOURCES + MOTION_SOURCES)
            factors = _all_ones(logs)
            factors, course = maximise_likelihood(logs, factors, self.steps, self.tolerance)
            found = apply_factors(found, factors)
            notes.append(
                f"em-offline, pass {i + 1}: log-likelihood {course[0]:.1f} to {course[-1]:.1f} in {len(course)} steps; "
                + ", ".join(f"{name.replace('_', ' ')} times {sqrt(value):.3g}" for name, value in factors.items())
            )
        return Settled(found, Fixed(), estimated_figures(found, factors), tuple(notes))


def _all_ones(logs: Sequence[LinearLog]) -> Factors:
    kinds = [kind for log in logs for kind in log.rows_by_kind if kind in (*SCALED_KINDS, *_ATTITUDE_KINDS)]
    names = dict.fromkeys((*kinds, *(name for log in logs for name in log.sources)))
    if not names:
        raise LogError("filter 'em-offline': no measurement lies in the time span of the filter; there is no noise to estimate")
    return dict.fromkeys(names, 1.0)


def apply_factors(options: FilterOptions, factors: Factors) -> FilterOptions:
    """The options with the factors of variance multiplied in."""
    roots = {name: sqrt(value) for name, value in factors.items()}
    scales = {key: getattr(options, key) * roots[kind] for kind, key in _KIND_SCALES.items() if kind in roots}
    ranges = {key: getattr(options.ranges, key) * roots[kind] for kind, key in _RANGE_SCALES.items() if kind in roots}
    root = next((roots[kind] for kind in _ATTITUDE_KINDS if kind in roots), 1.0)
    attitude = replace(options.attitude, noise_scale=options.attitude.noise_scale * root)
    return scale_sources(replace(options, **scales, ranges=replace(options.ranges, **ranges), attitude=attitude), roots)


def estimated_figures(options: FilterOptions, factors: Factors) -> dict[str, float]:
    """The options that the factors changed, by name."""
    figures = {key: getattr(options, key) for kind, key in _KIND_SCALES.items() if kind in factors}
    figures |= {key: getattr(options.ranges, key) for kind, key in _RANGE_SCALES.items() if kind in factors}
    if not factors.keys().isdisjoint(_ATTITUDE_KINDS):
        figures["attitude_noise_scale"] = options.attitude.noise_scale
    figures |= {name: getattr(options.imu_noise, name) for name in IMU_SOURCES if name in factors}
    return figures | {name: getattr(options.motion, name) for name in MOTION_SOURCES if name in factors}
