"""Which protocol answers on a line, asked so that nothing can move.

``Kx`` first: an LX200 ignores it. Then the single byte 0x06, which no hand control takes for a command. Nothing that
begins with ``:`` goes out, for LX200 text is live ammunition on a hand control.
"""

from __future__ import annotations

import asyncio

from gateway.wires import SerialWire

WAIT = 1.5


async def who_answers(url: str, baud: int) -> str | None:
    """``"nexstar"``, ``"lx200"``, or None when nobody answers sensibly."""
    if url == "sim":
        return None
    wire = SerialWire(url, baud)
    arrived = bytearray()
    try:
        await wire.open(arrived.extend, lambda reason: None)
    except OSError:
        return None
    try:
        wire.write(b"Kx")
        if await _until(lambda: b"x#" in arrived):
            return "nexstar"
        arrived.clear()
        wire.write(b"\x06")
        if await _until(lambda: bytes(arrived[:1]) in (b"A", b"L", b"P", b"D", b"G")):
            return "lx200"
        return None
    except OSError:
        return None
    finally:
        await wire.close()


async def _until(condition: object) -> bool:
    """Whether a condition comes true in time."""
    assert callable(condition)
    for _ in range(round(WAIT / 0.05)):
        if condition():
            return True
        await asyncio.sleep(0.05)
    return bool(condition())
