"""Check that what was observed of a command is what the tables say.

The tables are taken literally: a *translated* command is seen on the wire, a *kept* one changes what is kept and sends
nothing, a *refused* one is answered with its refusal, or logged if it has none. Everything that a command sends must be
listed in its row, and everything logged about it must be in its remark. What it asks the mount for must be in the
``asks`` of its row. A difference is one line of text.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, get_args

from gateway.app.bindings import framer_and_parser
from gateway.core.errors import NoDevice
from gateway.core.wire_log import printable
from gateway.diagnostics.command_outcomes import MountKind, choose_ways, outcome, remarks
from gateway.diagnostics.rehearsal.play import Trace, general_refusal, is_refusal, is_refused, may_change_mount
from gateway.protocols.base.driver import Send
from gateway.protocols.base.surface import ACKNOWLEDGED, Surface
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.protocols.wireformat.rows import Outcome, SurfaceRow
from tests.conformance.wire.watcher import Seen
from tests.support.scripts import script

sent = script("docs/tools/tables.py").sent
PRECISIONS = ("high", "low")
#: The beginnings of notes that are about the mount or the site, not about a command.
_ASIDE = (
    "WARNING",
    "the mount does not report the time",
    "astronomy ",
    "not aligned: positions",
    "the hand control does not report its tracking mode",
)


class Case(NamedTuple):
    """The row that was played, with the presented model, the mount and its state."""

    command: Command
    row: SurfaceRow | None
    #: The presented model's traits.
    face: frozenset[str]
    driven: CommandSet
    mount: MountKind
    #: Whether the presented model does not have the command and ignores it.
    lacking: bool

    @property
    def said(self) -> str:
        """The outcome according to the tables."""
        return outcome(self.row, self.driven, self.mount, self.face)


def writes(row: SurfaceRow | None) -> bool:
    """Whether a row has operations that may change the mount."""
    return row is not None and any(map(may_change_mount, row.operations))


def differences(case: Case, seen: Seen, surface: Surface, asked: frozenset[str]) -> list[str]:
    """Return all differences of a play from the tables; ``asked`` are the commands that were sent to the mount."""
    found = [*_by_bytes(case, seen, surface, asked), *_unlisted(case, seen)]
    if not found and not case.lacking and case.said not in (shown := permitted(case, seen, surface)):
        found.append(f"the row says {case.said}, the test sees {' or '.join(sorted(shown))}")
    return found


def _unlisted(case: Case, seen: Seen) -> Iterator[str]:
    listed = case.row.operations if case.row is not None else []
    decides = may_change_mount if writes(case.row) else bool  # a row names the reads of a function that changes nothing
    if unlisted := [name for name in seen.deciding if decides(name) and name not in listed]:
        yield f"asks for {', '.join(unlisted)}, and asks does not list it"


def permitted(case: Case, seen: Seen, surface: Surface) -> set[str]:
    """Return the outcomes that agree with what was seen. Where the mount is read, or an order changes nothing because
    it is so already, the row of the driver that was taken says more than a play shows.
    """
    command, row, play = case.command, case.row, seen.play
    asked = [*([row.ask] if row is not None and row.ask else []), *seen.asked]
    if is_refused(play, command, surface) or (command.is_query and asked and not play.reply):
        by_mount = bool(play.changing_commands) and not case.mount.aligned  # as a mount that has just been switched on
        return {"refused", "translated"} if by_mount else {"refused"}
    if play.changing_commands:
        return {"translated"}
    if not command.is_query and any(map(may_change_mount, asked)):
        return set(get_args(Outcome)) - {"refused"} if not seen.kept or not case.mount.aligned else {"kept"}
    if play.steps_of_kind("baud") or (seen.kept and not command.is_query):
        return {"kept"}
    if not case.mount.aligned and not command.is_query and asked:
        return {"translated", "derived", "kept"}
    if reads := [name for name in seen.deciding or asked if name in case.driven.driver_rows]:
        return set(get_args(Outcome)) - {"refused", "silent"} if command.is_query and reads else {"derived", "kept"}
    if asked:
        return {"derived", "kept"} if seen.tells or not command.is_query else {"derived"}
    if not play.reply:
        return {"silent"}
    return {"kept"} if seen.tells else {"synthesised"}


def _by_bytes(case: Case, seen: Seen, surface: Surface, asked: frozenset[str]) -> Iterator[str]:
    """Yield what the bytes, the reply and the log show otherwise than the tables."""
    play = seen.play
    if b"".join(event.data for event in play.steps_of_kind("act")) != b"".join(play.changing_commands):
        yield "explain shows other bytes than the mount has heard"
    if case.lacking:
        if play.changing_commands or play.reply not in (b"", general_refusal(surface, play.frame)):
            yield "the presented model does not know it, and something is done or answered"
        return
    said = case.said
    listed = sent(case.row, case.driven, case.mount)
    changing = [found[0].name if (found := case.driven.find(data)) else repr(data) for data in play.changing_commands]
    unlisted = sorted({name for name in changing if name not in listed})
    if said != "translated" and changing:
        yield f"{said}, and yet {', '.join(sorted(set(changing)))} goes to the mount"
    elif unlisted:
        yield f"{', '.join(unlisted)} goes to the mount, and is not listed"
    if said == "translated":
        if writes(case.row) and not changing and not _idle(case):
            yield "translated, and nothing that changes the mount is sent"
        if not writes(case.row) and not asked.intersection(listed) and not _idle(case):
            yield "translated, and the mount has never been asked"
    yield from _answered(case, seen, surface, said)
    answers = _answers(play)
    denied = bool(answers) and all(_mount_says_no(case, *pair) for pair in answers)
    if denied and not is_refusal(case.command, play.reply, surface, play.frame) and not _notes(play):
        yield "the mount says no, and nobody is told"


def _idle(case: Case) -> bool:
    """Whether an order may change nothing: on a mount that is not aligned it may be so already, as its tracking off."""
    return not case.mount.aligned and all(way.aligned is None for way in choose_ways(case.row, case.driven, case.mount))


def _answers(play: Trace) -> list[tuple[bytes, bytes]]:
    """Return the commands that change the mount, each with the mount's reply if there is one."""
    waiting: bytes | None = None
    found = []
    for event in play.events:
        if event.kind in ("act", "look"):
            waiting = event.data if event.kind == "act" else None
        elif event.kind == "answer" and waiting is not None:
            found.append((waiting, event.data))
            waiting = None
    return found


