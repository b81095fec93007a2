"""Heights in feet are told by vertical velocities; in metres, on the level or without velocities nothing is."""

from dataclasses import replace

import numpy as np

from importers.vetting.heights import heights_in_metres
from tests.field.promise import spoil


def test_feet_become_metres() -> None:
    fixes = spoil("flight", None).log.fixes
    assert fixes is not None
    vetted = heights_in_metres(replace(fixes, lla=fixes.lla / [1, 1, 0.3048]))
    np.testing.assert_allclose(vetted.fixes.lla, fixes.lla)
    assert "in feet" in vetted.findings[0].text


def test_metres_stay() -> None:
    for drive in ("flight", "town", "town-positions"):
        fixes = spoil(drive, None).log.fixes
        assert heights_in_metres(fixes).fixes is fixes
