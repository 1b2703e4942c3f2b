"""Ends of motions on a Meade, which acknowledges none of them: each is sent twice, in case the first was lost.

The second one follows when the line is free for it, and not at all when something newer was begun meanwhile on what it
ends, or when nothing was known to move. So it costs the first one no time, no goto is cut off by it, and a program that
hammers stops at a mount at rest does not load the line twice. A telescope that calculates hears :Q# alone: the second
one of any other end waits until it hears again.
"""

from __future__ import annotations

import contextlib

from gateway.core.errors import Busy
from gateway.core.operations import Operation
from gateway.protocols.base.driver import Schedule, Steps
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

#: Seconds from the first to the second.
AGAIN = 0.3
#: Both axes of the mount; the focuser has a number of its own.
MOUNT, FOCUSER = (1, 2), 3


class EndAgain(Operation, frozen=True):
    """Internal: this command once more, unless something newer was begun. Ranks as a stop; no stop takes it back."""

    survives_abort = True

    command: str


def begins(mount: Lx200Driver, *axes: int) -> None:
    """Something is about to be set moving on these axes."""
    for axis in axes:
        mount.begun[axis] = mount.begun.get(axis, 0) + 1


def end(mount: Lx200Driver, command: str, axes: tuple[int, ...], moved: bool) -> Steps:
    """Send what ends the motion of these axes; ``moved`` tells whether there was any that is known of."""
    if moved:
        mount.ended[command] = {axis: mount.begun.get(axis, 0) for axis in axes}
    yield from ask(mount, command)
    if moved:
        yield Schedule(AGAIN, EndAgain(command), urgent=True, heard=command != "Q")


def end_again(mount: Lx200Driver, operation: EndAgain) -> Steps:
    """The second one. A telescope that is busy with itself has been given something newer to do."""
    begun = mount.ended.pop(operation.command, None)
    if begun is not None and all(mount.begun.get(axis, 0) == number for axis, number in begun.items()):
        with contextlib.suppress(Busy):
            yield from ask(mount, operation.command)
