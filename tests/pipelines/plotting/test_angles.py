"""Angles are shown in the unit that suits them, whatever else is left alone."""

import numpy as np
import pytest

from navreplay.evaluation.metrics import ErrorSeries
from pipelines.plotting.angles import suit_errors, suit_unit

ARCSEC = np.pi / 180 / 3600


@pytest.mark.parametrize(
    ("unit", "size", "expected"),
    [
        ("rad", 0.1, (180 / np.pi, "deg")),
        ("rad", 2 * ARCSEC, (1 / ARCSEC, "arcsec")),
        ("deg", 1e-4, (3600.0, "arcsec")),
        ("deg", 0.5, (1.0, "deg")),
        ("m", 1e-9, (1.0, "m")),
    ],
)
def test_unit_follows_the_size(unit, size, expected):
    factor, name = suit_unit(unit, size)
    assert factor == pytest.approx(expected[0])
    assert name == expected[1]


def test_errors_of_stars_are_shown_in_arcseconds_and_unknown_ones_in_degrees():
    error = np.array([[1.0, -2.0, np.nan], [0.5, 1.0, 3.0]]) * ARCSEC
    shown = suit_errors(ErrorSeries(("north", "east", "heading"), "rad", error, np.full((2, 3), ARCSEC), np.ones(2)))
    assert shown.unit == "arcsec"
    np.testing.assert_allclose(shown.error[1], [0.5, 1.0, 3.0])
    np.testing.assert_allclose(shown.std, 1.0)
    unknown = ErrorSeries(("north", "east", "heading"), "rad", np.full((2, 3), np.nan), np.ones((2, 3)), np.ones(2))
    assert suit_errors(unknown).unit == "deg"
