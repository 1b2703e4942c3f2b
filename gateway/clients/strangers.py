"""Who is no program for telescopes: the first bytes by which a web browser, a port scanner, a proxy are told.

Only the beginning of a connection is looked at. There nothing that a mount's program says can be taken for one of
these; later the same bytes may be part of a site's name, or the digits of an angle. The table is data: a new greeting
is one more word or row. Sources: RFC 9110, 4918 and 3253 (HTTP), 7826 (RTSP), 3261 (SIP), 5321 (SMTP), 8446 (TLS), 4253
(SSH), 1928 (SOCKS), 854 (Telnet), 8489 and 4571 (STUN), and the probes that nmap sends.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from msgspec import Struct

from gateway.protocols.registry import PROTOCOLS

#: What programs send in front of their first command: it ends nothing, asks nothing, and both protocols pass it over.
IDLE = b"#\r\n\0 ?"

#: One byte of a greeting: the values that it may have.
Octet = frozenset[int]


class Greeting(Struct, frozen=True):
    """What a stranger begins with: the bytes ``first`` decide, ``words`` follow "sends" in the log."""

    words: str
    first: tuple[Octet, ...]
    #: A page is shown to whoever sends it; HEAD is answered without the page's text.
    http: bool = False
    head_only: bool = False


#: What is sent -> words, each of which decides together with the blank behind it.
METHODS = {
    "an HTTP request": (
        "GET HEAD POST PUT DELETE CONNECT TRACE PATCH QUERY PURGE "
        "PROPFIND PROPPATCH MKCOL COPY MOVE LOCK UNLOCK BCOPY BDELETE BMOVE BPROPFIND BPROPPATCH POLL "
        "ACL BASELINE-CONTROL BIND CHECKIN CHECKOUT LABEL LINK MERGE MKACTIVITY MKCALENDAR MKREDIRECTREF MKWORKSPACE "
        "ORDERPATCH REBIND REPORT SEARCH UNBIND UNCHECKOUT UNLINK UPDATE UPDATEREDIRECTREF VERSION-CONTROL "
        "M-SEARCH NOTIFY SUBSCRIBE UNSUBSCRIBE"
    ),
    "an HTTP, RTSP or SIP request": "OPTIONS",
}
#: The same, where all that decides is written down.
TEXTS = {
    "an RTSP request": (
        "ANNOUNCE ",
        "DESCRIBE ",
        "GET_PARAMETER ",
        "PAUSE ",
        "PLAY ",
        "RECORD ",
        "REDIRECT ",
        "SETUP ",
        "SET_PARAMETER ",
        "TEARDOWN ",
    ),
    "a SIP request": (
        "ACK ",
        "BYE ",
        "CANCEL ",
        "INFO ",
        "INVITE ",
        "MESSAGE ",
        "PRACK ",
        "PUBLISH ",
        "REFER ",
        "REGISTER ",
    ),
    "an HTTP/2 preface": ("PRI * ",),
    "a proxy's line": ("PROXY ",),
    "an answer of a web server": ("HTTP/",),
    "an SSH greeting": ("SSH-",),
    "a mail server's command": ("EHLO ", "EHLO\r", "EHLO\n", "HELO ", "HELO\r", "HELO\n", "MAIL ", "RCPT "),
    "a command of FTP, POP3 or IRC": (
        "USER ",
        "PASS ",
        "AUTH ",
        "NICK ",
        "CAPA",
        "CAP LS",
        "QUIT\r",
        "QUIT\n",
        "NOOP\r",
        "NOOP\n",
    ),
    "a call for help": ("HELP\r", "HELP\n", "HELP "),
    "JSON": ('{"', "{}", "{ ", "{\r", "{\n", "{\t", '["', "[{", "[[", "[]", "[ ", "[\r", "[\n"),
    "XML": ("<?xml", "<!DOC", "<html", "<stream", "<getProperties", "<policy-file"),
    "a command for Redis": ("*1\r\n$", "*2\r\n$", "*3\r\n$", "PING\r", "PING\n"),
    "a command for a printer": ("\x1b%-12345X", "@PJL "),
    "rsync's greeting": ("@RSYNCD:",),
    "a port scanner's probe": (
        "JRMI",
        "TNMP",
        "DmdT",
        "GIOP",
        "WWWOFFLE",
        "DB2DAS",
        "< NTP/",
        "sqA",
        "gkrellm",
        "Subscribe\n",
        "Query\n",
        "serverstatus",
        "version\r",
        "version\n",
        "ver\r",
        "ver\n",
        "VERSION",
        ">version",
        "stats\r",
        "stats\n",
        "show ",
        "login\r",
        "login\n",
        "init\n",
        "get_",
        "fox a",
        "AMQP",
        "CNXN",
        "ZBXD",
        "DIST0",
        "TSH ",
        "NXSH-",
        "TVNM",
        "LO_SERVER",
        "CONNECT0",
        "Client string",
        "ST\n",
        "666",
        "\x01default\n",
        ":\0\0\0/",
    ),
}
#: The same in hexadecimal: ``..`` is any byte, ``A-B`` a range. No leading NULs: they are passed over, except where the
#: row would tell too little without the last of them.
ROWS = {
    "a TLS hello": ("16 03", "80 .. 01 00", "80 .. 01 02", "80 .. 01 03"),
    "a SOCKS request": ("04 01-02", "05 01-09"),
    "a Telnet negotiation": ("FF F0-FE",),
    "an SMB request": ("FF 53 4D 42", "FE 53 4D 42", "00 .. FF 53 4D 42", "00 .. FE 53 4D 42", "81 00 00"),
    "a STUN request": (
        "00 01 .. .. 21 12 A4 42",
        "00 03 .. .. 21 12 A4 42",
        "01 00 00 21 12 A4 42",
        "00 .. 00 01 .. .. 21 12 A4 42",
        "00 .. 00 03 .. .. 21 12 A4 42",
    ),
    "a question for a name server": (
        "00 10-1F .. .. 00-01 00 00 01",
        "00 25-39 .. .. 00-01 00 00 01",
        "00 10-1F .. .. 00-01 20 00 01",
        "00 25-39 .. .. 00-01 20 00 01",
        "00 0C 00 00 10 00",
    ),
    "a remote procedure call": ("80 00 00",),
    "a Kerberos request": ("00 00-39 6A 81-82", "00 3B-FF 6A 81-82"),
    "an LDAP request": ("30 84 00 00", "30 .. 02 01"),
    "a request for a remote desktop": ("03 00 00", "01 00 00 00 01"),
    "a request for a database": (
        "12 01 00",
        "08 04 D2 16 2F",
        "00 .. 00 03 00 00 75 73 65 72",
        "00 5A 00 00 01 00 00 00 01",
        "41 00 00 00 3A 30",
    ),
    "an MQTT request": ("10 .. 00 04 4D 51", "10 .. 00 06 4D 51"),
    "a port scanner's probe": (
        "6C 00 0B",
        "42 00 00 0B",
        "01 00 00 FD CE",
        "12 34 00 01",
        "F4 BE 03",
        "C2 E5",
        "3C 00 4B",
        "80 10 00",
        "FE 01",
        "D6 D7 C5 D5",
        "CC 01 00",
        "02 60",
        "07 00 08",
        "01 01 00 1A",
        "01 C2 00 00",
        "01 07",
        "00 03 00 01 00 00 00 00 00 00 00 02",
        "00 01 6E",
        "0B 6E 00",
        "94 00 CD",
        "00 .. D0 01",
        "01 00 00 00 13",
        "00 94 01",
        "00 0E 38 37",
        "00 1F 00 00 00 00 00 00",
    ),
}


def _from_text(text: str) -> tuple[Octet, ...]:
    return tuple(frozenset((byte,)) for byte in text.encode("latin-1"))


def _from_hexadecimal(text: str) -> tuple[Octet, ...]:
    """Bytes as in ``ROWS``."""
    octets = []
    for word in text.split():
        low, _, high = word.partition("-")
        octets.append(frozenset(range(256) if word == ".." else range(int(low, 16), int(high or low, 16) + 1)))
    return tuple(octets)


def _greetings() -> Iterator[Greeting]:
    for words, methods in METHODS.items():
        for method in methods.split():
            yield Greeting(words, _from_text(f"{method} "), http=True, head_only=method == "HEAD")
    for words, texts in TEXTS.items():
        for text in texts:
            yield Greeting(words, _from_text(text), http=text.startswith("PRI"))
    for words, rows in ROWS.items():
        for row in rows:
            yield Greeting(words, _from_hexadecimal(row))


def _of_protocols(own: str) -> Iterator[Greeting]:
    """The greetings of programs that speak another protocol than the surface's ``own``."""
    for spec in PROTOCOLS.values():
        if spec.greeting and spec.name != own:
            words = f"{spec.title}'s own protocol (for that add --surface {spec.name}@tcp://HOST:{spec.usual_port}"
            choice = f", or choose {PROTOCOLS[own].title} in the program)" if own in PROTOCOLS else ")"
            yield Greeting(words + choice, tuple(frozenset((byte,)) for byte in spec.greeting))


