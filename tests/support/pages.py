"""The README and docs/ as code blocks: what a reader would type, and why some of it is not run.

A fenced block says its language. A block of commands that no test runs stands under ``<!-- not run: REASON -->``; one
without a language is a picture, a file or what a program prints. The two commands of the README that are indented are
read by other programs, too (``.ci/run``).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
_FENCED = re.compile(r"(?ms)(?:<!-- not run: ([^>]*) -->\n)?^( *)```(\w*)\n(.*?)^ *```$")
_INDENTED = re.compile(r"(?m)^Run the (\w+):\n\n    (.+)$")
_SPAN = re.compile(r"`(mount-gateway [^`]+)`")


class Block(NamedTuple):
    """One block of a page. ``reason`` is why it is not run, empty where it is."""

    page: Path
    language: str
    text: str
    reason: str

    @property
    def lines(self) -> list[str]:
        return [line.strip() for line in self.text.splitlines() if line.strip()]


def blocks() -> list[Block]:
    """All fenced ones."""
    return [
        Block(page, language, text, reason.strip())
        for page in PAGES
        for reason, _, language, text in _FENCED.findall(page.read_text("utf-8"))
    ]


def commands() -> list[str]:
    """Every line of a block that is to be run, once, in the order of the pages; the README's demo among them."""
    found = [line for block in blocks() if block.language == "sh" and not block.reason for line in block.lines]
    return list(dict.fromkeys([*found, installed()["demo"].rpartition("&& .venv/bin/")[2]]))


def installed() -> dict[str, str]:
    """The README's commands that install first: ``demo`` and ``tests``."""
    return dict(_INDENTED.findall((ROOT / "README.md").read_text("utf-8")))


def spans() -> list[tuple[str, str]]:
    """(page, command) of what stands in the text as ``mount-gateway …``."""
    return [(page.name, span) for page in PAGES for span in _SPAN.findall(page.read_text("utf-8"))]
