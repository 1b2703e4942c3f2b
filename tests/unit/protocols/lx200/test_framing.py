"""What one LX200 client can have the framer hold on to."""

from __future__ import annotations

from gateway.protocols.base.frames import Unterminated
from gateway.protocols.lx200.framing import MAX_COMMAND_LENGTH, Lx200Framer
from tests.support.each import each


@each("more", range(6))
def test_longest_lx200_command_has_the_same_length_with_and_without_colons(more: int) -> None:
    for filling in (b"x", b":"):
        frames = Lx200Framer().feed(b":S" + filling * (MAX_COMMAND_LENGTH - 5 + more) + b"1#", 0.0)
        if MAX_COMMAND_LENGTH - 2 + more <= MAX_COMMAND_LENGTH:
            assert [len(frame) for frame in frames] == [MAX_COMMAND_LENGTH - 1 + more]
        else:
            (refused,) = frames
            assert isinstance(refused, Unterminated) and len(refused) == MAX_COMMAND_LENGTH + 1
