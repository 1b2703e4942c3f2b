"""What programs receive over a poor line, and how soon the first reply arrives, on virtual time.

A program asks for the position again 0.3 s after every reply, at rest and during a slew. ``first_answer`` is how soon
an LX200 that the gateway has not met before is identified.
"""

from __future__ import annotations

import asyncio

from tests.support.in_process_gateway import Bridge
from tests.support.poor_line import LineFaults, Polls, insert_poor_line, poll

LINES = {
    "as it should be": LineFaults(),
    "3 % lost": LineFaults(lost=0.03),
    "3 % garbled": LineFaults(garbled=0.03),
    "3 % doubled": LineFaults(doubled=0.03),
    "3 % of each": LineFaults(lost=0.03, garbled=0.03, doubled=0.03),
    "round trip of 1 s": LineFaults(seconds=1.0),
    "answers 3.6 s late": LineFaults(seconds=3.6),
}
MOUNTS = {"cpc": "nexstar", "lx200gps": "lx200", "lx200": "lx200"}
GOTO = b":RM#:Me#"


async def polled(model: str, driven: str, poor: LineFaults, seconds: float, moving: bool, seed: int = 1) -> Polls:
    """Measure one line."""
    bridge = Bridge(
        model, driven=driven, presented="lx200", surface="autostar", named=driven == "lx200", config={"sun": 0.0}
    )
    insert_poor_line(bridge, poor, seed)
    bridge.controller.start()
    try:
        async with asyncio.timeout(90.0):
            await bridge.controller.site_read.wait()
    except TimeoutError:
        pass
    if moving:
        mover = bridge.client("10.0.0.8")
        mover.send(b":Sr08:00:00#:Sd+60*00:00#:MS#")
        bridge.sim.mechanics.speedup = 0.2
    polls = await poll(bridge, seconds)
    await bridge.controller.close()
    return polls


async def first_answer(model: str, named: bool, latency: float) -> float:
    """Return the seconds from a gateway's start to the first position for a program that asks as soon as it may."""
    bridge = Bridge(model, driven="lx200", presented="lx200", surface="autostar", latency=latency, named=named)
    bridge.controller.start()
    loop, client = asyncio.get_running_loop(), bridge.client()
    began = loop.time()
    while client.received.count(b"#") < 2 and loop.time() < began + 60.0:
        if client.all_answered:
            client.send(b":GR#:GD#")
        await asyncio.sleep(0.05)
    took = loop.time() - began
    await bridge.controller.close()
    return took
