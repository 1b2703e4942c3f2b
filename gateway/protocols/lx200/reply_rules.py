"""The forms of requests to a Meade and of its replies.

A reply has one of five forms: none, one character, text up to ``#``, one character and text, two texts (``:SC``). A raw
0x15 means busy (LX200GPS), also after a command that has no reply. After a command without a reply the gateway pauses,
because old telescopes need it. The parser accepts only the exact form, apart from line ends, blanks and zero bytes
around a reply. An unexpected digit before a text is a refusal with that text. If a surface presents the mount itself,
the gateway writes its replies in the ``Notation`` of the connected telescope.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

from gateway.core import errors
from gateway.core.errors import Busy, Fault, Garbled, Refused
from gateway.core.operations import Values
from gateway.protocols.base.driver import Driver, Send
from gateway.protocols.base.reply_rules import ExpectedReply, answer_kind
from gateway.protocols.wireformat.command_set import CommandSet, load

NAK = 0x15
TIMEOUT, PAUSE_AFTER_COMMAND = 3.0, 0.05  # seconds
#: The maximum length of a reply that ends with ``#``.
MAX_LENGTH = 200
#: Field formats as telescopes send them: all digits, and any single byte between degrees, minutes and seconds, or a
#: degree sign in UTF-8, of which only the second byte counts. A lost digit or sign would be another position.
_SEP, _UTF_8 = rb"(?:\xc2\xb0|[^0-9#])", re.compile(rb"\xc2(?=\xb0)")
_FIELD_PATTERNS = {
    "HH:MM:SS": rb"\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d(?:\.\d+)?",
    "hh:mm:ss": rb"\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d",
    "HH:MM:SS.SSSS": rb"\d\d:\d\d:\d\d\.\d+",
    "HH:MM.T": rb"\d\d" + _SEP + rb"\d\d\.\d",
    "sDD*MM:SS": rb"[+-]\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d(?:\.\d+)?",
    "sDD*MM:SS.SSS": rb"[+-]\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d\.\d+",
    "sDD*MM": rb"[+-]\d\d" + _SEP + rb"\d\d(?:" + _SEP + rb"\d\d)?",
    "DDD*MM:SS": rb"\d\d\d" + _SEP + rb"\d\d" + _SEP + rb"\d\d",
    "DDD*MM": rb"\d\d\d" + _SEP + rb"\d\d",
    "sDDD*MM": rb"[+-]?\d\d\d" + _SEP + rb"\d\d(?:" + _SEP + rb"\d\d)?",
    "MM/DD/YY": rb"\d\d/\d\d/\d\d",
    "sHH.H": rb"[+-]?\d\d?(?:[.:]\d\d?)?",
}
_FIELD = re.compile(r"\{\w+:([^}]*)\}")
#: Bytes that some mounts send before and after a reply; and such bytes before the ``#`` of a reply without text.
PADDING, _PADDED_HASH = b"\r\n\t \0", re.compile(rb"[\r\n\t \0]+#")
#: A digit and a text, as a mount refuses an order; and a text that can only be a refusal: words without a digit.
_DIGIT_AND_TEXT, _REFUSAL_TEXT = re.compile(rb"(\d)\s*([A-Za-z][^#]*)#"), re.compile(rb"[^\d]* [^\d]*")


@cache
def _reply_pattern(source: str) -> re.Pattern[bytes]:
    """Return the exact pattern of a reply form as telescopes send it."""
    pattern, at = b"", 0
    for field in _FIELD.finditer(source):
        pattern += _literal_pattern(source[at : field.start()])
        form, at = field[1], field.end()
        lengths = [len(word) for word in form.split("|")]
        free = rb"[^#]*" if len(lengths) == 1 else rb"[^#]{%d,%d}" % (min(lengths), max(lengths))
        pattern += _FIELD_PATTERNS.get(form, free)
    end = re.escape(source[at:].encode("latin-1")) if source[:at].endswith(":text}") else _literal_pattern(source[at:])
    return re.compile(pattern + end, re.DOTALL)


def _literal_pattern(text: str) -> bytes:
    """Return the pattern of characters between fields; blanks or a line end may precede a ``#``."""
    return re.escape(text.encode("latin-1")).replace(rb"\#", rb"[\r\n\t \0]*\#")


@cache
def _comparable_forms(form_texts: tuple[str, ...]) -> frozenset[str]:
    """Return the forms of replies without the meaning of their fields: replies of equal form can be confused."""
    shapes = set()
    for source in form_texts:
        if ":text}" in source:
            shapes.add("text")
        elif "#" in source:
            shapes.add(_FIELD.sub(lambda field: field[1].upper(), source))
        else:
            shapes.add("bare")
    return frozenset(shapes)


