"""Every adapter where it is not needed: with the noise it is told its NEES and NIS stay in the band its file declares."""

import numpy as np
import pytest

from navreplay.adapt.likelihood.maximum_likelihood import MaximumLikelihood
from navreplay.filters.presets import Method, build_method
from navreplay.moments.linearised import Linearised
from navreplay.update.gaussian import Gaussian, chi_square, condition, symmetric
from navreplay.update.measurement import Measurement

AXES = np.eye(3)
TRANSITION = np.kron(AXES, [[1.0, 1.0], [0.0, 1.0]])
PROCESS_NOISE = 0.01 * np.kron(AXES, [[1 / 3, 1 / 2], [1 / 2, 1.0]])
OBSERVATION = np.vstack([np.kron(AXES, [[1.0, 0.0]]), np.kron(AXES, [[0.0, 1.0]])])
NOISE = np.diag([2.25] * 3 + [0.01] * 3)
START = np.kron(AXES, np.diag([4.0, 1.0]))
LABELS = ("north", "east", "down")


def track(method: Method, seed: int, epochs: int) -> tuple[float, float]:
    """Mean NEES per state and NIS per component of a tracker of position and velocity in three axes, told all truths."""
    rng = np.random.default_rng(seed)
    roots = [np.linalg.cholesky(cov) for cov in (START, PROCESS_NOISE, NOISE)]
    draws = rng.normal(size=(epochs + 1, 12))
    true, now, state = roots[0] @ draws[0, :6], Gaussian(np.zeros(6), START), method.adapter.init()
    nees, nis = [], []
    for process, noise in zip(draws[1:, :6], draws[1:, 6:], strict=True):
        true = TRANSITION @ true + roots[1] @ process
        prior = Gaussian(TRANSITION @ now.mean, symmetric(TRANSITION @ now.cov @ TRANSITION.T + PROCESS_NOISE))
        observed = OBSERVATION @ true + roots[2] @ noise
        z = Measurement(observed, OBSERVATION, NOISE, ("position",) * 3 + ("velocity",) * 3, LABELS * 2)
        adapted, used, state = method.adapter.adapt(state, prior, method.rule.innovate(prior, z))
        innovation = method.rule.innovate(adapted, z)
        nis.append(chi_square(innovation.residual, innovation.spread + used) / 6)
        now = condition(adapted, innovation, used)
        nees.append(chi_square(true - now.mean, now.cov) / 6)
    return float(np.mean(nees)), float(np.mean(nis))


BANDS = {
    "fixed": ((0.9, 1.1), (0.95, 1.05)),
    "iae": ((1.1, 1.6), (0.95, 1.1)),
    "iae-q": ((0.8, 1.1), (0.95, 1.1)),
    "sage-husa": ((1.0, 1.3), (0.9, 1.05)),
    "huber": ((0.9, 1.15), (0.85, 0.97)),
    "student-t": ((0.9, 1.25), (0.8, 0.92)),
    "correntropy": ((0.8, 1.05), (0.7, 0.85)),
    "vb": ((0.9, 1.1), (0.95, 1.05)),
    "ml": ((1.1, 1.6), (0.95, 1.05)),
    "em-kf": ((3.0, 7.0), (1.5, 5.0)),
    "em-kf-printed": ((2.0, 5.0), (1.2, 3.0)),
    "strong-tracking": ((0.8, 0.95), (0.75, 0.9)),
    "h-infinity": ((0.9, 1.1), (0.95, 1.05)),
    "ckf": ((0.9, 1.1), (0.95, 1.05)),
    "hrckf": ((0.9, 1.1), (0.95, 1.05)),
    "mcsckf": ((0.8, 1.05), (0.7, 0.85)),
    "mlckf": ((1.1, 1.6), (0.95, 1.05)),
}
"""By preset, the mean NEES per state and NIS per component that it may have."""


@pytest.mark.parametrize("name", BANDS)
def test_with_the_right_noise_nees_and_nis_stay_in_the_band(name):
    found = np.array([track(build_method(name), seed, 200) for seed in range(12)]).mean(axis=0)
    for value, (low, high) in zip(found, BANDS[name], strict=True):
        assert low < value < high, (name, found)


def test_a_long_window_of_maximum_likelihood_is_consistent():
    method = Method("ml", Linearised(), MaximumLikelihood(window=300, least=100))
    nees, nis = np.array([track(method, seed, 300) for seed in range(6)]).mean(axis=0)
    assert nees == pytest.approx(1, abs=0.1)
    assert nis == pytest.approx(1, abs=0.05)
