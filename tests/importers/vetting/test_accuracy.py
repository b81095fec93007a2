"""Variances told as deviations and the other way about are told; sound accuracies, and smooth receivers, are not blamed."""

from dataclasses import replace

import numpy as np
import pytest

from importers.vetting.accuracy import check_told_accuracy
from tests.field.promise import DRIVES, spoil


@pytest.mark.parametrize("drive", DRIVES)
def test_sound_accuracies_are_not_blamed(drive: str) -> None:
    fixes = spoil(drive, None).log.fixes
    assert check_told_accuracy(fixes) == ()
    for factor in (0.3, 3.0):
        assert check_told_accuracy(replace(fixes, cov_pos=fixes.cov_pos * factor)) == ()


def test_deviations_and_variances_are_told_apart() -> None:
    fixes = spoil("town-rtk", None).log.fixes
    std = np.sqrt(np.abs(fixes.cov_pos)) * np.eye(3)
    (finding,) = check_told_accuracy(replace(fixes, cov_pos=std))
    assert "hold standard deviations" in finding.text
    (finding,) = check_told_accuracy(replace(fixes, cov_pos=fixes.cov_pos @ fixes.cov_pos))
    assert "hold variances" in finding.text
