"""docs/recipes.md, a command: a file in pipelines/commands with run(arguments), and a function in `_COMMANDS` that adds it."""

import sys
from types import ModuleType

import pytest

from pipelines import cli


def run(arguments) -> None:
    """Prints how many logs were named."""
    print(f"{len(arguments.logs)} logs")


def add_count(commands) -> None:
    """`navreplay count LOG...`."""
    cli._add_logs(cli._add_command(commands, "count", "count logs"))


def test_it_is_known_to_the_command_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    module = ModuleType("pipelines.commands.count")
    module.run = run
    monkeypatch.setitem(sys.modules, "pipelines.commands.count", module)
    monkeypatch.setattr(cli, "_COMMANDS", (*cli._COMMANDS, add_count))
    assert cli.main(["count", "a.mcap", "b.mcap"]) == 0
    assert capsys.readouterr().out == "2 logs\n"
