"""The server of a simulated Alpaca telescope: HTTP requests in, JSON out, as ASCOM defines them.

What is not understood is answered with status 400 and a text: an unknown address, a capital letter in it, a missing or
misspelt parameter, a number that is none. Everything else is answered with status 200, errors by their number. On a
line without HTTP, as in rehearsals, the driver's own conversion stands between its lines and this server.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from itertools import count
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

from gateway.protocols.alpaca.driver.telescope_http import TelescopeHttp
from gateway.protocols.alpaca.simulator.members import WRITES, read, readable
from gateway.protocols.alpaca.simulator.telescope import (
    NOT_CONNECTED,
    NOT_IMPLEMENTED,
    PARKED,
    AlpacaError,
    AlpacaTelescope,
    rows,
)
from gateway.protocols.mechanics.simulated import Later

#: The longest request, bytes.
LONGEST, LONGEST_NUMBER = 65536, 10
DEVICE = "/api/v1/telescope/0/"
#: The kinds of parameters.
KINDS: dict[str, Callable[[str], Any]] = {
    "text": str, "whole": int, "number": float, "truth": lambda text: {"true": True, "false": False}[text.lower()]
}  # fmt: skip
FORM = "application/x-www-form-urlencoded"


class NotUnderstood(Exception):
    """Status 400."""


class RequestFramer:
    """Cuts the bytes of a connection into HTTP requests, or into lines."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Return the whole requests, in order."""
        self._rest = (self._rest + data).lstrip(b"\r\n")  # a gateway that begins anew ends what may have been begun
        frames = []
        while end := self._end():
            frames.append(self._rest[:end])
            self._rest = self._rest[end:]
        self._rest = self._rest[-LONGEST:]
        return frames

    def _end(self) -> int:
        """Return how many bytes the first request has; 0 if it is not whole."""
        if self._rest.startswith((b"get ", b"put ")):
            return self._rest.find(b"\n") + 1
        head = self._rest.find(b"\r\n\r\n") + 4
        if head < 4:
            return 0
        length = _headers(self._rest[:head]).get("content-length", "0")
        whole = head + (int(length) if length.isdecimal() and len(length) < LONGEST_NUMBER else 0)
        return whole if whole <= len(self._rest) else 0


def _headers(head: bytes) -> dict[str, str]:
    rows = (row.partition(":") for row in head.decode("latin-1").split("\r\n")[1:])
    return {name.strip().lower(): value.strip() for name, _, value in rows}


