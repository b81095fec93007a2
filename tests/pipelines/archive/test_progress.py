"""How far a batch is: on a terminal, without one, and for programs."""

import io
import json
import sys

import pytest

from pipelines.archive.progress import show_batch

EVENTS = (
    {"event": "left out", "drive": "twin", "reason": "holds the same as a"},
    {"event": "started", "drive": "a[red]"},
    {"event": "done", "drive": "a[red]", "method": "m", "reason": "", "number": 1, "of": 3, "left_s": 300.0},
    {"event": "started", "drive": "b"},
    {"event": "failed", "drive": "b", "method": "m", "reason": "broken [bold]", "number": 2, "of": 3, "left_s": 30.0},
)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_the_whole_the_running_drives_and_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    with show_batch(3, False, False) as tell:
        for event in EVENTS:
            tell(event)
    shown = screen.getvalue()
    for text in ("b (m): broken [bold]", "twin: left out: holds the same as a", "2/3", "30 s left"):
        assert text in shown


def test_without_a_terminal_only_failures_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with show_batch(3, False, False) as tell:
        for event in EVENTS:
            tell(event)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.splitlines() == ["twin: left out: holds the same as a", "b (m): broken [bold]"]


def test_programs_get_a_line_of_json_for_each_event(capsys: pytest.CaptureFixture[str]) -> None:
    with show_batch(3, True, False) as tell:
        for event in EVENTS:
            tell(event)
    assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == list(EVENTS)
