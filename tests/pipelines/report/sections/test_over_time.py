"""Errors along and across the track, and NIS with its bounds."""

import numpy as np
import pytest

from pipelines.report.sections.over_time import along_across, plot_nis
from tests.helpers.sample_drive import make_solution


def test_ahead_and_right_are_positive_whatever_the_course() -> None:
    course = np.linspace(0, 2 * np.pi, 50)
    ahead = np.stack([np.cos(course), np.sin(course)], axis=1)
    right = np.stack([-np.sin(course), np.cos(course)], axis=1)
    np.testing.assert_allclose(along_across(3 * ahead - 2 * right, 7 * ahead), np.tile([3.0, -2.0], (50, 1)), atol=1e-12)
    assert np.isnan(along_across(ahead, 0.1 * ahead)).all()


def test_nis_is_drawn_between_the_bounds_of_its_freedom() -> None:
    solution = make_solution()
    plot = plot_nis(solution.innovations, solution, ())
    assert plot.live is not None
    low, high = (layer.y[0] for layer in plot.live.panels[0].layers[2:])
    assert (low, high) == pytest.approx((0.2158, 9.3484), abs=1e-4)
