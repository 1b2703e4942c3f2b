"""A gateway between clients and a simulated mount over a faulty line, on virtual time: does it ever report nonsense?

The simulator's own state is the truth: everything that the controller delivers is compared with what the mount could
have reported within the permitted age; while it moves, positions are extrapolated and may be off by as much as it moves
in half a second. It slews, is moved by direction keys and stopped all the time, so that an old reply is a wrong one.
``trial`` is one run; the same seed gives the same run.
"""

from __future__ import annotations

import asyncio
import math
from collections import Counter, deque
from itertools import pairwise
from random import Random
from typing import Any

from msgspec.structs import replace

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from gateway.mount.link.line import MountLink
from gateway.mount.readings.cache import NOT_CACHED
from gateway.protocols.base.driver import Send
from tests.support.faulty_line import FaultyWire, Kind
from tests.support.in_process_gateway import Bridge, RehearsalClient

#: Degrees: the coarsest resolution of a reply, and the error of a garbled one beyond what a slew explains.
RESOLUTION, MARGIN = 0.01, 0.06
#: Seconds: how old a position may be when a client receives it, plus the exchange that fetched it.
AGE, EXCHANGE = 0.5, 0.9
LONGEST_WAIT = 60.0
#: Seconds after which the end or the beginning of a slew must have been reported, whatever was lost meanwhile.
SETTLED = 40.0
#: Seconds between two samples of the truth; between them the mount is at one of them or on the way.
SAMPLED = 0.05
POSITION = {"nexstar": b":GR#", "lx200": b"e"}


def _apart(offsets: list[float]) -> float:
    """Return the smallest distance from zero, which is zero if two neighbours have different signs."""
    if any(one * other <= 0.0 and abs(one - other) < 90.0 for one, other in pairwise(offsets)):
        return 0.0
    return min(map(abs, offsets), default=999.0)


