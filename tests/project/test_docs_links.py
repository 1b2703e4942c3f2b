"""A link in the README or in docs/ into the project leads to a file that is there, and to a heading in it."""

from __future__ import annotations

import re
from pathlib import Path

from tests.support.doc_blocks import PAGES, ROOT, prose
from tests.support.each import each

_LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(page: Path) -> set[str]:
    """As GitHub makes them: lower case, without punctuation, hyphens for spaces."""
    headings = re.findall(r"(?m)^#+ (.+)$", prose(page))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@each("page", PAGES)
def test_links_of_the_docs_lead_to_existing_files_and_headings(page: Path) -> None:
    dead = []
    for link in _LINK.findall(prose(page)):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if "://" not in link and (not target.is_file() or (anchor and anchor not in anchors(target))):
            dead.append(link)
    assert not dead


def _linked(page: Path) -> set[Path]:
    """The pages that a page leads to."""
    links = _LINK.findall(prose(page))
    return {(page.parent / link.partition("#")[0]).resolve() for link in links if "://" not in link} & set(PAGES)


def test_every_page_is_at_most_two_links_from_the_readme() -> None:
    readme = ROOT / "README.md"
    first = _linked(readme)
    assert first.union(*map(_linked, first)) | {readme} >= set(PAGES)
