"""No page says a line twice: what a merge leaves when it puts the old wording and the new one below each other."""

from __future__ import annotations

import re
from difflib import SequenceMatcher
from pathlib import Path

from tests.support.doc_blocks import PAGES, ROOT, prose
from tests.support.each import each

#: Lines shorter than this may resemble each other, as headings and the ends of paragraphs do.
LONG = 40
#: How many lines below a line are compared with it, and from which likeness on they count as the same.
BELOW, ALIKE = 3, 0.9
#: The same of the items of a list, which are meant to be alike.
ITEMS_ALIKE = 0.97


def doubled(text: str) -> list[str]:
    """Return the lines that stand again, nearly the same, within the next few; rows of tables are meant to be alike."""
    lines = [line.strip() for line in text.splitlines()]
    return [
        line
        for number, line in enumerate(lines)
        for other in lines[number + 1 : number + 1 + BELOW]
        if min(len(line), len(other)) > LONG and line[0] not in "|<[" and _alike(line, other)
    ]


def _alike(line: str, other: str) -> bool:
    matcher, enough = SequenceMatcher(None, line, other), ITEMS_ALIKE if line[0] == "-" else ALIKE
    return matcher.quick_ratio() > enough and matcher.ratio() > enough


@each("page", [*PAGES, ROOT / "CHANGELOG.md", ROOT / "mappings" / "README.md"])
def test_no_line_is_repeated_within_a_docs_page(page: Path) -> None:
    assert doubled(prose(page)) == []


DECISIONS = sorted((ROOT / "docs" / "decisions").glob("*.md"))
STATUS = re.compile(r"\n\n\*(?:Accepted|Replaced by [\w./()\[\] -]+,) on 20\d\d-\d\d-\d\d\. What would change it: \S")


@each("page", DECISIONS)
def test_every_decision_has_a_status_a_date_and_what_would_change_it(page: Path) -> None:
    assert STATUS.search(page.read_text("utf-8").split("## ")[0]), page.name