def _mount_says_no(case: Case, request: bytes, answer: bytes) -> bool:
    """Whether the mount has refused a request, by a refusal or by the reply for a device that does not respond."""
    found = case.driven.find(request)
    if found is None:
        return False
    command, picture = found
    if any(reply.fault and form.matcher.fullmatch(answer) for reply, form in command.replies):
        return True
    taken = framer_and_parser(case.driven.name, case.mount.model)[1].parse_reply(
        Send(command.name, picture.decode(request)), answer
    )
    return taken is not None and isinstance(taken[0], NoDevice)


def _notes(play: Trace) -> list[str]:
    """Return the notes of the log that are about the command."""
    return [event.text for event in play.steps_of_kind("note") if not event.text.startswith(_ASIDE)]


def _answered(case: Case, seen: Seen, surface: Surface, said: str) -> Iterator[str]:
    """Compare the reply and the log with the outcome."""
    command, row, play = case.command, case.row, seen.play
    notes = _notes(play)
    no = is_refusal(command, play.reply, surface, play.frame)
    if said == "missing":
        yield "missing"
    elif said == "refused":
        if any(reply.fault for reply, _ in command.replies) or general_refusal(surface, play.frame):
            acknowledged = play.reply == ACKNOWLEDGED and notes and row is not None and "#" in row.why
            if not no and not acknowledged:  # where only the log tells it, the remark says so
                yield f"refused, and the reply '{printable(play.reply)}' is no no"
        elif not notes:
            yield "refused, and neither the reply nor the log says so"
    elif said == "silent":
        if play.reply:
            yield f"silent, and yet '{printable(play.reply)}' is said"
    elif no and not (play.changing_commands and not case.mount.aligned):
        yield f"{said}, and yet the reply is no: '{printable(play.reply)}'"
    elif not play.reply and any(
        form.fault is None and form.when in (None, *case.face, *PRECISIONS) for form, _ in command.replies
    ):
        yield f"{said}, and yet there is no reply"
    elif said == "kept" and not command.replies and not (seen.kept or (seen.learnt and writes(row))):
        yield "kept, and nothing is kept"
    ways = choose_ways(row, case.driven, case.mount)
    if (notes or said == "refused") and not remarks(row, ways):
        yield f"no remark on it, and the log says: {'; '.join(notes) or 'nothing'}"
