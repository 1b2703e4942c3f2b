"""Readers for the hand-typed tables in ``tests/conformance/manual``; they import nothing from the product."""

from __future__ import annotations

import re
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "conformance" / "manual"


def rows(name: str) -> list[list[str]]:
    """Return the entries of one file, without comments and empty lines."""
    lines = (FOLDER / name).read_text("utf-8").splitlines()
    return [line.split(" | ") for line in lines if line and not line.startswith(";;")]


def raw(text: str) -> bytes:
    """Return the bytes of a text in which ``\\xHH`` is one byte and every other character stands for itself."""
    return re.sub(rb"\\x([0-9a-fA-F]{2})", lambda hit: bytes((int(hit.group(1), 16),)), text.encode("latin-1"))


def fits(reply: bytes, shapes: str) -> bool:
    """Whether a reply has one of the shapes: regular expressions separated by `` ~ ``; ``-`` means no reply."""
    text = reply.decode("latin-1")
    return any(text == "" if shape == "-" else re.fullmatch(shape, text, re.DOTALL) for shape in shapes.split(" ~ "))
