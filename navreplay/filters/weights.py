"""Weights of the hypotheses of a bank: how likely each has made the measurements, and what each method does to forget.

Source: Magill, Optimal adaptive estimation of sampled stochastic processes, IEEE Trans. Automatic Control 10 (1965) 434, for
`Mmae`; Maybeck, Stochastic Models, Estimation, and Control 2 (1982), 10.8, for `MmaeFloor`; Si, Wang and Niu, High precision
attitude estimation algorithm for SINS/CNS integrated navigation with unknown noise characteristics, eqs. (14)-(16) and
step (5), for `Immae`; Blom and Bar-Shalom, The interacting multiple model algorithm, IEEE Trans. Automatic Control 33 (1988)
780, for `Imm`.
w_k = L_k w_k-1 / sum(L_k w_k-1), in logarithms, with L the Gaussian likelihood of the innovation. As printed, (15) and (16)
are one recursion, and the second could never differ from the first: here the second starts from 1 / M at every assessment
interval, so that it holds the last interval and the first the whole history, which is what step (5) compares.
Assumes: one of the hypotheses is near the truth, and the gate has taken outliers out.
Fails: where no hypothesis is near, weights follow whichever is least wrong, with full conviction. Without a floor a weight that
has fallen to e^-1000 takes as long to return as it took to fall.
When well specified: mean NEES per state 0.9 to 1.1, NIS per component 0.95 to 1.05. With a floor under a scale of 1e4 NIS is
0.5 to 0.65, since a thousandth of ten thousand times Q is ten times Q in what the mixture expects.
"""

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from navreplay.timeline import Floats

__all__ = ["Hypothesis", "Imm", "Immae", "Mmae", "MmaeFloor", "Weights"]


class Hypothesis(NamedTuple):
    """Factors on the told variances of process noise and measurement noise."""

    q_scale: float
    r_scale: float


class Weights(NamedTuple):
    """logs (M,): logarithms of the weights, which sum to one. recent (M,): the same of the measurements since since_ns alone.
    restarted: whether this epoch has made all weights even again."""

    logs: Floats
    recent: Floats
    since_ns: int
    restarted: bool = False

    @property
    def values(self) -> Floats:
        """(M,) the weights."""
        return np.exp(self.logs)


@dataclass(frozen=True, slots=True)
class Mmae:
    """Multiple-model adaptive estimation over every pair of scales. inner: preset of which each hypothesis is an instance."""

    q_scales: tuple[float, ...] = (1.0, 10.0, 100.0, 1e3, 1e4)
    r_scales: tuple[float, ...] = (1.0,)
    inner: str = "fixed"

    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """(M,) the pairs of scales."""
        return tuple(Hypothesis(*pair) for pair in product(self.q_scales, self.r_scales))

    def labels(self) -> tuple[str, ...]:
        """(M,) names of the hypotheses, by the scales in which they differ."""
        names = []
        for q, r in self.hypotheses():
            parts = [f"Q × {q:g}"] if len(self.q_scales) > 1 or len(self.r_scales) == 1 else []
            names.append(", ".join(parts + [f"R × {r:g}"] * (len(self.r_scales) > 1)))
        return tuple(names)

    def start(self, t_ns: int) -> Weights:
        """Even weights at t_ns."""
        even = _normalise(np.zeros(len(self.hypotheses())))
        return Weights(even, even, t_ns)

    def weigh(self, weights: Weights, t_ns: int, log_likelihood: Floats) -> Weights:
        """The weights after an epoch at t_ns with log_likelihood (M,)."""
        return weights._replace(logs=_normalise(weights.logs + log_likelihood))

    def transitions(self, seconds: float) -> Floats | None:
        """(M, M) the probabilities that the hypothesis of a row has given way to that of a column after so many seconds; None
        where one of them is right all the time."""
        return None


@dataclass(frozen=True, slots=True)
class MmaeFloor(Mmae):
    """The same; no weight falls below floor."""

    floor: float = 1e-3

    def weigh(self, weights: Weights, t_ns: int, log_likelihood: Floats) -> Weights:
        """The weights after an epoch at t_ns with log_likelihood (M,)."""
        logs = _normalise(weights.logs + log_likelihood)
        return weights._replace(logs=_normalise(np.maximum(logs, np.log(self.floor))))


@dataclass(frozen=True, slots=True)
class Imm(Mmae):
    """The right hypothesis changes: one holds for sojourn [s] in the mean, and each of the others is as likely to follow it."""

    sojourn: float = 60.0

    def transitions(self, seconds: float) -> Floats:
        """(M, M) the probabilities that the hypothesis of a row has given way to that of a column after so many seconds."""
        size = len(self.hypotheses())
        if size == 1:
            return np.ones((1, 1))
        # of the chain whose rates out of a hypothesis are 1 / sojourn in all
        fades = np.exp(-seconds / self.sojourn * size / (size - 1))
        return np.asarray(fades * np.eye(size) + (1 - fades) / size)


@dataclass(frozen=True, slots=True)
class Immae(Mmae):
    """The same, assessed every interval [s]: where the largest weight exceeds threshold, but the measurements of the interval
    alone favour another hypothesis, all weights become even."""

    interval: float = 10.0
    threshold: float = 0.9

    def weigh(self, weights: Weights, t_ns: int, log_likelihood: Floats) -> Weights:
        """The weights after an epoch at t_ns with log_likelihood (M,)."""
        logs = _normalise(weights.logs + log_likelihood)
        recent = _normalise(weights.recent + log_likelihood)
        if t_ns - weights.since_ns < self.interval * 1e9:
            return Weights(logs, recent, weights.since_ns)
        even = self.start(t_ns)
        stuck = bool(logs.max() > np.log(self.threshold) and logs.argmax() != recent.argmax())
        return even._replace(logs=even.logs if stuck else logs, restarted=stuck)


def _normalise(logs: Floats) -> Floats:
    """Logarithms (M,) less that of their sum of exponentials."""
    largest = logs.max()
    return np.asarray(logs - (largest + np.log(np.exp(logs - largest).sum())))
