"""The pages: their Python runs, their links lead somewhere."""

import contextlib
import io
import re
from pathlib import Path

import pytest

from synthetic_logs import SCENARIOS, simulate, with_duration, write
from tests.helpers.paths import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "examples").rglob("*.md"))]
_LINK = re.compile(r"(?<!\!)\[[^\]]*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")
_CONFIG = """
[input.reference]
file = "drive.truth.csv"
[imu]
grade = "industrial"
"""


def anchors(page: Path) -> set[str]:
    """Those of its headings, as GitHub and MkDocs make them."""
    found = set()
    for heading in re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE):
        plain = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)).strip().lower()
        found.add(plain.replace(" ", "-"))
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in (one or other for one, other in _LINK.findall(text)):
        if re.match(r"[a-z]+:", target):
            continue
        place, _, anchor = target.partition("#")
        path = (page.parent / place).resolve() if place else page
        assert path.exists(), f"{page.relative_to(ROOT)}: {target} leads nowhere"
        if anchor:
            assert anchor in anchors(path), f"{page.relative_to(ROOT)}: {target} has no such heading"


def test_the_python_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every block of docs/python.md, one after the other, on a synthetic drive."""
    monkeypatch.chdir(tmp_path)
    write(simulate(with_duration(SCENARIOS["car-short"], 90.0), 1), tmp_path / "drive.mcap")
    (tmp_path / "drive.toml").write_text(_CONFIG)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 8
    names: dict[str, object] = {}
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        for block in blocks:
            exec(compile(block, "docs/python.md", "exec"), names)
    assert names["solution"].lla.shape[1] == 3
    assert {"position_north", "position_east", "in_outage"} <= set(names["errors"].columns)
    assert str(names["errors"].index.tz) == "UTC"
    assert names["run"].solution.to_pandas().shape[1] == 27
    assert ", 3)" in printed.getvalue()


def test_every_page_of_a_method_is_listed() -> None:
    listed = (ROOT / "docs/methods/README.md").read_text(encoding="utf-8")
    pages = {path.name for path in (ROOT / "docs/methods").glob("*.md")} - {"README.md", "synthetic.md"}
    assert {page for page in pages if f"({page})" not in listed} == set()
