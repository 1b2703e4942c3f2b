"""Converts the driver's request lines to HTTP requests of Alpaca, and JSON answers to reply lines.

Parameter names are spelt as in ASCOM, and truth values ``True`` and ``False`` as in .NET: servers may refuse any other
spelling. The reply line for an error has the error number and the server's text. An HTTP status of ``ABSENT_CODES``
means that the server does not have the member.
"""

from __future__ import annotations

import errno
import json
import random
from contextlib import suppress
from itertools import count
from typing import Any
from urllib.parse import unquote, urlsplit

from gateway.protocols.alpaca.http.chain import check_for_loop
from gateway.transport.http_wire import HttpRequest

#: The HTTP status of success, and those for a member or a parameter that a server does not have.
HTTP_OK, ABSENT_CODES = 200, (400, 404, 405, 422, 501)
#: The path at which a server describes itself.
DESCRIPTION_PATH = "/management/v1/description"
#: ASCOM's error numbers for "not implemented" and for an unspecified error.
NOT_IMPLEMENTED, UNSPECIFIED = 0x400, 0x500
#: The beginnings of the names of members that set the mount moving.
MOTION_PREFIXES = ("slewto", "moveaxis", "park", "findhome")
#: The longest error text that is passed on, characters.
MAX_ERROR_TEXT = 600
#: Old ASCOM drivers add this to error numbers: 0x80040400 is 0x400.
HRESULT = 0x80040000


class TelescopeHttp:
    """Converts between lines and HTTP for a telescope, ``http://HOST:PORT[/NUMBER]``."""

    def __init__(self, url: str) -> None:
        self._url, self._device_number = url, urlsplit(url).path.strip("/") or "0"
        self._path = f"/api/v1/telescope/{self._device_number}/"
        self._client_id, self._transaction_ids = random.randrange(1, 2**32), count(1)
        self.first_requests = (HttpRequest("GET", DESCRIPTION_PATH, {}), self.request(b"get connected\n"))

    def check_first_answer(self, request: HttpRequest, status: int, body: bytes) -> None:
        """Check the answer to one of the first requests. Raises OSError if the server does not have this telescope, or
        if it is this gateway itself, directly or through another gateway.
        """
        answer: Any = None
        if status == HTTP_OK:
            with suppress(ValueError):
                answer = json.loads(body)
        if request.path == DESCRIPTION_PATH:  # some servers have none
            value = answer.get("Value") if isinstance(answer, dict) else None
            check_for_loop(self._url, value if isinstance(value, dict) else {})
        elif not isinstance(answer, dict):
            which = f"it has no telescope {self._device_number} (HTTP status {status})"
            raise OSError(errno.ENODEV, f"no Alpaca server is there, or {which}")

    def request(self, line: bytes) -> HttpRequest:
        verb, member, *arguments = line.decode("ascii").split()
        fields = {}
        for word in arguments:
            name, _, value = word.partition("=")
            fields[name] = value.capitalize() if value in ("true", "false") else unquote(value)
        ends = member == "abortslew" or (member == "moveaxis" and not float(fields["Rate"]))
        is_motion = False if ends else True if verb == "put" and member.startswith(MOTION_PREFIXES) else None
        numbers = {"ClientID": str(self._client_id), "ClientTransactionID": str(next(self._transaction_ids) % 2**32)}
        return HttpRequest(verb.upper(), self._path + member, fields | numbers, is_motion)

    def reply(self, status: int, body: bytes) -> bytes:
        if status != HTTP_OK:
            text = " ".join(body.decode("utf-8", "replace").split())
            return _error_line(NOT_IMPLEMENTED if status in ABSENT_CODES else UNSPECIFIED, f"HTTP {status}: {text}")
        try:
            answer = json.loads(body)
            number = int(answer.get("ErrorNumber") or 0)
        except (ValueError, AttributeError, TypeError):
            return _error_line(UNSPECIFIED, "The reply is not a JSON object of Alpaca.")
        if number:
            return _error_line(
                number & 0xFFF if number & ~0xFFF in (HRESULT, HRESULT - 2**32) else number, answer.get("ErrorMessage")
            )
        return _reply_line(answer.get("Value"))


def _error_line(number: int, text: Any) -> bytes:
    return _reply_line({"ErrorNumber": number, "ErrorMessage": str(text or "")[:MAX_ERROR_TEXT]})


def _reply_line(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode("ascii") + b"\n"
