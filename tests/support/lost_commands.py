"""Loses one byte, command or reply of a motion command or of its stop: the mount must stand still afterwards.

For every mount, every way to move and every stop command it counts the traffic after the motion command, and after its
stop, on a good line; then it loses each command, reply and byte of it in turn, on virtual time. Ten seconds after the
stop the true axes of the mount may only track.
"""

from __future__ import annotations

import asyncio
from typing import Any

from msgspec import Struct

from gateway.diagnostics.virtual_time import run
from tests.support import truth
from tests.support.in_process_gateway import Bridge

#: Protocol, model and version.
MOUNTS: dict[str, tuple[str, str, str | None]] = {
    "cpc": ("nexstar", "cpc", "4.21"), "cge": ("nexstar", "cge", "4.21"), "6-8se": ("nexstar", "6-8se", "4.21"),
    "avx": ("nexstar", "avx", "5.31"), "slt": ("nexstar", "slt", "4.03"),
    "nexstar-gps/1.2": ("nexstar", "nexstar-gps", "1.2"), "nexstar-gps/2.2": ("nexstar", "nexstar-gps", "2.2"),
    "gt": ("nexstar", "gt", "101.0"), "lx200": ("lx200", "lx200", None), "lx200-16": ("lx200", "lx200-16", None),
    "lx200gps": ("lx200", "lx200gps", None), "autostar": ("lx200", "autostar", None),
}  # fmt: skip
#: What programs of either kind send: typed from the manuals.
LX200_MOTIONS = {"arrow": b":RM#:Me#", "nudge": b":RG#:Mn#", "goto": b":Sr08:00:00#:Sd+30*00:00#:MS#",
                 "pulse": b":Mgn3000#", "park": b":hP#"}  # fmt: skip
LX200_ENDS = {"arrow": (b":Qe#", b":Q#"), "nudge": (b":Qn#", b":Q#"), "goto": (b":Q#", b":Qe#"),
              "pulse": (b":Q#", b":Qn#"), "park": (b":Q#",)}  # fmt: skip
NEXSTAR_MOTIONS = {"arrow": b"P\x02\x10\x24\x09\x00\x00\x00", "goto": b"r55555500,15555500",
                   "rate": b"P\x03\x11\x06\x40\x00\x00\x00"}  # fmt: skip
_RATE_0 = b"P\x02\x10\x24\x00\x00\x00\x00", b"P\x02\x11\x24\x00\x00\x00\x00"
NEXSTAR_ENDS = {"arrow": (_RATE_0[0],), "goto": (b"M", _RATE_0[0]), "rate": (_RATE_0[1],)}
#: Seconds: from a motion command to its stop, and from there to the verdict.
HELD, ALLOWED = 2.0, 10.0
#: Seconds after a motion command, or a stop, in which traffic is lost.
WINDOW = 1.5
QUIET = {"lowest": -90.0, "sun": 0.0, "dead_man": 600.0}


class Case(Struct, frozen=True):
    """A line with one fault. ``after`` is "order" or "stop"; ``lost`` is "command", "reply", "byte" or "" for none."""

    mount: str
    program: str
    motion: str
    end: bytes
    after: str = "stop"
    lost: str = ""
    number: int = 0


class Outcome(Struct, frozen=True):
    """``moved``: seconds after the stop until the true axes came to rest; ``size``: commands, replies and bytes."""

    case: Case
    moved: float
    moves: bool
    size: tuple[int, int, int]
    swallowed: bytes
    sent: tuple[bytes, ...] = ()


class Swallowing:
    """Loses one thing between a gateway and its simulated mount, once it is armed."""

    def __init__(self, bridge: Any, case: Case) -> None:
        self._feed, self._case, self._until = bridge.controller.line.wire.feed, case, 0.0
        self.commands = self.replies = self.bytes = 0
        self.swallowed = b""
        bridge.controller.line.wire.feed = self._hear

    def arm(self) -> None:
        self._until = asyncio.get_running_loop().time() + WINDOW

    def _hear(self, data: bytes) -> bytes:
        if asyncio.get_running_loop().time() >= self._until:
            return bytes(self._feed(data))
        lost, number = self._case.lost, self._case.number
        self.commands += 1
        first = self.bytes
        self.bytes += len(data)
        if lost == "command" and self.commands == number:
            self.swallowed = data
            return b""
        if lost == "byte" and first < number <= self.bytes:
            self.swallowed = data
            data = data[: number - first - 1] + data[number - first :]
        answer = bytes(self._feed(data))
        if answer:
            self.replies += 1
            if lost == "reply" and self.replies == number:
                self.swallowed = data
                return b""
        return answer


async def _play(case: Case) -> Outcome:
    driven, model, version = MOUNTS[case.mount]
    lx200 = case.program == "lx200"
    surface = "lx200gps" if lx200 else "cge"
    async with Bridge(model, version, driven=driven, presented=case.program, surface=surface, config=QUIET) as bridge:
        line = Swallowing(bridge, case)
        client, other = bridge.client(), bridge.client("10.0.0.9")
        question = b":GR#" if lx200 else b"e"
        before = len(bridge.sent_requests())
        if case.after == "order":
            line.arm()
        client.send((LX200_MOTIONS if lx200 else NEXSTAR_MOTIONS)[case.motion])
        await asyncio.sleep(HELD)
        if case.after == "stop":
            line.arm()
        client.send(case.end)
        moved = 0.0
        for tenth in range(1, round(ALLOWED * 10) + 1):
            if tenth % 5 == 1:
                other.send(question)
            await asyncio.sleep(0.1)
            if truth.moving(bridge.sim):
                moved = tenth / 10.0
        moves = truth.moving(bridge.sim)
        sent = tuple(bridge.sent_requests()[before:]) if moves else ()
        return Outcome(case, moved, moves, (line.commands, line.replies, line.bytes), line.swallowed, sent)


def play(case: Case) -> Outcome:
    """Run one case, on virtual time."""
    return run(_play(case))
