"""What the reconciler needs of the rest of the gateway: the line, the limits, and whom to tell what happened."""

from __future__ import annotations

from typing import Any, Protocol

from gateway.core.operations import Operation
from gateway.mount.motion.wanted import Wanted
from gateway.protocols.base.driver import Steps


class Executor(Protocol):
    """``drive`` carries out a driver's generator at a rank of the line; ``admit`` is asked before every order."""

    @property
    def moving(self) -> bool:
        """Whether anything moves that a stop should end."""

    @property
    def slewing(self) -> bool:
        """Whether the mount is seen to carry out a goto."""

    @property
    def down(self) -> bool:
        """Whether the line is lost."""

    @property
    def deaf(self) -> bool:
        """Whether the mount is at a long piece of work, and hears nothing but a stop."""

    def was_deaf(self, since: float) -> bool:
        """Whether it has been at one since this loop time."""

    @property
    def served(self) -> bool:
        """Whether the line is up, and somebody works on it."""

    async def drive(self, steps: Steps, rank: int, since: float | None = None) -> Any:
        """Exchanges and pauses -> the generator's value. ``since``: when it was asked for. Raises Fault."""

    async def admit(self, operation: Operation) -> Operation:
        """An operation that is allowed, in the form that this mount can carry out. Raises Fault."""

    async def still_allowed(self) -> None:
        """Whether what moves by hand may go on. Raises Fault."""

    async def before_motion(self) -> None:
        """Something is about to move: it must be known before, should this process be killed."""

    def wanted_changed(self) -> None:
        """What is wanted is another value."""

    def begins(self, operation: Operation) -> None:
        """The mount has acknowledged an operation, and what is wanted is about to say so."""

    def taken(self, operation: Operation, before: Wanted) -> None:
        """The mount has acknowledged an operation; ``before`` is what was wanted until then."""

    def followed_up(self) -> None:
        """The mount has acknowledged a follow-up of the driver's own."""

    def expect_end(self, when: float) -> None:
        """The end of a motion is due at this loop time."""

    def stop_sent(self) -> None:
        """The commands of a stop went out, whether it was acknowledged or not."""

    def at_rest(self) -> None:
        """A stop was acknowledged."""

    def note(self, text: str) -> None:
        """Leave a note for the log."""
