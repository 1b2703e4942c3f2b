"""What the stages of the check have in common: their titles, and where they report to."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import NamedTuple, Protocol

from gateway.diagnostics.prove.findings import Finding
from gateway.diagnostics.prove.telescope import Telescope


class Report(Protocol):
    """Takes the findings of a stage, and how far it has come."""

    def found(self, finding: Finding) -> None: ...
    def progress(self, done: int, of: int, what: str) -> None: ...


class Stage(NamedTuple):
    """A part of the check. ``will`` says what comes, in one sentence; ``moves``: whether it moves the mount.

    ``run`` raises Ended. ``why`` says why it is needed; nothing if it is not.
    """

    name: str
    will: str
    moves: bool
    run: Callable[[Telescope, Report], Awaitable[None]]
    why: Callable[[Telescope], str] = lambda telescope: "it belongs to every check"
