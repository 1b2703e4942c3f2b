"""Asks a mount 91 things, directly and through a gateway of the mount's own protocol, and reports what differs.

Two simulated mounts of the same kind run on one virtual clock and get the same requests, one of them through a gateway
without a configured model. The bytes are typed by hand from the two manuals and from what programs are known to send.
Apart from the seconds of clocks, and angles that move with them, the replies must be the same.
"""

from __future__ import annotations

import asyncio
import re
from typing import Any, NamedTuple

from gateway.app.config import Endpoint
from gateway.app.simulated import make_simulator
from tests.support.in_process_gateway import Bridge

#: The mounts to compare: protocol, model, version.
MOUNTS = (
    ("nexstar", "cpc", "4.21"), ("nexstar", "cge", "4.21"), ("nexstar", "avx", "5.31"), ("nexstar", "6-8se", "4.21"),
    ("nexstar", "slt", "4.03"), ("nexstar", "gt", "101.0"), ("nexstar", "nexstar-gps", "1.2"),
    ("nexstar", "nexstar-gps", "2.2"), ("lx200", "autostar", None), ("lx200", "lx200", None),
    ("lx200", "lx200-16", None), ("lx200", "lx200gps", None),
)  # fmt: skip
#: How many of the 91 replies may differ; mappings/README.md says which do, and why.
ALLOWED = 2
#: Seconds to wait for a reply.
PATIENCE = 4.0
#: Seconds that a classic LX200 works after it has received a date.
LONG = 6.0
#: Seconds by which the clocks in two replies may differ.
CLOCK = 3

_ALT_AZ, _POLAR = b"\1", b"\2"


def _p(*numbers: int) -> bytes:
    return bytes((0x50, *numbers, *(0,) * (7 - len(numbers))))


def _get(device: int, number: int, count: int) -> bytes:
    """Return ``P 1 device number 0 0 0 count``."""
    return bytes((0x50, 1, device, number, 0, 0, 0, count))


#: Requests whose replies contain a time of day, or an angle that moves with it.
NEXSTAR_CLOCKS = {b"h", b"i", _get(176, 51, 3), _get(178, 51, 3)}
_ANGLES, _MOTORS = (b"l", b"e", b"E", b"z", b"Z"), (_get(16, 1, 3), _get(17, 1, 3))
#: Devices that no mount in the list has: hand control, accessory hand control, wireless, power.
_ABSENT = (4, 13, 14, 32, 181, 182, 183, 191)

NEXSTAR: tuple[bytes, ...] = (
    b"V", b"v", b"m", b"J", b"L", b"t", b"Kx", b"K#", b"w", b"h", b"i", b"l", b"p", b"e", b"E", b"z", b"Z",
    *(_get(device, 254, 2) for device in (16, 17, 18, 176, 178, 1, *_ABSENT)),
    *(_get(device, 254, 4) for device in (16, 17)),
    *(
        _get(176, number, count)
        for number, count in ((55, 1), (1, 3), (2, 3), (3, 2), (4, 2), (51, 3), (54, 1), (7, 2), (8, 2))
    ),
    *(_get(178, number, count) for number, count in ((3, 2), (4, 2), (51, 3))),
    *(
        _get(motor, number, count)
        for motor in (16, 17)
        for number, count in (
            (5, 2), (0x0E, 1), (0x12, 1), (0x13, 1), (0x15, 1), (0x18, 1), (0x21, 4), (0x23, 1), (0x27, 1), (0x3B, 1),
            (0x3C, 3), (0x40, 1), (0x41, 1), (0x47, 1), (0xFC, 1),
        )
    ),
    _get(18, 1, 3), _get(18, 0x13, 1),
    _p(2, 16, 0x46, 100), _get(16, 0x47, 1), _p(2, 17, 0x10, 12), _get(17, 0x40, 1),
    _p(2, 16, 0x24, 0), _p(2, 17, 0x24, 0), b"M", b"T\0", b"t", b"z", b"Z", _get(16, 1, 3), _get(17, 1, 3), b"n",
)  # fmt: skip

_TIME = re.compile(rb"\d\d:\d\d:\d\d")
#: Requests whose replies contain running seconds.
LX200_CLOCKS = {b":GL#", b":Ga#", b":GS#", b":GZ#", b":GA#", b":gps#", b":GR#"}

