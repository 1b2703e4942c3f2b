"""A program that speaks Alpaca: what belongs to it, what its requests must be, and what must be so for them.

A program has to be connected, the mount must not be parked for some of what is asked, and every parameter has its
range. Every request is answered, also one that is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gateway.core.errors import Invalid, Refused
from gateway.core.operations import GetActivity, GetStatus, Tracking, Values
from gateway.protocols.alpaca.tables import NotConnected, Parked, is_refusal, member, refusal
from gateway.protocols.base.session import Kept, Session
from gateway.protocols.base.surface import Handler, Surface
from gateway.protocols.base.wants import Handling, given
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.protocols.wireformat.rows import SurfaceRow


class AlpacaKept(Kept):
    """``ra``, ``dec`` are the target, degrees; ``elevation`` is in metres. None: not set yet."""

    connected: bool = False
    ra: float | None = None
    dec: float | None = None
    elevation: float | None = None


class AlpacaSession(Session):
    """One client: a program on one computer that counts as one by its ClientID."""

    inherits = False  # another one of the same computer is another program
    state = AlpacaKept
    kept: AlpacaKept


class AlpacaSurface(Surface):
    """Every request is answered: with the value, with nothing, or with the number and the words of a refusal."""

    def __init__(self, protocol: CommandSet, handlers: Mapping[str, Handler]) -> None:
        super().__init__(protocol, handlers, refusal)
        self.session, self.denies = AlpacaSession, is_refusal

    def _act(self, session: Session, command: Command, row: SurfaceRow, values: Values) -> Handling:
        yield from _admitted(session, command.name)
        return (yield from super()._act(session, command, row, values))


def _admitted(session: Session, name: str) -> Handling:
    """Whether this program may ask for it, as the mount stands. Raises Fault where not."""
    assert isinstance(session, AlpacaSession)
    needs = member(name)
    if not (needs.always or session.kept.connected):
        raise NotConnected
    if needs.unparked and (yield GetActivity()).parked:
        raise Parked
    if needs.tracking is not None:
        tracks = (yield GetStatus()).tracking is not Tracking.OFF
        if tracks is not needs.tracking:
            raise Refused(
                "The mount tracks: set Tracking to false first." if tracks
                else "The mount does not track: set Tracking to true first."
            )  # fmt: skip


# --- parameters -----------------------------------------------------------------------------------------------------


def within(values: Values, field: str, name: str, low: float, high: float, per: float = 1.0) -> Any:
    """A parameter that is in its range, which is told in units of ``per``. Raises Invalid."""
    value = given(values)[field]
    if not low <= value <= high:
        raise Invalid(f"{name} is {value / per:.10g}; it must be from {low / per:.6g} to {high / per:.6g}.")
    return value


def place(values: Values) -> tuple[float, float]:
    """Right ascension and declination, degrees. Raises Invalid."""
    ra = within(values, "ra", "RightAscension", 0.0, 360.0, per=15.0)
    return ra % 360.0, within(values, "dec", "Declination", -90.0, 90.0)


def axis(values: Values) -> int:
    """0 for the first axis, 1 for the second, 2 for a third that no mount has. Raises Invalid."""
    found: int = within(values, "axis", "Axis", 0, 2)
    return found
