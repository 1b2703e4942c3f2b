"""Places on the Moon as targets: selenographic latitude north, longitude EAST positive (Mare Crisium is +59).

What is kept is the place on the Moon; where that is on the sky is worked out at every goto.
"""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core.errors import NoTarget
from gateway.core.operations import Equatorial, MoonPlace, Sync, Values
from gateway.protocols.base.wants import FireAndForget, Handling
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.lx200.surface import selected
from gateway.protocols.wireformat.command import Command


def set_moon_target(session: LxSession, command: Command, values: Values) -> Handling:
    """:SE the latitude, :Se the longitude; the half that was not set yet is 0."""
    if "fault" in values:
        selected.fail(session, "No object selected")
        raise values["fault"]
    place = session.kept.moon = replace(session.kept.moon, **values)
    yield from selected.follow(session, place, f"MOON LAT {place.latitude:+.1f} LONG {place.longitude:+.1f}")


def sync_on_moon(session: LxSession, command: Command, values: Values) -> Handling:
    """:CL - only to a place on the Moon; the command has no reply."""
    if not isinstance(session.kept.moving, MoonPlace):
        raise NoTarget
    place: Equatorial = yield from selected.target(session)
    yield FireAndForget(Sync(place.ra, place.dec))