@cache
def greetings(own: str = "") -> tuple[Greeting, ...]:
    """On a surface of that protocol. Worked out for the first connection: the start of the gateway does not wait."""
    return (*_greetings(), *_of_protocols(own))


@cache
def _beginning_with(byte: int, own: str) -> list[Greeting]:
    """The greetings that may begin with a byte."""
    return [greeting for greeting in greetings(own) if byte in greeting.first[0]]


class Recogniser:
    """Hears a connection from its first byte on, in pieces of any size, until it is known who it cannot be.

    ``own`` is the protocol that is spoken here. What it remembers is how far every greeting has matched, so that it
    needs no more memory than the table has bytes.
    """

    def __init__(self, own: str = "") -> None:
        self._own = own
        #: Whether a stranger may still be recognised.
        self.open = True
        self._begun: list[tuple[Greeting, int]] = []
        self._leading = True

    def hear(self, data: bytes) -> Greeting | None:
        """More bytes have come -> the greeting that they complete, if they do."""
        for byte in data:
            begun = [(greeting, count + 1) for greeting, count in self._begun if byte in greeting.first[count]]
            if self._leading:
                begun += [(greeting, 1) for greeting in _beginning_with(byte, self._own)]
                self._leading = byte in IDLE
            for greeting, count in begun:
                if count == len(greeting.first):
                    self.open = False
                    return greeting
            self._begun = begun
            if not begun and not self._leading:
                self.open = False
                break
        return None


def page(speaks: str, head_only: bool = False) -> bytes:
    """What a web browser is shown: a whole HTTP/1.1 answer in plain words. ``speaks``: the port's own protocol."""
    text = (
        '<!doctype html>\n<html lang="en">\n<title>mount-gateway</title>\n<link rel="icon" href="data:,">\n'
        f"<p>This port of mount-gateway is for telescope programs that speak {speaks}.\n"
        "<p>A web browser can do nothing here, and nothing of its request has reached the mount.\n"
        "To use the mount, enter this address and this port in your telescope program.\n"
    ).encode()
    head = (
        "HTTP/1.1 400 Bad Request\r\nContent-Type: text/html; charset=utf-8\r\n"
        f"Content-Length: {len(text)}\r\nCache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n"
        "Connection: close\r\n\r\n"
    ).encode()
    return head if head_only else head + text