LX200: tuple[bytes, ...] = (
    b"\x06", b":GR#", b":GD#", b":GZ#", b":GA#", b":Gr#", b":Gd#", b":D#",
    b":GVP#", b":GVN#", b":GVD#", b":GVT#", b":GVF#", b":GW#", b":GT#",
    b":GL#", b":Ga#", b":GC#", b":GG#", b":Gc#", b":GS#", b":Gt#", b":Gg#", b":GH#", b":ED#",
    b":GM#", b":GN#", b":GO#", b":GP#", b":Go#", b":Gh#",
    b":Gb#", b":Gf#", b":GF#", b":Gl#", b":Gs#", b":Gy#", b":Gq#",
    b":G0#", b":G1#", b":G2#", b":h?#", b":gps#", b":fT#", b":??#", b":?+#", b":?-#", b":P#",
    b":SMABC#", b":GM#", b":Sb-05.0#", b":Gb#", b":Sf+12.0#", b":Gf#", b":SF020#", b":GF#", b":Sl010#", b":Gl#",
    b":Ss100#", b":Gs#", b":SyGPDco#", b":Gy#",
    b":Lo0#", b":Ls0#", b":LI#", b":LM42#:LI#", b":Gr#", b":Gd#", b":Lf#", b":LC224#:LI#", b":Gr#",
    b":Sr05:35:17#", b":Sd-05*23:28#", b":Gr#", b":Gd#", b":St+45*00#", b":Gt#", b":Sg350*00#", b":Gg#",
    b":So10*#", b":Go#", b":Sh80#", b":Gh#", b":Sw4#", b":ST060.1#", b":GT#",
    b":U#:Gd#", b":U#:Gd#", b":AA#:GW#", b":MS#", b":SC01/15/26#",
)  # fmt: skip


class Difference(NamedTuple):
    """A request, the reply of the mount itself, and the reply of the gateway."""

    asked: bytes
    direct: bytes
    shared: bytes


def alike(protocol: str, asked: bytes, one: bytes, other: bytes) -> bool:
    """Whether two replies are the same, apart from the seconds of a clock."""
    if one == other:
        return True
    if len(one) != len(other):
        return False
    if protocol == "lx200":
        if asked not in LX200_CLOCKS:
            return False
        form = re.sub(rb"\d", b"0", one) == re.sub(rb"\d", b"0", other)
        return form and abs(_seconds(one) - _seconds(other)) <= CLOCK * 15
    if asked in _ANGLES:
        halves = zip(one.rstrip(b"#").split(b","), other.rstrip(b"#").split(b","), strict=True)
        return all(_near(int(a, 16), int(b, 16), 4 * len(a)) for a, b in halves)
    if asked in _MOTORS:
        return len(one) == 4 and _near(int.from_bytes(one[:3]), int.from_bytes(other[:3]), 24)
    return asked in NEXSTAR_CLOCKS and sum(abs(a - b) for a, b in zip(one, other, strict=True)) <= CLOCK


def _near(one: int, other: int, bits: int) -> bool:
    """Whether two angles, fractions of a turn, differ by no more than the sky turns in a few seconds."""
    return abs(one - other) <= max(1, CLOCK * 15 * (1 << bits) // 1296000)


def _seconds(text: bytes) -> int:
    """Convert hours or degrees, minutes and seconds to seconds of either."""
    total = 0
    for number in re.findall(rb"\d+", text)[:3]:
        total = total * 60 + int(number)
    return total


async def differences(protocol: str, model: str, version: str | None) -> list[Difference]:
    """Ask both mounts the 91 things; return the requests with different replies."""
    asked = NEXSTAR if protocol == "nexstar" else LX200
    bridge = Bridge(model, version, driven=protocol, presented=protocol, surface=None, latency=0.02)
    twin: Any = make_simulator(Endpoint(protocol, "sim", model, version), clock=bridge.clock)
    async with bridge:
        late: list[bytes] = []
        direct = twin.connection(lambda _, data: late.append(data)) if protocol == "lx200" else twin.connection()
        if protocol == "lx200" and len(direct(b":GR#")) < 9:  # short format, as an earlier program may have left it
            direct(b":U#")
        client = bridge.client()
        await asyncio.sleep(3.0)
        found = []
        for question in asked:
            client.received = b""
            client.send(question)
            answered = direct(question)  # both receive it at the same moment
            shared = await _whole(client)
            if question.startswith(b":SC"):  # a classic LX200 works on it for seconds
                await asyncio.sleep(LONG)
                answered += b"".join(late)
            if not alike(protocol, question, answered, shared):
                found.append(Difference(question, answered, shared))
        return found


async def _whole(client: Any) -> bytes:
    """Return the reply with all that follows its first byte; empty if none begins within ``PATIENCE`` seconds."""
    waited = 0.0
    while waited < PATIENCE and not client.received:
        await asyncio.sleep(0.05)
        waited += 0.05
    await asyncio.sleep(0.5)
    return bytes(client.received)


def asked_of(protocol: str) -> int:
    """Return the number of requests."""
    return len(NEXSTAR if protocol == "nexstar" else LX200)
