"""A log as one linear problem: what a forward pass linearised, from which likelihood and smoothed noise follow for any R and Q.

At epoch k the error e_k before the measurement (true minus the pass's own prediction) and the measurement's residual z_k are
    e_k = Phi_k (e_k-1 - c_k-1) + w_k, z_k = H_k e_k + v_k,
with c the correction that the pass made. The smoothed noise comes from adjoints that run backward: de Jong, Smoothing and
interpolation with the state-space model, JASA 84 (1989) 1085, and Koopman, Disturbance smoother for state space models,
Biometrika 80 (1993) 117:
    E[v|all] = R u, cov(v|all) = R - R D R; E[w|all] = Q l, cov(w|all) = Q - Q L Q.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from navreplay.calibration import _linear_kernel
from navreplay.error_models.correlated_error import CorrelatedErrors
from navreplay.timeline import Floats, Times

__all__ = [
    "Adjoints",
    "LinearLog",
    "adjoin",
    "correlate",
    "correlate_anew",
    "delete",
    "hold_sources",
    "log_likelihood",
    "process_noise",
    "scale_rows",
    "scatter_rows",
]


@dataclass(frozen=True, eq=False)
class LinearLog:
    """k epochs of a stretch with r measured components in all, n error states.

    start_ns, start (n, n): time and covariance before the first transition. t_ns: (k,). transitions: (k, n, n) to each epoch.
    rest: (k, n, n) the process noise of no source; sources: by name, (k, n, n). corrections: (k, n). starts: (k + 1,)
    rows of each epoch. residual: (r,). jacobian: (r, n). told: (k, m, m) R of each epoch, the part that it has. labels, kinds:
    (r,).
    """

    start_ns: int
    start: Floats
    t_ns: Times
    transitions: Floats
    rest: Floats
    sources: Mapping[str, Floats]
    corrections: Floats
    starts: np.ndarray
    residual: Floats
    jacobian: Floats
    told: Floats
    labels: tuple[str, ...]
    kinds: tuple[str, ...]

    @cached_property
    def rows_by_kind(self) -> Mapping[str, np.ndarray]:
        """Indices of the components of each kind."""
        kinds = np.array(self.kinds)
        return {kind: np.flatnonzero(kinds == kind) for kind in dict.fromkeys(self.kinds)}

    def by_kind(self, figures: Mapping[str, float]) -> Floats:
        """(r,) the figure of each component's kind, 1 where there is none."""
        rows = np.ones(len(self.residual))
        for kind, at in self.rows_by_kind.items():
            rows[at] = figures.get(kind, 1.0)
        return rows

    @cached_property
    def epochs(self) -> np.ndarray:
        """(r,) epoch of each component."""
        return np.repeat(np.arange(len(self.t_ns)), np.diff(self.starts))

    @cached_property
    def places(self) -> np.ndarray:
        """(r,) place of each component within its epoch."""
        return np.arange(len(self.residual)) - self.starts[self.epochs]


class Adjoints(NamedTuple):
    """pulls u (k, m), zero where an epoch has no component, and holds D (k, m, m) of the measurements; state_pulls l (k, n)
    and state_holds L (k, n, n) of the process noise."""

    log_likelihood: float
    pulls: Floats
    holds: Floats
    state_pulls: Floats
    state_holds: Floats


def hold_sources(log: LinearLog) -> LinearLog:
    """The log with all process noise as the pass had it, of no source."""
    return replace(log, rest=process_noise(log, {}), sources={})


def scatter_rows(log: LinearLog, rows: Floats, absent: float) -> Floats:
    """(k, m) of rows (r,), absent where an epoch has no component."""
    padded = np.full(log.told.shape[:2], absent)
    padded[log.epochs, log.places] = rows
    return padded


def scale_rows(log: LinearLog, ratios: Floats) -> Floats:
    """The told R (k, m, m) with the variance of each component multiplied by ratios (r,)."""
    root = np.sqrt(scatter_rows(log, ratios, 1.0))
    return np.asarray(log.told * root[:, :, None] * root[:, None, :])


def process_noise(log: LinearLog, ratios: Mapping[str, float]) -> Floats:
    """Q (k, n, n) with each source multiplied by its ratio, where one is given."""
    return np.asarray(log.rest + sum(ratios.get(name, 1.0) * part for name, part in log.sources.items()))


