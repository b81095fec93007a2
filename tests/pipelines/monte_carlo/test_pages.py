"""The pages of the experiments and what is said of them elsewhere agree."""

import re

import pytest

from tests.helpers.paths import ROOT

OVERVIEW = (ROOT / "docs" / "experiments.md").read_text(encoding="utf-8").splitlines()
ROWS = [
    (name, row) for row in OVERVIEW for name in re.findall(r"\(experiments/([\w-]+)\.md\)", row) if re.search(r"\d of \d", row)
]


def counted(name: str) -> set[tuple[int, int]]:
    """How many of how many published comparisons hold, as the experiment itself has written it."""
    page = (ROOT / "docs" / "experiments" / f"{name}.md").read_text(encoding="utf-8")
    return {(int(held), int(whole)) for whole, held in re.findall(r"of (\d+) comparisons (\d+) hold", page)}


@pytest.mark.parametrize("name", [name for name, _ in ROWS])
def test_the_overview_counts_the_orders_that_hold_as_the_page_does(name):
    row = dict(ROWS)[name]
    told = {(int(held), int(whole)) for held, whole in re.findall(r"(\d+) of (\d+)", row)}
    assert counted(name) & told
    assert told <= set().union(*(counted(other) for other, line in ROWS if line == row))


def test_some_rows_count():
    assert len(ROWS) >= 4


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "experiments").glob("*.md")), ids=lambda page: page.stem)
def test_counts_of_a_page_are_those_of_its_verdicts(page):
    text = page.read_text(encoding="utf-8")
    sentences = re.findall(r"order in '([^']+)'.*?of (\d+) comparisons (\d+) hold, (\d+) are contradicted and (\d+)", text)
    rows = re.findall(r"^\| .*? \| ([^|]+) \| [^|]+ \| .*\| (holds|contradicted|undecided) \|$", text, re.MULTILINE)
    for stretch, *counts in sentences:
        verdicts = [verdict for where, verdict in rows if where == stretch]
        found = [len(verdicts), *(verdicts.count(kind) for kind in ("holds", "contradicted", "undecided"))]
        assert [int(count) for count in counts] == found, stretch
