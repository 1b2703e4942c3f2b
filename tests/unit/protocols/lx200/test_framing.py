"""What one LX200 client can have the framer hold on to."""

from __future__ import annotations

from gateway.protocols.base.frames import Unterminated
from gateway.protocols.lx200.framing import LONGEST, Lx200Framer
from tests.support.each import each


@each("endless", [b":", b"::x", b":1", b"x"])
def test_a_command_without_end_is_dropped(endless: bytes) -> None:
    """A colon may be an argument's separator, so many of them are an argument; that ends, too."""
    framer = Lx200Framer()
    assert framer.feed(b":S" + endless * 1000, 0.0) == []
    assert len(framer._frame) <= LONGEST
    *rest, last = framer.feed(b"#:GR#", 0.0)
    assert last == b":GR#" and all(len(frame) <= LONGEST + 1 for frame in rest)


@each("more", range(6))
def test_the_longest_command_is_as_long_with_colons_as_without(more: int) -> None:
    for filling in (b"x", b":"):
        frames = Lx200Framer().feed(b":S" + filling * (LONGEST - 5 + more) + b"1#", 0.0)
        if LONGEST - 2 + more <= LONGEST:
            assert [len(frame) for frame in frames] == [LONGEST - 1 + more]
        else:
            (refused,) = frames
            assert isinstance(refused, Unterminated) and len(refused) == LONGEST + 1
