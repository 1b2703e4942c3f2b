"""The outcome of a command that a play shows.

What was sent, asked and kept decides, and the reply if nothing was. Where the mount is read, or has been told nothing
because it does so already, the play leaves it open: then the row of ``driver.toml`` that was taken says it.
"""

from __future__ import annotations

from gateway.core.errors import Unsupported
from gateway.core.operations import Read, named
from gateway.diagnostics.rehearsal.play import Play
from gateway.protocols.base.surface import ACKNOWLEDGED, Surface
from gateway.protocols.registry import mounts
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet, load
from gateway.protocols.wireformat.rows import SurfaceRow


def shown(play: Play, command: Command, row: SurfaceRow, surface: Surface, mount: CommandSet) -> str | None:
    """Return the outcome that a play on such a mount shows; None if it shows none."""
    asked = [*([row.ask] if row.ask else []), *play.asked]
    if is_no(command, play.reply, surface, play.frame):
        return "refused"
    if play.refused and play.reply in (b"", ACKNOWLEDGED):
        return "refused"  # perhaps by the mount, after it was sent something
    if command.question and asked and not play.reply:
        return "refused"  # what was asked for cannot be told
    if play.wire:
        return "translated"
    if play.of("baud") or (play.kept and not command.question):
        return "kept"
    if any(map(changes, asked)):
        return None
    if reads := [name for name in asked if any(name in load(other).driver for other in mounts())]:
        if reads[-1] in mount.driver:
            return None if command.question else "derived"
        return "kept" if play.tells else "derived"
    if asked:
        return "derived"
    if not play.reply:
        return "silent"
    return "kept" if play.tells else "synthesised"


def changes(name: str) -> bool:
    """Whether an operation of this name may change the mount."""
    kind = named(name)
    return kind is not None and not issubclass(kind, Read)


def is_no(command: Command, reply: bytes, surface: Surface, frame: bytes) -> bool:
    """Whether a reply is a refusal."""
    forms = [form for answer, form in command.replies if answer.fault]
    if not reply:
        return False
    told = any(form.matcher.fullmatch(reply) for form in forms) or surface.is_refusal(reply)
    return told or reply == no_form(surface, frame)


def no_form(surface: Surface, frame: bytes) -> bytes:
    """Return the surface's refusal of a command that no mount can do; empty if the protocol has none."""
    form = surface.unanswered(frame, Unsupported())
    return b"" if form == ACKNOWLEDGED else form
