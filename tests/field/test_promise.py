"""The promise on logs with faults of the field: no worse than 1.2 times the fixes they hold, or refused in one line.

A part of the table that `python -m tests.field.table` prints; `-m slow` runs it whole.
"""

from pathlib import Path

import pytest

from synthetic_logs.faults import FAULTS
from tests.field.promise import DRIVES, judge

WHOLE = [
    (drive, fault)
    for drive in DRIVES
    for fault in (None, *FAULTS)
    if not (drive == "town-positions" and fault is not None and "velocity" in fault)
]
QUICK = WHOLE[::5]


@pytest.mark.parametrize(("drive", "fault"), QUICK)
def test_a_solution_is_never_worse_than_its_fixes(drive: str, fault: str | None, tmp_path: Path) -> None:
    outcome = judge(drive, fault, tmp_path)
    assert outcome.kept, outcome


@pytest.mark.slow
@pytest.mark.parametrize(("drive", "fault"), WHOLE)
def test_nor_with_any_fault_of_the_table(drive: str, fault: str | None, tmp_path: Path) -> None:
    outcome = judge(drive, fault, tmp_path)
    assert outcome.kept, outcome
