"""A capture of either protocol as a conversation: every command named, every reply taken apart, in order of time.

Commands are cut out of the bytes as a surface does it, replies as a driver does it: by the commands they answer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import groupby

from gateway.app.recording.format import BOOKKEEPING
from gateway.core.errors import UserError
from gateway.diagnostics.captures import Chunk
from gateway.diagnostics.log.conversation import Side
from gateway.diagnostics.log.layout import Row, plain
from gateway.diagnostics.log.printing import happened

#: So many commands that no protocol has are shown of one side.
NOISE = 1000
#: Bytes by which it is told whether a capture is a conversation.
ENOUGH = 4096


class NoConversation(UserError):
    """What was to be decoded is nothing that a client says to a mount."""


def decode(found: Iterable[Chunk], of: Callable[[str], Side], began: float | None) -> Iterator[str]:
    """Lines of text. ``of`` makes what understands a side, by its name; ``began`` is Unix seconds.

    Of what is no command only so much is shown. Raises NoConversation where that is most of a capture without times.
    """
    talks: dict[str, Side] = {}
    for chunk in found:
        if chunk.arrow == "r" or chunk.arrow in BOOKKEEPING:
            continue
        if chunk.side not in talks or chunk.arrow in "+~":
            talks[chunk.side] = of(chunk.side)
        side = talks[chunk.side]
        if chunk.arrow not in "<>":
            if chunk.arrow == "-":
                yield from _left_out(talks.pop(chunk.side), chunk, began)
            text = chunk.data.decode("latin-1")
            yield _line(chunk, began, b"", happened(chunk.arrow, text))
            continue
        pieces = side.commands(chunk.data, chunk.at) if chunk.arrow == ">" else side.replies(chunk.data)
        lines = [
            _line(chunk, began, heard.data, heard.words)
            for heard in pieces
            if heard.command or chunk.arrow == "<" or side.unknown <= NOISE
        ]
        if chunk.at is None and side.heard >= ENOUGH and side.understood < side.heard / 2:
            raise NoConversation(
                f"this is no conversation in the {side.protocol} protocol: of its first {side.heard} "
                f"bytes only {side.understood} are commands; --protocol names the other protocol, if "
                "it is one in that"
            )
        yield from lines
    for name, left in talks.items():
        yield from _left_out(left, Chunk(None, name, "!", b""), began)


def _left_out(side: Side, chunk: Chunk, began: float | None) -> Iterator[str]:
    """How much of what was no command has not been shown."""
    if side.unknown > NOISE:
        yield _line(
            chunk._replace(arrow="!"),
            began,
            b"",
            f"{side.unknown - NOISE} more that are no commands of the {side.protocol} protocol are not shown",
        )


def folded(lines: Iterable[str]) -> Iterator[str]:
    """The same, with lines that are repeated told once and counted: of a capture without times they say no more."""
    for line, same in groupby(lines):
        yield line
        times = sum(1 for _ in same) - 1
        if times:
            yield line if times == 1 else f"    the same {times} times more"


def _line(chunk: Chunk, began: float | None, data: bytes, words: str) -> str:
    row = Row((chunk.at or 0.0) + (began or 0.0), chunk.side, chunk.arrow, data, words)
    return plain(row, timed=chunk.at is not None)