#: The commands whose replies show a telescope's notation; those of them for the site; the example for other commands.
EXAMPLE_COMMANDS = frozenset({"GR", "GD", "GZ", "GA", "GT", "Gt", "Gg"})
SITE_COMMANDS = frozenset({"Gt", "Gg"})
EXAMPLE_BY_COMMAND = {"Gr": "GR", "Gd": "GD"}
#: A reply in degrees as the manual writes it, and its separators.
_ANGLE_REPLY = re.compile(rb"([+-]?)(\d{2,3})\*(\d\d)?(?::\d\d)?#")
_ANGLE_SEP = b"*:"
#: The position of the degree sign in a declination.
_DEGREE_SIGN_SLICE = slice(3, 4)
_ARCMINUTES_PER_TURN = 360 * 60


class Notation:
    """How a telescope writes its numbers: separators, the seconds of a site, the sign of a longitude or a rate.

    ``learn`` notes the notation of the telescope's replies, ``write`` converts a reply in the manual's form into it.
    """

    def __init__(self) -> None:
        self._examples: dict[str, bytes] = {}
        self._degree_sign = b"*"

    def learn(self, command: str, answer: bytes) -> None:
        if command in EXAMPLE_COMMANDS:
            self._examples[command] = answer
        if command == "GD":
            self._degree_sign = answer[_DEGREE_SIGN_SLICE]

    def write(self, command: str, reply: bytes) -> bytes:
        """Write a reply in this telescope's notation: like its last reply to the command, else with its degree sign."""
        example = self._examples.get(EXAMPLE_BY_COMMAND.get(command, command), b"")
        if command == "GT":
            return b"+" + reply if example.startswith(b"+") and reply[:1].isdigit() else reply
        match = _ANGLE_REPLY.fullmatch(reply)
        if match is None:
            return reply
        if command == "Gg" and example[:1].isdigit():  # west from 0 to 360, without a sign
            minutes = int(match[2]) * 60 + int(match[3] or b"0")
            reply = b"%03d*%02d#" % divmod((-minutes if match[1] == b"-" else minutes) % _ARCMINUTES_PER_TURN, 60)
        if command in SITE_COMMANDS and len(example) == len(reply) + 3:  # the telescope sends seconds
            reply = reply[:-1] + b":00#"
        if len(example) == len(reply):
            return bytes(mark if digit in _ANGLE_SEP else digit for mark, digit in zip(example, reply, strict=True))
        return reply.replace(b"*", self._degree_sign)


