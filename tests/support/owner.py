"""A person at the mount: uses its keypad, its power switch and its cable. The gateway sees only the effects."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from gateway.protocols.lx200.simulator.motion import release_keys
from tests.support import truth

#: What the keys do, as commands on a separate connection to the mount; typed from the manuals.
KEYS = {
    "nexstar": {"up": b"P\x02\x11\x24\x07\x00\x00\x00", "let go": b"P\x02\x11\x24\x00\x00\x00\x00", "cancel": b"M",
                "first on": b"P\x02\x10\x24\x09\x00\x00\x00", "first back": b"P\x02\x10\x25\x09\x00\x00\x00",
                "back": b"P\x02\x10\x25\x07\x00\x00\x00",
                "down": b"P\x02\x11\x25\x09\x00\x00\x00", "first let go": b"P\x02\x10\x24\x00\x00\x00\x00",
                "tracking off": b"T\x00", "site": b"W\x33\x1c\x00\x00\x00\x00\x00\x01"},
    "lx200": {"up": b":Mn#", "let go": b":Qn#", "cancel": b":Q#", "tracking off": b":AL#",
              "first on": b":RS#:Mw#", "first back": b":RS#:Me#", "back": b":RM#:Me#", "down": b":RS#:Ms#",
              "first let go": b":Qw#",
              "site": b":St+51*28#:Sg000*00#"},
}  # fmt: skip


class Cable:
    """The transport of a bridge, which can be pulled out, plugged in again, or muted."""

    name = "sim"

    def __init__(self, wire: Any) -> None:
        self._wire, self.out, self.mute = wire, False, False
        self._lost: Callable[..., object] | None = None

    async def open(self, on_data: Any, on_lost: Any) -> None:
        if self.out:
            raise OSError(2, "no such port")
        self._lost = on_lost
        await self._wire.open(on_data, on_lost)

    def write(self, data: bytes) -> None:
        if self.out:
            raise OSError(5, "gone")
        if not self.mute:
            self._wire.write(data)

    async def close(self) -> None:
        await self._wire.close()

    def pull(self) -> None:
        self.out = True
        if self._lost is not None:
            self._lost("unplugged")


class Owner:
    """The person at a bridge's mount; ``since`` is what the gateway has sent since the person's last action."""

    def __init__(self, bridge: Any, driven: str) -> None:
        self._bridge, self._driven = bridge, driven
        self._speak = bridge.sim.connection()
        self.cable = Cable(bridge.controller.line.wire)
        bridge.controller.line.wire = self.cable
        self._before = 0

    def keys(self, *names: str) -> None:
        for name in names:
            self._speak(KEYS[self._driven][name])
        self._before = len(self._bridge.sent_requests())

    def goto(self, ra: float, dec: float) -> None:
        """Send the mount to a position of date, degrees."""
        if self._driven == "nexstar":
            first, second = (round(degrees % 360.0 / 360.0 * 2**32) % 2**32 for degrees in (ra, dec))
            self._speak(b"r%08X,%08X" % (first, second))
        else:
            seconds, arcseconds = round(ra % 360.0 * 240.0) % 86400, round(abs(dec) * 3600.0)
            sign = b"-" if dec < 0.0 else b"+"
            hours = b"%02d:%02d:%02d" % (seconds // 3600, seconds // 60 % 60, seconds % 60)
            degrees = b"%02d*%02d:%02d" % (arcseconds // 3600, arcseconds // 60 % 60, arcseconds % 60)
            self._speak(b":Sr" + hours + b"#:Sd" + sign + degrees + b"#:MS#")
        self._before = len(self._bridge.sent_requests())

    async def cable_out(self, seconds: float) -> None:
        self.cable.pull()
        await asyncio.sleep(seconds)
        self.cable.out = False
        self._before = len(self._bridge.sent_requests())

    async def power_cycle(self, seconds: float) -> None:
        """Switch off and on: the motors stop, the alignment is lost, and the mount does not reply for a while."""
        sim = self._bridge.sim
        sim.true_position()
        sim.mechanics.stop_goto(sim.now)
        for axis in (1, 2):
            sim.mechanics.move(sim.now, axis, 0.0)
            sim.mechanics.pulse(sim.now, axis, 0.0, 0.0)
        if self._driven == "lx200":
            release_keys(sim)
            sim.lose_alignment()
            sim.power_on()
        else:
            sim.aligned = False
            sim.track(0)
        self.cable.mute = True
        await asyncio.sleep(seconds)
        self.cable.mute = False
        self._before = len(self._bridge.sent_requests())

    def align(self, done: bool) -> None:
        """Begin a new alignment, or complete it."""
        self._bridge.sim.aligned = done
        self._before = len(self._bridge.sent_requests())

    @property
    def since(self) -> list[bytes]:
        return list(self._bridge.sent_requests()[self._before :])

    def begun(self) -> list[bytes]:
        """Return the commands of ``since`` that start a motion or tracking."""
        return [sent for sent in self.since if begins(self._driven, sent)]

    def ended(self) -> list[bytes]:
        """Return the commands of ``since`` that stop a motion."""
        return [sent for sent in self.since if ends(self._driven, sent)]

    def settings(self) -> list[bytes]:
        """Return the commands of ``since`` that change the site, the clock or the alignment."""
        begins = (b"W", b"H", b"I", b"s", b"S") if self._driven == "nexstar" else (b":S", b":CM")
        return [sent for sent in self.since if sent.startswith(begins)]

    @property
    def moving(self) -> bool:
        return truth.moving(self._bridge.sim)


def begins(driven: str, sent: bytes) -> bool:
    """Whether a command starts a motion or tracking."""
    if driven == "lx200":
        return sent.startswith((b":M", b":hP", b":hS", b":hF", b":AA", b":AP", b":hW"))
    if sent[:1] == b"P" and sent[2:3] in (b"\x10", b"\x11"):
        drives = sent[3:4] in (b"\x06", b"\x07", b"\x24", b"\x25", b"\x26") and any(sent[4 : 3 + sent[1]])
        return drives or sent[3:4] in (b"\x02", b"\x17")
    return sent[:1] in (b"r", b"R", b"b", b"B") or (sent[:1] == b"T" and sent != b"T\0")


def ends(driven: str, sent: bytes) -> bool:
    """Whether a command stops a motor."""
    if driven == "lx200":
        return sent.startswith((b":Q", b":AL"))
    stops = sent[:1] == b"P" and sent[2:3] in (b"\x10", b"\x11") and sent[3:4] in (b"\x24", b"\x25") and not sent[4]
    return stops or sent in (b"M", b"T\0")
