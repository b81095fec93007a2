"""Every kind of stranger's log: a solution no worse than 1.2 times its fixes, or one line that says why there is none.

A part of the table that `python -m tests.field.strangers.table` prints; `-m slow` runs it whole.
"""

from pathlib import Path

import pytest

from tests.field.strangers import messages, tables
from tests.field.strangers.judge import KINDS, take_steps
from tests.field.strangers.table import kept

WRITERS = (tables, messages)
QUICK = list(KINDS)[::5]


def check(name: str, folder: Path) -> None:
    steps = take_steps(KINDS[name], folder)
    assert kept(KINDS[name], steps), steps
    assert "Traceback" not in steps.text


@pytest.mark.parametrize("name", QUICK)
def test_the_promise_holds_for_some_strangers(name: str, tmp_path: Path) -> None:
    check(name, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_the_promise_holds_for_every_stranger(name: str, tmp_path: Path) -> None:
    check(name, tmp_path)
