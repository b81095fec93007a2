"""Damaged logs of every format, a few of those that `python -m tests.field.mutate` tries."""

import pytest

from tests.field.mutate import main


def test_damage_of_any_kind_ends_in_order(capfd: pytest.CaptureFixture[str]) -> None:
    code = main(["--count", "52", "--seed", "11"])
    assert code == 0, capfd.readouterr().out
