"""The telescope's own object library, for programs that speak its protocol.

The library knows one target, and so does the telescope: what this client has aimed at is put there first, so that a
number that is not found leaves it as it was, as on the telescope itself.
"""

from __future__ import annotations

from gateway.astro.spherical import wrap180
from gateway.core.errors import Silence
from gateway.core.operations import Choose, Chosen, Equatorial
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.lx200.driver.pointing import aim
from gateway.protocols.lx200.driver.state import OWN_PATIENCE, Lx200Driver, ask, ask_once

#: Degrees: so near to the target of before it is that one, for it is told in whole seconds.
SAME = 20.0 / 3600.0


def choose(mount: Lx200Driver, operation: Choose) -> Steps:
    """:Sr :Sd, the choice, :LI :Gr :Gd -> Chosen. Gotos and syncs set the same target: none comes in between."""
    yield from aim(mount, operation.ra, operation.dec)
    for name, fields in operation.first:
        yield from ask(mount, name, **dict(fields))
    reply = yield from _said(mount, operation.command, dict(operation.fields))
    text = yield from _said(mount, "LI", {})
    ra = (yield from ask_once(mount, "Gr"))["ra"]
    dec = (yield from ask_once(mount, "Gd"))["dec"]
    same = abs(wrap180(ra - operation.ra)) < SAME and abs(dec - operation.dec) < SAME
    return Chosen(None if same else Equatorial(ra, dec), text.decode("latin-1").rstrip("#"), reply)


def _said(mount: Lx200Driver, command: str, values: dict[str, object]) -> Steps:
    """The bytes of a reply; none where it has none, or the telescope does not know the command."""
    if not mount.protocol.commands[command].replies:
        yield from ask(mount, command, **values)
        return b""
    try:
        return (yield Send(command, {**values, "low": mount.low}, OWN_PATIENCE, raw=True))["raw"]
    except Silence:
        return b""