def log_likelihood(log: LinearLog, process: Floats, noise: Floats) -> float:
    """Of all measurements, with Q = process (k, n, n) and R = noise (k, m, m)."""
    return _filter(log, process, noise)[0]


def _filter(log: LinearLog, process: Floats, noise: Floats) -> tuple[float, Floats, Floats, Floats]:
    (k, n), m = log.corrections.shape, log.told.shape[1]
    innovation, weights, gains = np.empty(len(log.residual)), np.zeros((k, m, m)), np.zeros((k, n, m))
    known = log.corrections, log.starts, log.residual, log.jacobian
    value = _linear_kernel.filter_forward(
        log.start, log.transitions, process, *known, np.ascontiguousarray(noise), innovation, weights, gains
    )
    return float(value), innovation, weights, gains


def adjoin(log: LinearLog, process: Floats, noise: Floats) -> Adjoints:
    """Log-likelihood and smoothed noise with Q = process (k, n, n) and R = noise (k, m, m)."""
    value, innovation, weights, gains = _filter(log, process, noise)
    (k, n), m = log.corrections.shape, log.told.shape[1]
    pulls, holds = np.zeros(len(log.residual)), np.zeros((k, m, m))
    state_pulls, state_holds = np.empty((k, n)), np.empty((k, n, n))
    _linear_kernel.adjoin_backward(
        log.transitions, log.starts, log.jacobian, innovation, weights, gains, pulls, holds, state_pulls, state_holds
    )
    return Adjoints(value, scatter_rows(log, pulls, 0.0), holds, state_pulls, state_holds)


def correlate(log: LinearLog, errors: CorrelatedErrors) -> LinearLog:
    """The log with those errors of its fixes as c further states, which no correction has touched."""
    dt = np.diff(log.t_ns, prepend=log.start_ns) / 1e9
    (k, n), c = log.corrections.shape, errors.size
    wide = {name: np.zeros((k, n + c, n + c)) for name in ("transitions", "rest", *log.sources)}
    wide["transitions"][:, :n, :n], wide["transitions"][:, n:, n:] = log.transitions, errors.transitions(dt)
    wide["rest"][:, :n, :n], wide["rest"][:, n:, n:] = log.rest, errors.noises(dt)
    for name, part in log.sources.items():
        wide[name][:, :n, :n] = part
    return replace(
        log,
        start=errors.enter(log.start),
        transitions=wide.pop("transitions"),
        rest=wide.pop("rest"),
        sources=wide,
        corrections=np.hstack([log.corrections, np.zeros((k, c))]),
        jacobian=np.hstack([log.jacobian, errors.jacobian(log.labels)]),
    )


def correlate_anew(log: LinearLog, wide: LinearLog, errors: CorrelatedErrors) -> LinearLog:
    """What `correlate` makes of the log, from wide, which it made for errors of the same kinds: only what depends on their
    size and time is made again."""
    dt = np.diff(log.t_ns, prepend=log.start_ns) / 1e9
    n = log.corrections.shape[1]
    transitions, rest = wide.transitions.copy(), wide.rest.copy()
    transitions[:, n:, n:], rest[:, n:, n:] = errors.transitions(dt), errors.noises(dt)
    return replace(wide, start=errors.enter(log.start), transitions=transitions, rest=rest)


def delete(log: LinearLog, found: Adjoints, noise: Floats, told: Floats, rows: np.ndarray) -> tuple[Floats, Floats]:
    """Groups of m components, rows (e, m), against what all other measurements say of them: residual and spread (e, m) in
    coordinates in which their told R (of the epochs (k, m', m')) is the identity and the spread is diagonal.

    The residual D^-1 u has the covariance D^-1 = R + spread, with R that of noise (k, m', m').
    """
    epochs, places = log.epochs[rows[:, 0]], log.places[rows]
    block = epochs[:, None, None], places[:, :, None], places[:, None, :]
    cov = np.linalg.inv(found.holds[block])
    residual = cov @ found.pulls[epochs[:, None], places][:, :, None]
    half = np.linalg.inv(np.linalg.cholesky(told[block]))
    spread, turn = np.linalg.eigh(half @ (cov - noise[block]) @ np.swapaxes(half, 1, 2))
    return (np.swapaxes(turn, 1, 2) @ half @ residual)[:, :, 0], np.maximum(spread, 0.0)