class SimulatedAlpaca(AlpacaTelescope):
    """A simulated telescope with its server."""

    def framer(self) -> RequestFramer:
        return RequestFramer()

    def answer(self, frame: bytes, later: Later | None) -> bytes:
        if frame.startswith((b"get ", b"put ")):
            asked = self._lines.request(frame)
            words = urlencode(asked.fields)
            status, text = self.request(asked.method, f"{asked.path}?{words}", words.encode())
            reply = self._lines.reply(status, text.encode())
        else:
            head, _, body = frame.partition(b"\r\n\r\n")
            method, target, *_ = [*head.decode("latin-1").split("\r\n")[0].split(), "", ""]
            status, text = self.request(method, target, body, _headers(head).get("content-type", FORM))
            data, kind = text.encode(), "application/json" if status == 200 else "text/plain"
            rows_of_head = (
                f"HTTP/1.1 {status} {'OK' if status == 200 else 'Bad Request'}",
                f"Content-Type: {kind}; charset=utf-8", f"Content-Length: {len(data)}\r\n\r\n",
            )  # fmt: skip
            reply = "\r\n".join(rows_of_head).encode() + data
        seconds = self.mechanics.arrives(self.now) - self.now if self.waits and later is not None else 0.0
        if seconds > 0.0 and later is not None:
            later(seconds, reply)
            return b""
        return reply

    waits = False
    _lines = TelescopeHttp("")
    _numbers = count(1)

    def request(self, method: str, target: str, body: bytes = b"", kind: str = FORM) -> tuple[int, str]:
        """Carry out a request and return the status and the text of the response."""
        self.advance_to_now()
        self.waits = False
        url = urlsplit(target)
        try:
            if method == "PUT" and kind.partition(";")[0] != FORM:
                raise NotUnderstood(f"A PUT has its parameters in its body as {FORM}")
            given = dict(parse_qsl(body.decode() if method == "PUT" else url.query, keep_blank_values=True))
            folded = {name.lower(): value for name, value in given.items()}
            number = folded.get("clienttransactionid", "0")
            numbers = {"ClientTransactionID": _value("ClientTransactionID", number, "whole"),
                       "ServerTransactionID": next(self._numbers)}  # fmt: skip
            try:
                answer = self.respond(method, url.path, given)
                value = {} if method == "PUT" else {"Value": answer}
                return 200, json.dumps({**value, **numbers, "ErrorNumber": 0, "ErrorMessage": ""})
            except AlpacaError as refusal:
                return 200, json.dumps({**numbers, "ErrorNumber": refusal.number, "ErrorMessage": str(refusal)})
        except (NotUnderstood, UnicodeError) as error:
            return 400, str(error)

    def respond(self, method: str, path: str, given: dict[str, str]) -> Any:
        """Return the value, None for a PUT. Raises NotUnderstood, Refusal."""
        if path.startswith("/management/") and method == "GET":
            return self._management(path)
        member, known, which = path.removeprefix(DEVICE), rows(), rows()["which"]
        wants = known["put"].get(member) if method == "PUT" else known["get"].get(member, {})
        there = wants is not None if method == "PUT" else method == "GET" and readable(member)
        if member == path or wants is None or not there or (member in which["platform7"] and self.platform < 7):
            raise NotUnderstood(f"There is no {method} {path}")
        if method == "GET":
            given = {name.lower(): value for name, value in given.items()}
            wants = {name.lower(): kind for name, kind in wants.items()}
        if missing := wants.keys() - given:
            raise NotUnderstood(f"{member}: {missing.pop()} is missing")
        values = [_value(name, given[name], kind) for name, kind in wants.items()]
        if self.lacks & {member, f"{member}_{method.lower()}"}:
            raise AlpacaError(NOT_IMPLEMENTED, f"{member} is not implemented in this driver.")
        if member not in which["always"] and not self.connected:
            raise AlpacaError(NOT_CONNECTED, f"{member}: the telescope is not connected")
        if method == "GET":
            return read(self, member, *values)
        if self.at == "park" and (member in which["unparked"] or (member, values) == ("tracking", [True])):
            raise AlpacaError(PARKED, f"{member} is not possible while the telescope is parked")
        WRITES[member](self, *values)
        self.waits = member in which["blocking"] or (self.blocks and member.startswith(("slew", "park", "findhome")))
        return None

    def _management(self, path: str) -> Any:
        server = {"ServerName": "Simulated server", "Manufacturer": "mount-gateway", "ManufacturerVersion": "1.0",
                  "Location": "nowhere"}  # fmt: skip
        device = {"DeviceName": f"Simulated {self.model}", "DeviceType": "Telescope", "DeviceNumber": 0,
                  "UniqueID": self.unique_id}  # fmt: skip
        told = {"apiversions": [1], "v1/description": server, "v1/configureddevices": [device]}
        try:
            return told[path.removeprefix("/management/")]
        except KeyError:
            raise NotUnderstood(f"There is no {path}") from None


def _value(name: str, text: str, kind: str) -> Any:
    """Return a parameter. Raises NotUnderstood."""
    try:
        value = KINDS[kind](text)
        if kind != "number" or math.isfinite(value):
            return value
    except (KeyError, ValueError):
        pass
    raise NotUnderstood(f"{name} cannot be {text!r}")
