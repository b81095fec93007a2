"""Positions of messages in other units come out where they are; ships off Africa stay there."""

import numpy as np
import pytest

from importers.conversion.position_units import mend_angles
from navreplay.geodesy.earth import ned_between
from tests.field.promise import spoil

TRUE = spoil("town", None).log.fixes


def as_written(unit: str) -> np.ndarray:
    assert TRUE is not None
    degrees = np.degrees(TRUE.lla[:, :2])
    whole = np.trunc(degrees)
    written = {"rad": TRUE.lla[:, :2], "ddmm": whole * 100 + (degrees - whole) * 60, "1e-7 deg": np.rint(degrees * 1e7)}[unit]
    return np.column_stack([np.radians(written), TRUE.lla[:, 2]])


@pytest.mark.parametrize("unit", ["rad", "ddmm", "1e-7 deg"])
def test_units_are_told_by_value(unit: str) -> None:
    assert TRUE is not None
    lla, note = mend_angles("/fix", TRUE.t_ns, as_written(unit))
    assert np.abs(ned_between(TRUE.lla, lla)).max() < 0.02
    assert note.startswith("/fix: latitude and longitude (")


def test_degrees_and_their_gaps_stay() -> None:
    assert TRUE is not None
    lla = TRUE.lla.copy()
    lla[3] = np.nan
    same, note = mend_angles("/fix", TRUE.t_ns, lla)
    assert same is lla
    assert not note


def test_a_ship_off_africa_is_not_in_radians() -> None:
    rng = np.random.default_rng(1)
    t_ns = np.arange(200, dtype=np.int64) * 10**9
    lla = np.column_stack([np.full(200, 0.01), 0.02 + np.arange(200) * 8 / 6.378e6, np.full(200, 20.0)])
    lla += rng.normal(0, 1, (200, 3)) * [1.2 / 6.37e6, 1.2 / 6.37e6, 2]
    assert mend_angles("/fix", t_ns, lla)[0] is lla
