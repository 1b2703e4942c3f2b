"""The code blocks of the README and docs/: the commands a reader would type, and why some of them are not run.

A fenced block names its language. A block of commands that no test runs stands under ``<!-- not run: REASON -->``; one
without a language shows a diagram, a file or output. The two indented commands of the README are also read by other
programs (``.ci/run``).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
_FENCED = re.compile(r"(?ms)(?:<!-- not run: ([^>]*) -->\n)?^( *)```(\w*)\n(.*?)^ *```$")
_INDENTED = re.compile(r"(?m)^Run the (\w+):\n\n    (.+)$")
_FENCE = re.compile(r"(?ms)^ *```.*?^ *```$")
_CODE = re.compile(r"(?m)^    .*$|`[^`]*`")
_SPAN = re.compile(r"`(mount-gateway [^`]+)`")


class Block(NamedTuple):
    """One block of a page. ``reason`` says why it is not run; it is empty if it is run."""

    page: Path
    language: str
    text: str
    reason: str

    @property
    def lines(self) -> list[str]:
        return [line.strip() for line in self.text.splitlines() if line.strip()]


def prose(page: Path) -> str:
    """Return what a page says, without its fenced blocks."""
    return _FENCE.sub("", page.read_text("utf-8"))


def without_code(text: str) -> str:
    """Return what a text of a page says, without blocks, indented lines and words of code."""
    return _CODE.sub("", _FENCE.sub("", text))


def blocks() -> list[Block]:
    """Return all fenced blocks."""
    return [
        Block(page, language, text, reason.strip())
        for page in PAGES
        for reason, _, language, text in _FENCED.findall(page.read_text("utf-8"))
    ]


def commands() -> list[str]:
    """Return every line of the blocks to be run, without repetitions, in page order, and the README's demo."""
    found = [line for block in blocks() if block.language == "sh" and not block.reason for line in block.lines]
    return list(dict.fromkeys([*found, installed()["demo"].rpartition("&& .venv/bin/")[2]]))


def installed() -> dict[str, str]:
    """Return the README's commands that install first: ``demo`` and ``tests``."""
    return dict(_INDENTED.findall((ROOT / "README.md").read_text("utf-8")))


def spans() -> list[tuple[str, str]]:
    """Return (page, command) of every ``mount-gateway …`` within a sentence."""
    return [(page.name, span) for page in PAGES for span in _SPAN.findall(page.read_text("utf-8"))]
