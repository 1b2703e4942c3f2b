"""The site of the documentation: every page is in it, all links hold, and a browser fetches nothing from elsewhere.

It is built as ``docs/tools/site.py`` builds it, strictly. Where zensical (the extra ``docs``) is missing, what it would
be given is looked at all the same.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from tests.support.doc_blocks import PAGES, ROOT
from tests.support.scripts import script

#: What a browser loads by itself.
LOADED = re.compile(r"<(?:script|link|img|iframe)\b[^>]*?\b(?:src|href)=\"?((?:https?:)?//[^\s\">]+)")


@pytest.fixture(scope="module")
def site() -> ModuleType:
    return script("docs/tools/site.py")


def listed(entries: list[dict[str, Any]]) -> list[str]:
    """The pages of the navigation."""
    found: list[str] = []
    for entry in entries:
        for value in entry.values():
            found += listed(value) if isinstance(value, list) else [value]
    return found


def test_every_page_is_in_the_docs_navigation_once() -> None:
    settings = tomllib.loads((ROOT / "docs" / "site" / "zensical.toml").read_text("utf-8"))
    nav = listed(settings["project"]["nav"])
    assert sorted(set(nav)) == sorted(nav)
    assert {ROOT / path for path in nav} >= set(PAGES)


def test_site_contains_linked_sources_and_drawings_as_pages(site: ModuleType, tmp_path: Path) -> None:
    site.lay_out(tmp_path)
    assert "](../examples/tiny_client.py.md)" in (tmp_path / "docs" / "python.md").read_text("utf-8")
    example = (ROOT / "examples" / "tiny_client.py").read_text("utf-8")
    assert example in (tmp_path / "examples" / "tiny_client.py.md").read_text("utf-8")
    layers = (tmp_path / "docs" / "architecture.md").read_text("utf-8")
    assert "mermaid" not in layers and layers.count("<rect") == len(re.findall(r"(?m)^\| `\w+/` \|", layers))


def test_docs_pages_fetch_nothing_from_other_hosts(site: ModuleType, tmp_path: Path) -> None:
    pytest.importorskip("zensical", reason="the extra docs is not installed")
    built = site.build(tmp_path)
    assert built is not None
    pages = list(built.rglob("*.html"))
    assert len(pages) > len(PAGES)
    assert {link for page in pages for link in LOADED.findall(page.read_text("utf-8"))} == set()
    missing = {
        (page.name, path)
        for page in pages
        if page.name != "404.html"  # which a server shows, from its root
        for path in re.findall(r'src="([^":]+)"', page.read_text("utf-8"))
        if not (page.parent / path).exists()
    }
    assert missing == set()


def test_docs_build_reports_a_dead_link(
    site: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    pytest.importorskip("zensical", reason="the extra docs is not installed")
    lay_out = site.lay_out

    def with_a_dead_link(pages: Path) -> None:
        lay_out(pages)
        with (pages / "README.md").open("a") as page:
            page.write("\n[nowhere](docs/nowhere.md)\n")

    monkeypatch.setattr(site, "lay_out", with_a_dead_link)
    assert site.build(tmp_path) is None
    assert "nowhere.md" in re.sub(r"\x1b\[[\d;]*m", "", capfd.readouterr().err)
