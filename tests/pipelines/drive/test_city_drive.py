"""The bundled drive with raw ranges: as good as its page says, and where the reference is wrong the receiver agrees with us."""

import numpy as np
import pytest

from navreplay.geodesy import earth
from pipelines.config.spec import load_config
from pipelines.drive.process import process
from tests.helpers.paths import ROOT

FOLDER = ROOT / "examples" / "tsukishima_2020"


@pytest.fixture(scope="module")
def result():
    return process([FOLDER / "tsukishima_2020.mcap"], load_config(FOLDER / "city.toml"))


def percentiles(error):
    return [float(value) for value in (*np.percentile(error, [50, 95]), error.max())]


def test_errors_are_those_of_the_page(result):
    """A plain 17-state filter with a gate: 0.59 / 2.28 / 8.1 m horizontally, 1.80 / 3.13 m in 3-D (docs/ranges.md)."""
    error = result.evaluation.errors["position"].error
    horizontal, total = np.hypot(*error[:, :2].T), np.linalg.norm(error, axis=1)
    assert len(error) == 1323
    assert all(np.array(percentiles(horizontal)) < [0.57, 2.0, 7.2])
    assert all(np.array(percentiles(total)[:2]) < [1.6, 2.8])


def test_the_covariance_is_not_too_small(result):
    """3 expected, and 76 without the biases that are reckoned with, which are told rather too large: most epochs lie below."""
    nees = result.evaluation.errors["position"].nees
    assert np.nanmean(nees) < 3.0
    assert np.nanmean(nees < 9.35) > 0.95


def test_where_errors_are_largest_the_receiver_agrees_with_us(result):
    reference, fixes, solution = result.timeline.reference, result.timeline.fixes, result.solution
    evaluation = result.evaluation
    total = np.linalg.norm(evaluation.errors["position"].error, axis=1)
    worst = evaluation.t_ns[total > 10.0]
    assert 3 <= len(worst) <= 8
    assert np.ptp(worst) < 2e9
    for t_ns in worst:
        receiver = fixes.lla[np.argmin(np.abs(fixes.t_ns - t_ns))]
        ours = solution.lla[np.argmin(np.abs(solution.t_ns - t_ns))]
        rtk = reference.lla[np.argmin(np.abs(reference.t_ns - t_ns))]
        assert np.linalg.norm(earth.ned_between(ours, receiver)) < 2.5
        assert np.linalg.norm(earth.ned_between(rtk, receiver)) > 10


def test_every_range_is_accounted_for(result):
    for channel in result.timeline.provenance.channels:
        assert channel.read == channel.used + sum(channel.rejected.values())
