"""A command ready for use: its request forms, its reply forms, who has it, and the facts about it.

Whatever is wrong with its row raises MappingError with file, row and reason: a question of which nobody says how its
answers may change is one of those mistakes.
"""

from __future__ import annotations

from gateway.core.errors import MappingError
from gateway.protocols.wireformat.rows import ANSWERS, URGENT, CommandRow, Reply, Version, parse_version
from gateway.protocols.wireformat.template import FrameTemplate, Source


class Command:
    """A command ready for use: its request forms, its reply forms, and who has it."""

    __slots__ = (
        "acts",
        "answer",
        "beyond",
        "by_hand",
        "help",
        "long",
        "may_be_silent",
        "models",
        "name",
        "pushed",
        "replies",
        "request",
        "requests",
        "since",
        "takes_back",
        "urgent",
        "urgent_at",
        "while_asleep",
        "while_seeking",
    )

    def __init__(self, where: str, name: str, row: CommandRow) -> None:
        self.name, self.help, self.beyond, self.acts = name, row.help, row.beyond, row.acts
        self.models = frozenset(row.models) if row.models is not None else None
        self.answer, self.takes_back = row.answer, row.takes_back
        self.urgent, self.urgent_at = row.urgent, row.urgent_at
        self.long, self.by_hand, self.may_be_silent = row.long, row.by_hand, row.may_be_silent
        self.while_seeking, self.while_asleep = row.while_seeking, row.while_asleep
        self.pushed = row.pushed
        try:
            self.since = parse_version(row.since) if row.since else None
            self.requests = [FrameTemplate(source) for source in _requests(row.request)]
            self.replies = [(reply, FrameTemplate(reply.wire)) for reply in _replies(row.reply)]
        except ValueError as error:
            raise MappingError(where, name, str(error)) from None
        self.request = self.requests[0]
        if wrong := self._wrong():
            raise MappingError(where, name, wrong)

    def _wrong(self) -> str:
        """What is wrong with the facts about it; empty when nothing is."""
        if not self.asked and self.pushed is None:
            return "it needs a request, or pushed"
        if self.question and self.answer not in ANSWERS:
            words = ", ".join(f"{word} (it {does})" for word, does in ANSWERS.items())
            return f"it asks for a value, so it needs answer = one of {words}"
        if self.answer is not None and not self.question:
            return "answer is for a command that asks for a value and does nothing else"
        if self.urgent not in (None, *URGENT):
            return f"urgent = {self.urgent!r} is none of {', '.join(URGENT)}"
        if (self.urgent_at or self.takes_back) and self.urgent is None:
            return "urgent_at and takes_back are for a command that is urgent"
        if unknown := self.urgent_at.keys() - self.request.fields.keys():
            return f"urgent_at: it has no field {', '.join(sorted(unknown))}"
        return ""

    @property
    def question(self) -> bool:
        """Whether it asks for a value and does nothing else."""
        return not self.acts and any(reply.fault is None and picture.fields for reply, picture in self.replies)

    @property
    def asked(self) -> bool:
        """Whether there is a request for it; else it is told unasked alone."""
        return bool(self.request.parts)

    @property
    def mark(self) -> bytes:
        """The bytes by which an urgent command is seen in what has not been cut into commands yet."""
        if not self.urgent_at:
            return self.request.literal.removesuffix(b"#")
        end = self.request.parts[-1]
        return self.request.encode(self.urgent_at).removesuffix(end if isinstance(end, bytes) else b"")

    def known_to(self, model: str | None, version: Version | None) -> bool:
        """Whether this model and version have the command, by the manual."""
        if self.models is not None and model is not None and model not in self.models:
            return False
        return self.since is None or version is None or version >= self.since

    def __repr__(self) -> str:
        return f"Command({self.name})"


def _requests(request: str | list[str | int]) -> list[Source]:
    """A list of letters, numbers and fields is one binary frame; a list of longer strings is alternatives."""
    if isinstance(request, str):
        return [request]
    if all(isinstance(piece, int) or len(piece) == 1 or piece.startswith("{") for piece in request):
        return [request]
    return [str(piece) for piece in request]


def _replies(reply: str | list[str | int | Reply] | None) -> list[Reply]:
    if reply is None:
        return []
    variants = [item for item in reply if isinstance(item, Reply)]
    if isinstance(reply, str) or not variants:
        return [Reply(wire=reply)]  # type: ignore[arg-type]
    return variants
