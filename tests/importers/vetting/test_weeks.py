"""Week rollovers are undone where the IMU proves them."""

from dataclasses import replace

import numpy as np
import pytest

from importers.vetting.vet import vet
from tests.field.promise import spoil

WEEKS = 1024 * 604_800 * 10**9


@pytest.mark.parametrize("turns", [-1, 1, 2])
def test_a_rollover_is_undone(turns: int) -> None:
    timeline = spoil("town", None).log.timeline()
    vetted, findings = vet(replace(timeline, fixes=replace(timeline.fixes, t_ns=timeline.fixes.t_ns - turns * WEEKS)))
    assert np.array_equal(vetted.fixes.t_ns, timeline.fixes.t_ns)
    assert [finding.code for finding in findings] == ["week-rollover"]


@pytest.mark.parametrize("days", [3, 1000, 7 * 1024 + 30])
def test_another_day_is_another_day(days: int) -> None:
    timeline = spoil("town", None).log.timeline()
    moved = replace(timeline.fixes, t_ns=timeline.fixes.t_ns - days * 86_400 * 10**9)
    vetted, findings = vet(replace(timeline, fixes=moved))
    assert vetted.fixes is moved
    assert findings == ()
