"""The verdict on faults of the field: what a filter without defences makes of them is called poor, a sound log is not."""

import json
from pathlib import Path

import pytest

from tests.field.promise import judge

PLAIN = ("--quick", "--set", "output.recording=false")


@pytest.mark.parametrize(
    ("method", "drive", "fault", "grade", "code"),
    [
        ("fixed", "town-rtk", None, "good", None),
        ("checked", "town", None, "good", None),
        ("fixed", "town-rtk", "slow-errors-1m-told-0.1m", "poor", "rejected"),
        ("fixed", "town-rtk", "told-both-0.05", "poor", "rejected"),
        ("checked", "town", "told-position-0.05", "fair", "told"),
    ],
)
def test_verdicts(method: str, drive: str, fault: str | None, grade: str, code: str | None, tmp_path: Path) -> None:
    assert judge(drive, fault, tmp_path, options=("--filter", method, *PLAIN)).code == 0
    verdict = json.loads((tmp_path / "out" / "report.json").read_text())["verdict"]
    assert verdict["grade"] == grade, verdict["lines"]
    assert [fault["code"] for fault in verdict["faults"]][:1] == ([] if code is None else [code])
