"""The rooms: each says what lives there and stays small enough to be read at a glance; import-linter holds their arrows."""

import ast
from pathlib import Path

import pytest

from tests.helpers.paths import ROOT

PACKAGES = ("navreplay", "importers", "pipelines", "synthetic_logs")
ROOMS = sorted(folder.parent for package in PACKAGES for folder in (ROOT / package).rglob("__init__.py"))
MOST_FILES = 15


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_a_room_says_what_lives_there_and_holds_few_files(room: Path) -> None:
    docstring = ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8")))
    assert docstring, f"{room}/__init__.py does not say what lives there"
    files = sorted(path.name for path in room.glob("*.py"))
    assert len(files) <= MOST_FILES, f"{room} holds {len(files)} files; which of them belong together?"


def test_every_folder_of_tests_mirrors_a_room() -> None:
    """So that the test of a file is found by its path."""
    folders = {path.parent.relative_to(ROOT / "tests") for path in (ROOT / "tests").rglob("test_*.py")}
    rooms = {room.relative_to(ROOT) for room in ROOMS}
    apart = {Path(), Path("round_trips"), Path("recipes"), Path("field")}
    assert folders - rooms - apart == set()


def test_every_file_is_named_by_its_room_once() -> None:
    """`report/figures.py`, not `report/report_figures.py`."""
    stuttering = [
        path.relative_to(ROOT)
        for room in ROOMS
        for path in room.glob("*.py")
        if path.stem.startswith((f"{room.name}_", f"{room.name.rstrip('s')}_"))
    ]
    assert stuttering == []
