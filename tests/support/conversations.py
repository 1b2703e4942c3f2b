"""Plays the conversations of ``conformance/transcripts``: against a surface, and through the product's own clients.

How a ``!`` line sets the mount up is the business of each protocol's test.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

from tests.support.fake_mount import Talk
from tests.support.transcript_files import Conversation, read
from tests.support.visits import House, Visit


def degrees(text: str) -> float:
    """``-12:30:00`` as a number."""
    whole, minutes, seconds = (float(part) for part in text.lstrip("+-").split(":"))
    return (whole + minutes / 60 + seconds / 3600) * (-1 if text.startswith("-") else 1)


def play(
    conversation: Conversation, talk: Talk, cut: Callable[[bytes], list[bytes]], set_up: Callable[[str], None]
) -> None:
    """Against a surface; ``cut`` is how a wire delivers what is sent."""
    heard = b""
    for line in conversation.lines:
        if line.mark == ">":
            if "connections" in conversation.settings:
                talk.reconnect()
            heard += b"".join(talk.send(chunk) for chunk in cut(line.data))
        elif line.mark == "<":
            assert heard == line.data, line
            heard = b""
        elif line.mark == "@":
            talk.wait(float(line.text))
        else:
            set_up(line.text)
    assert heard == b""


async def receive(
    conversation: Conversation,
    house: House,
    ask: Callable[[Visit, bytes], Awaitable[bytes]],
    set_up: Callable[[str], None],
) -> None:
    """With the product's own clients, and connections that come and go where the program does that."""
    visit, heard = house.visit(), b""
    for line in conversation.lines:
        if line.mark == ">":
            if "connections" in conversation.settings:
                visit.close()
                visit = house.visit()
            heard += await ask(visit, line.data)
        elif line.mark == "<":
            assert heard == line.data, line
            heard = b""
        elif line.mark == "@":
            await asyncio.sleep(float(line.text))
        else:
            set_up(line.text)
            house.controller.changed()
    assert heard == b""


def check_whole(path: Path) -> None:
    """A conversation is more than a greeting, and ends with a reply."""
    marks = [line.mark for line in read(path).lines]
    assert marks.count("<") > 4
    assert marks[-1] == "<", f"{path.name} ends before its last reply"