class Lx200ReplyRules:
    """The ``ReplyRules`` of a Meade, with the notation learnt from its replies.

    ``protocol`` is the command set of ``driver``. Without a driver it is that of ``model``; without both it is that of
    the product name in the mount's reply to :GVP.
    """

    half_command_end, ignored_bytes = b"#", PADDING

    def __init__(self, model: str | None = None, driver: Driver | None = None) -> None:
        self._notation, self._model_is_named, self._driver = Notation(), model is not None, driver
        self._protocol: CommandSet = load("lx200").in_dialect_of(model)

    @property
    def protocol(self) -> CommandSet:
        return self._protocol if self._driver is None else self._driver.protocol

    def expected_reply(self, request: Send) -> ExpectedReply:
        """Return the expected reply. An unanswered ACK needs a # after it, as some devices wait for a terminator."""
        return _expected_reply(self.protocol, request.command, request.once, request.include_raw)

    def in_mount_notation(self, command: str, reply: bytes) -> bytes:
        return self._notation.write(command, reply)

    def ambiguous_with(self, sent: Send, other: Send) -> bool:
        """Whether the forms of the two replies are so similar that they could be confused."""
        first, second = (_comparable_forms(_form_texts(self.protocol, ask.command)) for ask in (sent, other))
        either = first | second
        return bool(first & second) or ("text" in either and bool(first - {"bare"}) and bool(second - {"bare"}))

    def encode(self, request: Send) -> bytes:
        """Return the request, in its low-precision form if ``low`` is true. Raises Refused for a value out of range."""
        requests = self.protocol.commands[request.command].requests
        try:
            return requests[1 if request.values.get("low") and len(requests) > 1 else 0].encode(request.values)
        except ValueError as error:
            raise Refused(str(error)) from None

    def parse_reply(self, request: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """Return the reply at the start of the buffer and how many bytes it takes there; None while it is incomplete.

        The reply's own ``length`` in the values shows the precision. Raises ValueError for a value out of range.
        """
        replies = self.protocol.commands[request.command].replies
        if buffer[:1] == bytes((NAK,)):
            return Busy(), 1
        if not replies:
            return {}, 0
        before = len(buffer) - len(buffer.lstrip(PADDING))
        if (taken := self._match_reply(request, buffer[before:])) is None:
            return None
        outcome, length = taken[0], before + taken[1]
        return outcome, length if buffer[length:].strip(PADDING) else len(buffer)

    def _match_reply(self, request: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        if not buffer:
            return None
        replies = self.protocol.commands[request.command].replies
        for reply, template in replies:
            match = _reply_pattern(str(template.source)).match(buffer)
            if match is None:
                continue
            length = match.end()
            rest = buffer[length:].strip(PADDING)
            if rest and _begins_longer_form(self.protocol, request.command, str(template.source)):
                continue
            if "#" not in str(template.source) and rest == b"#":
                length = len(buffer)  # some telescopes append this to every reply
            elif rest and reply.fault is not None and (refusal := _as_refusal(self.protocol, request.command, buffer)):
                return refusal
            text = match[0] if ":text}" in str(template.source) else _UTF_8.sub(b"", _PADDED_HASH.sub(b"#", match[0]))
            values = template.decode(text)
            if reply.fault is not None:
                return _fault_of(reply.fault, values, reply.says), length
            self._notation.learn(request.command, text)
            if request.command == "GVP" and not self._model_is_named:
                self._protocol = load("lx200").in_dialect_of(load("lx200").model_of_product(values["product"]))
            return {**values, "length": len(text)}, length
        if (refusal := _as_refusal(self.protocol, request.command, buffer)) is not None:
            return refusal
        hashes = max(source.count("#") for source in _form_texts(self.protocol, request.command))
        if buffer.count(b"#") >= max(1, hashes) or len(buffer) > MAX_LENGTH or not hashes:
            whole = hashes or len(buffer) >= max(template.length or 1 for _, template in replies)
            return (Garbled(), len(buffer)) if whole else None
        return None

    def resync_commands(self, check_number: int) -> Iterator[Send]:
        """Yield the commands that show whether replies are in step: :GR and :GD, whose replies differ in form."""
        yield Send("GR")
        yield Send("GD")

    def is_resync_reply(self, request: Send, values: Values) -> bool:
        return "ra" in values or "dec" in values


@cache
def _form_texts(protocol: CommandSet, command: str) -> tuple[str, ...]:
    """Return the reply forms of a command, as the tables write them."""
    return tuple([str(template.source) for _, template in protocol.commands[command].replies])


@cache
def _refusal_digits(protocol: CommandSet, command: str) -> frozenset[bytes]:
    """Return the digits with which no success reply begins; none for a query or a command that never replies a text."""
    replies = [(reply.fault, str(template.source)) for reply, template in protocol.commands[command].replies]
    if protocol.commands[command].is_query or not any("{text" in source for _, source in replies):
        return frozenset()
    taken = {source[:1] for fault, source in replies if fault is None}
    return frozenset(digit.encode() for digit in "0123456789" if digit not in taken)


def _as_refusal(protocol: CommandSet, command: str, buffer: bytes) -> tuple[Values | Fault, int] | None:
    """Return the refusal in a reply that has none of the command's forms, and its length; None if there is none.

    A refusal is a digit with a text, or a digit alone. If the command's replies are texts, a digit is returned as text.
    """
    replies = [(reply, str(template.source)) for reply, template in protocol.commands[command].replies]
    lone, text = buffer.strip(PADDING + b"#"), not replies[0][1][:1].isdigit()
    if lone in _refusal_digits(protocol, command):
        if text:
            return {"text": lone.decode()}, len(buffer)
        named = (reply.fault for reply, source in replies if source.encode("latin-1").startswith(lone))
        return _fault_of(next(named, None) or "Refused", {}, None), len(buffer)
    if text or (said := _DIGIT_AND_TEXT.match(buffer)) is None:
        return None
    forms = [reply for reply, source in replies if source.encode("latin-1").startswith(said[1])]
    if any(reply.fault is None for reply in forms) or (forms and _REFUSAL_TEXT.fullmatch(said[2]) is None):
        return None
    return _fault_of("Refused", {"text": said[2].decode("latin-1")}, None), said.end()


@cache
def _begins_longer_form(protocol: CommandSet, command: str, form_text: str) -> bool:
    """Whether another reply form of the command begins with this one."""
    return any(other.startswith(form_text) and other != form_text for other in _form_texts(protocol, command))


@cache
def _expected_reply(protocol: CommandSet, command: str, once: bool, raw: bool) -> ExpectedReply:
    sources = _form_texts(protocol, command)
    return ExpectedReply(
        answer_kind(protocol, command, once, raw),
        TIMEOUT,
        unterminated=any("#" not in source for source in sources) or bool(_refusal_digits(protocol, command)),
        delay_after=0.0 if sources else PAUSE_AFTER_COMMAND,
        silent=not sources,
        needs_command_end=command == "ACK",
        ambiguous_replies=frozenset(
            {source.encode("latin-1") for source in sources if _begins_longer_form(protocol, command, source)}
            | _refusal_digits(protocol, command)
        ),
    )


def _fault_of(fault_name: str, values: Values, default_text: str | None) -> Fault:
    """Return the fault of a reply form, with the mount's own text if it sent any, else ``default_text``."""
    fault: type[Fault] = getattr(errors, fault_name)
    text = str(values.get("text", "")).strip()
    return fault(" ".join(text.split()) or default_text)