class Trial:
    """One run; ``wrong`` counts errors by kind, ``notes`` describes each in words."""

    def __init__(self, driven: str, model: str, seed: int, rate: float, kinds: tuple[Kind, ...]) -> None:
        presented = "lx200" if driven == "nexstar" else "nexstar"
        self.driven, self.random = driven, Random(seed)
        self.bridge = Bridge(model, driven=driven, presented=presented, surface=None)
        self.sim = self.bridge.sim
        self.exact = Kind.ALTERED not in kinds
        # No serial line and no TCP stream reorders; on a line that does, a stop is not always certain to have arrived.
        self.ordered, self.unsure = Kind.OVERTAKEN not in kinds, 0
        # An overtaken reply agrees with the present state if nothing but the sky has moved since.
        self.resolution = MARGIN if Kind.OVERTAKEN in kinds else RESOLUTION
        self.wire = FaultyWire(self.sim.feed, seed, rate, kinds, self._rebooted, text=driven == "lx200")
        line = self.bridge.controller.line
        line.wire = self.wire
        self.line: MountLink = line
        self.strange: list[Send] = []
        self.acknowledged: list[tuple[Send, bool]] = []
        in_step, exchange = line.is_in_step, line.transaction.exchange

        async def exchanging(ask: Send, **more: Any) -> Any:
            self.wire.strange, self.wire.of_other_command = None, False
            outcome = await exchange(ask, **more)
            if self.wire.strange is not None and not self.wire.proving and not isinstance(outcome, Fault):
                self.strange.append(ask)
            if not isinstance(outcome, Fault):
                self.acknowledged.append((ask, self.wire.of_other_command))
            return outcome

        line.transaction.exchange = exchanging  # type: ignore[method-assign]
        order = self.bridge.controller.verifier._send_change

        async def ordering(ask: Send, priority: int) -> Any:
            done = len(self.acknowledged)
            answer = await order(ask, priority)
            own = [another for other, another in self.acknowledged[done:] if other is ask]
            if own and all(own):
                if self.ordered:
                    self._is_wrong("order", f"{ask.command} was acknowledged by the reply to another command")
                self.unsure += 1
            return answer

        self.bridge.controller.verifier._send_change = ordering  # type: ignore[method-assign]

        async def proving() -> bool:
            self.wire.proving = True
            try:
                return await in_step()
            finally:
                self.wire.proving = False

        line.is_in_step = proving  # type: ignore[method-assign]
        self.bridge.wire_log.sinks.append(self.wire.follow)
        self.trail: deque[tuple[float, float, float]] = deque(maxlen=4000)
        self.wrong: Counter[str] = Counter()
        self.notes: list[str] = []
        self.asked: Counter[str] = Counter()
        self.longest, self.carried = 0.0, 0
        self.identity: Any = None
        self.site: Any = None
        self.rebooted = -1e9
        self.changed = -1e9
        self.slewing_since: float | None = None
        self.said_since, self.said = 0.0, False
        self.still_since: float | None = 0.0
        self._hear()

    def _hear(self) -> None:
        """Sample the truth at every request to the mount."""
        feed = self.sim.feed

        def heard(data: bytes) -> bytes:
            answer = bytes(feed(data))
            self._sample()
            return answer

        self.wire.feed = heard

    def _sample(self) -> None:
        now = asyncio.get_running_loop().time()
        self.trail.append((now, *self._position()))
        slewing = bool(self.sim.slewing)
        self.slewing_since = (now if self.slewing_since is None else self.slewing_since) if slewing else None
        self.still_since = None if slewing else (now if self.still_since is None else self.still_since)

    def _position(self) -> tuple[float, float]:
        self.sim.true_position()
        if self.driven == "lx200":
            return self.sim.position()  # type: ignore[no-any-return]
        from gateway.astro.spherical import fold_declination

        return fold_declination(*self.sim.mechanics.believed_position(self.sim.now))

    def _rebooted(self) -> Any:
        """Power-cycle the mount: it loses its alignment, precision and motion, and keeps its position and clock."""
        self.rebooted = asyncio.get_running_loop().time()
        sim = self.sim
        sim.mechanics.stop_goto(sim.now)
        if self.driven == "lx200":
            sim.high = False
            sim.track(False)
        else:
            sim.aligned = False
            sim.track(0)
        return self.wire.feed

    # --- the clients --------------------------------------------------------------------------------------------------

    async def play(self, exchanges: int) -> None:
        """Let clients work until the line has carried that many exchanges."""
        bridge, wire = self.bridge, self.wire
        rate, wire.rate = wire.rate, 0.0
        async with bridge:
            self.identity = await bridge.controller.read(op.GetIdentity())
            self.site = bridge.site_clock.mount_site
            wire.rate = rate
            tasks = [
                asyncio.ensure_future(work)
                for work in (
                    self._follow(),
                    self._poller(0.25),
                    self._poller(0.6),
                    self._watcher(),
                    self._mover(bridge.client("10.0.0.9")),
                    self._renewer(),
                )
            ]
            while wire.exchanges < exchanges:
                await asyncio.sleep(5.0)
                assert self.line.is_running, "the task of the mount's line has ended"
                for task in tasks:
                    if task.done():
                        task.result()
            self.carried, wire.rate = wire.exchanges, 0.0
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await asyncio.sleep(60.0)  # a line without faults must recover
            if self.line.state != "up" or not await self._request(bridge.client(), POSITION[self.driven], 1):
                self._is_wrong("hang", f"line {self.line.state}: {self.line.down_cause}")

    async def _follow(self) -> None:
        """Sample the truth between requests too: the gateway extrapolates positions."""
        while True:
            self._sample()
            await asyncio.sleep(SAMPLED)

    async def _poller(self, every: float) -> None:
        """A program that displays the position, through the surface."""
        client = self.bridge.client(f"10.0.1.{int(every * 100)}")
        while True:
            if self.driven == "nexstar":
                raw = await self._request(client, b":GR#:GD#", 2)
                if raw.count(b"#") == 2:
                    self._check_position(*_lx200_position(raw), paired=True)
            else:
                raw = await self._request(client, b"e", 1)
                if raw:
                    self._check_position(*_nexstar_position(raw), paired=False)
            await asyncio.sleep(every * self.random.uniform(0.8, 1.2))

    async def _request(self, client: RehearsalClient, data: bytes, replies: int) -> bytes:
        """Send a request and wait; then a command that needs no mount must be answered."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        client.received = b""
        local, echo = (b":Gc#", b"24#") if self.driven == "nexstar" else (b"Kx", b"x#")
        client.send(data + local)
        while not client.received.endswith(echo) and loop.time() - began < LONGEST_WAIT:
            await asyncio.sleep(0.01)
        self.longest = max(self.longest, loop.time() - began)
        self.asked[data.decode("latin-1")[:4]] += 1
        if not client.received.endswith(echo):
            self._is_wrong("hang", f"{data!r} and {local!r}: {client.received!r}")
            return b""
        answer = client.received.removesuffix(echo)
        self.asked["answered" if answer else "silent"] += 1
        return answer

    async def _mover(self, client: RehearsalClient) -> None:
        """A program that slews, moves by direction keys and stops."""
        draw = self.random
        while True:
            what = draw.random()
            if self.driven == "nexstar":
                if what < 0.6:
                    ra, dec = draw.randrange(24), draw.randrange(20, 80)
                    reply = await self._request(client, b":Sr%02d:00:00#:Sd+%02d*00:00#:MS#" % (ra, dec), 3)
                    refused = reply[2:3] in (b"1", b"2") and reply[-1:] == b"#"
                    if reply[:2] != b"11" or not (reply in (b"11", b"110") or refused):  # 11: the mount did not answer
                        self._is_wrong("reply", f"goto: {reply!r}")
                else:
                    client.send(b":RS#:M%c#" % draw.choice(b"nsew"))
                await asyncio.sleep(draw.uniform(0.5, 12.0))
                client.send(b":Q#")
            else:
                if what < 0.6:
                    await self._request(client, b"r%06X00,%06X00" % (draw.randrange(2**24), draw.randrange(2**21)), 1)
                else:
                    client.send(b"P\x02%c%c\x09\x00\x00\x00" % (draw.choice(b"\x10\x11"), draw.choice(b"\x24\x25")))
                await asyncio.sleep(draw.uniform(0.5, 12.0))
                client.send(b"P\x02\x10\x24\x00\x00\x00\x00P\x02\x11\x24\x00\x00\x00\x00M")
            await asyncio.sleep(draw.uniform(0.1, 2.0))

    async def _renewer(self) -> None:
        """Read again what the gateway reads only once: identity, site and clock."""
        controller = self.bridge.controller
        while True:
            await asyncio.sleep(self.random.uniform(5.0, 20.0))
            for operation in (op.GetSite(), op.GetClock(), op.GetIdentity()):
                await controller.identification.read_once(operation)

    async def _watcher(self) -> None:
        """Compare everything else that the controller delivers with the simulator."""
        controller, loop = self.bridge.controller, asyncio.get_running_loop()
        while True:
            await asyncio.sleep(self.random.uniform(0.2, 0.5))
            for operation in (op.GetStatus(), op.Slewing(), op.HorizontalPosition()):
                began = loop.time()
                value = controller.peek(operation)
                try:
                    value = await controller.read(operation) if value is NOT_CACHED else value
                except Fault:
                    continue
                if loop.time() - began > LONGEST_WAIT:
                    self._is_wrong("hang", f"{operation} took {loop.time() - began:.1f} s")
                self._check(operation, value, loop.time())
            self._check_settings(loop.time())

    # --- the truth ----------------------------------------------------------------------------------------------------

    def _is_wrong(self, what: str, words: str) -> None:
        self.wrong[what] += 1
        if len(self.notes) < 20:
            self.notes.append(f"{asyncio.get_running_loop().time():.3f} {what}: {words}")

    def _oldest(self, now: float) -> float:
        """Return the time before which nothing that is reported now may come from."""
        line = self.line
        old = line.state != "up" or self.bridge.controller.reader.gives_last_position  # and the log says so
        allowed = 10.0 if old else max(AGE, 2.5 * line.times.typical_rtt)
        return now - allowed - EXCHANGE

    def _check_position(self, ra: float, dec: float, paired: bool) -> None:
        """Compare a client's position with where the mount was when it may have been read."""
        now = asyncio.get_running_loop().time()
        self._sample()
        self.asked["positions"] += 1
        oldest = self._oldest(now)
        samples = [sample for sample in self.trail if sample[0] >= oldest]
        moved = any(separation(s[1], s[2], *self.trail[-1][1:]) > MARGIN for s in self.trail if s[0] >= oldest - 1.0)
        if self.exact and not moved:  # a moving mount's position is extrapolated, which the line's faults can delay
            off_ra = _apart([wrap180(s[1] - ra) * math.cos(math.radians(dec)) for s in samples])
            off_dec = _apart([s[2] - dec for s in samples])
            low = self.driven == "lx200" and now - self.rebooted < 40.0  # until it is at high precision again
            off, allowed = max(off_ra, off_dec), 0.03 if low else self.resolution
        else:
            off = min((separation(ra, dec, s[1], s[2]) for s in samples), default=999.0)
            allowed = self._fastest() * AGE + MARGIN
        if off > allowed:
            age = next((now - s[0] for s in reversed(self.trail) if separation(ra, dec, s[1], s[2]) < 0.05), None)
            said = f"off by {off:.3f}" + ("" if age is None else f": as it was {age:.1f} s ago")
            self._is_wrong("position", f"{ra:.4f} {dec:.4f} {said}; line {self.line.state}")

    def _fastest(self) -> float:
        return float(self.sim.mechanics.max_rate) * math.sqrt(2.0)

    def _check(self, operation: op.Operation, value: Any, now: float) -> None:
        self.asked[type(operation).__name__] += 1
        if isinstance(operation, op.Slewing):
            self._sample()
            if value != self.said or self.bridge.controller.wanted.goto_pending:  # one that waits counts as under way
                self.said_since, self.said = now, bool(value)
            since = self.still_since if value else self.slewing_since
            if since is not None and min(now - since, now - self.said_since) > SETTLED and self.line.state == "up":
                said, true = now - self.said_since, now - since
                self._is_wrong("slewing", f"said {value} for {said:.1f} s, {not value} for {true:.1f} s")
        elif isinstance(operation, op.GetStatus):
            equatorial = self.sim.german if self.driven == "nexstar" else self.sim.mode_letter == "P"
            old = now - self.rebooted < 30.0
            if not old and (value.aligned != self.sim.aligned or value.equatorial != equatorial):
                self._is_wrong("status", f"{value}, aligned {self.sim.aligned}")
        elif value is not None and -90.0 <= value.alt <= 90.0 and 0.0 <= value.az < 360.0:
            return
        else:
            self._is_wrong("horizon", str(value))

    def _check_settings(self, now: float) -> None:
        site_clock, controller = self.bridge.site_clock, self.bridge.controller
        place = site_clock.mount_site
        if place != self.site:
            self._is_wrong("site", f"{place}, not {self.site}")
        clock = site_clock.present_time(site_clock.mount_clock)
        utc = self.sim.utc() + (self.bridge.clock() - self.sim.now)
        if clock is not None and abs(clock.unix - utc) > 2.7:
            self._is_wrong("clock", f"off by {clock.unix - utc:.1f} s")
        identity = controller.cache.last_value(op.GetIdentity)
        unknown = {self.identity, replace(self.identity, version="?")}  # a version that was asked for and not answered
        if identity is not None and identity not in unknown:
            self._is_wrong("identity", f"{identity}, not {self.identity}")


def _lx200_position(raw: bytes) -> tuple[float, float]:
    ra, dec = raw.split(b"#")[:2]
    hours = [int(part) for part in ra.split(b":")]
    sign = -1.0 if dec[:1] == b"-" else 1.0
    degrees = [int(dec[n : n + 2]) for n in (1, 4, 7)]
    return (
        15.0 * (hours[0] + hours[1] / 60 + hours[2] / 3600),
        sign * (degrees[0] + degrees[1] / 60 + degrees[2] / 3600),
    )


def _nexstar_position(raw: bytes) -> tuple[float, float]:
    ra, dec = (int(part[:6], 16) * 360.0 / 2**24 for part in raw[:17].split(b","))
    return ra, wrap180(dec)


def trial(driven: str, model: str, seed: int, rate: float, kinds: tuple[Kind, ...], exchanges: int) -> Trial:
    """Run one trial on virtual time."""
    made: list[Trial] = []

    async def program() -> None:
        made.append(Trial(driven, model, seed, rate, kinds))
        await made[0].play(exchanges)

    run(program())
    return made[0]
