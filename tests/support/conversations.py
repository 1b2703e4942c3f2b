"""Replays the conversations of ``conformance/transcripts``: on a surface alone, and through the whole client code.

Each protocol's test supplies ``set_up``, which carries out the ``!`` lines.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

from tests.support.fake_gateway import FakeConnection, FakeGateway
from tests.support.fake_mount import Talk
from tests.support.transcript_files import Conversation, read


def degrees(text: str) -> float:
    """Convert ``-12:30:00`` to a number."""
    whole, minutes, seconds = (float(part) for part in text.lstrip("+-").split(":"))
    return (whole + minutes / 60 + seconds / 3600) * (-1 if text.startswith("-") else 1)


def play(
    conversation: Conversation, talk: Talk, cut: Callable[[bytes], list[bytes]], set_up: Callable[[str], None]
) -> None:
    """Replay a conversation on a surface; ``cut`` splits what is sent into the chunks that arrive."""
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
    gateway: FakeGateway,
    ask: Callable[[FakeConnection, bytes], Awaitable[bytes]],
    set_up: Callable[[str], None],
) -> None:
    """Replay a conversation through ClientConnections, reconnecting where the original program did."""
    connection, heard = gateway.connect(), b""
    for line in conversation.lines:
        if line.mark == ">":
            if "connections" in conversation.settings:
                connection.close()
                connection = gateway.connect()
            heard += await ask(connection, line.data)
        elif line.mark == "<":
            assert heard == line.data, line
            heard = b""
        elif line.mark == "@":
            await asyncio.sleep(float(line.text))
        else:
            set_up(line.text)
            gateway.controller.changed()
    assert heard == b""


def check_whole(path: Path) -> None:
    """Check that a conversation is more than a greeting, and that it ends with a reply."""
    marks = [line.mark for line in read(path).lines]
    assert marks.count("<") > 4
    assert marks[-1] == "<", f"{path.name} ends before its last reply"
