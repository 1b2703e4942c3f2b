"""What the rows of ``mappings/alpaca/surface.toml`` call, and what must be so before it is called."""

from __future__ import annotations

from gateway.core.errors import Refused
from gateway.core.operations import GetActivity, GetStatus, Tracking, Values
from gateway.protocols.alpaca.faults import NotConnected, Parked, is_refusal, refusal
from gateway.protocols.alpaca.members import member
from gateway.protocols.alpaca.session import AlpacaSession
from gateway.protocols.alpaca.surface import abilities, device, motion, pointing, site, tracking
from gateway.protocols.base.session import Session
from gateway.protocols.base.surface import Surface, handlers_of
from gateway.protocols.base.wants import Handling
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.protocols.wireformat.rows import SurfaceRow

HANDLERS = handlers_of(abilities, device, motion, pointing, site, tracking)


class AlpacaSurface(Surface):
    """Every request is answered: with the value, with nothing, or with the number and the words of a refusal."""

    def __init__(self, protocol: CommandSet) -> None:
        super().__init__(protocol, HANDLERS, refusal)
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
