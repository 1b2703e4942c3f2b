"""Corrupted replies into both drivers, through link, driver and controller, on virtual time.

A simulated mount replies to every request, and its replies are corrupted: changed, cut, repeated, replaced by noise,
by NAKs, by endless text, delayed, or lost; meanwhile operations of every kind are performed, with values at their
limits, several at a time. Every one must end, with a value of its own type and range or with a Fault; nothing may grow;
and once the replies are right again the gateway must understand the mount again.
"""

from __future__ import annotations

import asyncio
import math
from collections import Counter
from collections.abc import Callable
from random import Random
from typing import Any

import msgspec

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.core.wire_log import Entry
from gateway.protocols.wireformat.command_set import load
from gateway.transport.wires import OnData, OnLost
from tests.support.fuzz_bytes import flawed
from tests.support.fuzz_forms import PROTOCOLS, of_request
from tests.support.in_process_gateway import Bridge

#: Virtual seconds: the limit for an operation to end, and for the gateway to recover once the replies are right again.
LONGEST, RECOVERED = 900.0, 90.0
MANNERS = ("true", "flawed", "noise", "nak", "endless", "length", "silent", "late", "unasked", "hash", "foreign")


class CorruptingTransport:
    """A transport to a simulated mount that corrupts replies. ``manner`` says how; None draws one for every reply."""

    name = "corrupting"

    def __init__(self, feed: Callable[[bytes], bytes], rng: Random) -> None:
        self.feed, self.rng = feed, rng
        self.manner: str | None = "true"
        self.told = 0
        self.broken: list[str] = []
        self._earlier: list[bytes] = [b"12:34:56#"]
        self._on_data: OnData = lambda data: None

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        self._on_data = on_data

    def write(self, data: bytes) -> None:
        """Reply to a request in this manner."""
        try:
            answer = self.feed(data)
        except Exception as error:
            self.broken.append(f"the simulator at {data!r}: {error!r}")
            answer = b""
        rng, loop, at = self.rng, asyncio.get_running_loop(), 0.01
        manner = self.manner or rng.choices(MANNERS, [12, 12, 3, 1, 0.2, 3, 0.3, 1, 1, 1, 3])[0]
        spoilt = self._spoil(manner, answer)
        if answer:
            self._earlier = [*self._earlier[-20:], answer]
        size = len(spoilt) or 1 if self.manner == "true" else rng.choice([1, 2, 5, 300])
        for start in range(0, len(spoilt), size):
            loop.call_later(at, self._tell, spoilt[start : start + size])
            at += 0.0 if self.manner == "true" else rng.choice([0.0, 0.0, 0.001, 0.05])

    def _tell(self, data: bytes) -> None:
        self.told += len(data)
        self._on_data(data)

    def _spoil(self, manner: str, answer: bytes) -> bytes:
        rng = self.rng
        if manner == "flawed":
            return flawed(rng, answer)
        if manner == "noise":
            return rng.randbytes(rng.randrange(30))
        if manner == "nak":
            return b"\x15" * rng.randint(1, 3)
        if manner == "endless":
            return bytes(rng.choices(b"0123456789ABCDEF+-:*. \xdf", k=rng.choice([70, 5000])))
        if manner == "length":
            return answer[: rng.randrange(len(answer) + 1)] if rng.random() < 0.5 else answer + rng.randbytes(3)
        if manner == "late":
            asyncio.get_running_loop().call_later(rng.choice([1.0, 4.0, 20.0]), self._tell, answer)
            return b""
        if manner == "unasked":
            return answer + rng.choice(self._earlier)
        if manner == "hash":
            return rng.choice([b"#", answer + b"#", b"#" + answer, b"\0" * len(answer), b"\xff" * len(answer)])
        if manner == "foreign":
            return rng.choice(self._earlier)
        return answer if manner == "true" else b""

    async def close(self) -> None:
        self._on_data = lambda data: None


# --- operations, and how they may end ---------------------------------------------------------------------------------

_FIELDS: dict[str, list[Any]] = {
    "ra": [0.0, 359.9999999, 180.0, 12.3, 83.6], "dec": [90.0, -90.0, 0.0, 89.9999, 22.0, -33.3],
    "az": [0.0, 359.9999, 180.0], "alt": [0.0, 90.0, -5.0, 45.0], "lowest": [None, 0.0, 30.0],
    "highest": [None, 90.0, 60.0], "track": [True, False], "latitude": [None, 90.0, -90.0, 0.0, 45.5],
    "longitude": [None, 180.0, -179.999, 0.0, 10.0], "direction": list(op.Direction), "axis": [1, 2], "sense": [1, -1],
    "ms": [0, 1, 500, 9999, 60000], "on": [True, False], "mode": [None, *op.Tracking],
    "code": [None, 0, 3],
    "unix": [0.0, 946684800.0, 1768514400.5, 2524608000.0, 4102444799.0, 4294967296.0],
    "dst": [None, 0, 1], "offset": [0.0, -12.0, 14.0, 5.75, -3.5],
    "value": [0, 99, 5], "speed": [1, 4], "rate": [0.0, 0.5, 1.0],
    "heard": [True, False], "sky": [True, False], "fastest": [None, 0.5, 3.0],
    "others": [None, None, (), (op.SetSite(0.0, 10.0), op.SetSite(None, 180.0))],
}  # fmt: skip
_RATES = [op.Rate(name="guide"), op.Rate(name="max"), op.Rate(key=1), op.Rate(key=9), op.Rate(degrees=0.0001),
          op.Rate(degrees=2.0), op.Rate(degrees=99.0), op.Rate(name="max", degrees=4.0)]  # fmt: skip
#: Operations for a mount of the surface's own protocol, which need a command of it.
FOR_ITS_KIND = (op.PassThrough, op.NativeRequest, op.Choose)
KINDS = [kind for name in sorted(vars(op)) if (kind := op.operation_class(name)) and kind not in FOR_ITS_KIND]


def any_operation(rng: Random) -> op.Operation:
    """Return an operation of any kind, with fields at their limits; half of the time a read."""
    reads = [kind for kind in KINDS if issubclass(kind, op.Read)]
    kind = rng.choice(reads if rng.random() < 0.5 else KINDS)
    fields: dict[str, Any] = {}
    for field in msgspec.structs.fields(kind):
        if field.name == "rate" and kind in (op.Move, op.MoveAxis):
            fields["rate"] = rng.choice(_RATES)
        elif kind is op.Focus and field.name == "direction":
            fields["direction"] = rng.choice([-1, 0, 1])
        elif kind is op.PlanetPlace:
            fields["name"] = rng.choice(["Mars", "Jupiter"])
        elif kind is op.TrackRate:
            fields = rng.choice([{"name": "solar"}, {"name": "sidereal"}, {"factor": 0.7}])
        else:
            fields[field.name] = rng.choice(_FIELDS[field.name])
    return kind(**fields)


def _between(value: Any, low: float, high: float) -> bool:
    return isinstance(value, float | int) and math.isfinite(value) and low <= value <= high


def _equatorial(value: Any) -> bool:
    return isinstance(value, op.Equatorial) and _between(value.ra, 0, 359.99999999999) and _between(value.dec, -90, 90)


def _horizontal(value: Any) -> bool:
    return isinstance(value, op.Horizontal) and _between(value.az, 0, 360) and _between(value.alt, -90, 90)


_RIGHT: dict[type[op.Operation], Callable[[Any], bool]] = {
    op.Position: _equatorial, op.ToEquinoxOfDate: _equatorial, op.ToJ2000: _equatorial, op.Zenith: _equatorial,
    op.PlanetPlace: _equatorial, op.MoonPlace: _equatorial, op.HorizontalPosition: _horizontal,
    op.AxisPosition: lambda value: isinstance(value, op.Horizontal) and _between(value.az, 0, 360)
    and _between(value.alt, -180, 180),
    op.Slewing: lambda value: isinstance(value, bool),
    op.GetStatus: lambda value: isinstance(value, op.Status) and isinstance(value.tracking, op.Tracking),
    op.GetIdentity: lambda value: isinstance(value, op.Identity),
    op.GetGps: lambda value: isinstance(value, op.Gps),
    op.GetSite: lambda value: isinstance(value, op.Place) and _between(value.latitude, -90, 90)
    and _between(value.longitude, -180, 180),
    op.GetClock: lambda value: isinstance(value, op.Moment) and _between(value.unix, -63e9, 253e9)
    and _between(value.offset, -32, 32),
    op.SiderealTime: lambda value: _between(value, 0, 359.99999999999),
    op.PierSide: lambda value: value in ("E", "W"),
    op.GuideRate: lambda value: _between(value, 0, 1),
    op.DriveRate: lambda value: _between(value, 0.5, 2),
    op.HomeState: lambda value: value in (0, 1, 2),
    op.TubeSide: lambda value: value in ("E", "W"),
    op.GetActivity: lambda value: isinstance(value, op.Activity),
    op.GetAbilities: lambda value: isinstance(value, op.Abilities)
    and all(_between(low, 0, 20) and low <= high for low, high in value.speeds),
    op.Pulse: lambda value: value is None or isinstance(value, op.Pulsed),
    op.PulseAxis: lambda value: value is None or isinstance(value, op.Pulsed),
}  # fmt: skip


class Findings:
    """Counts of what must not happen; prints the first of each kind with its circumstances."""

    def __init__(self) -> None:
        self.found: Counter[str] = Counter()
        self.ended: Counter[str] = Counter()
        self.slowest: dict[str, float] = {}
        self.requests = 0

    def say(self, what: str, about: str = "") -> None:
        if not self.found[what]:
            print(f"FOUND {what}: {about[:600]}", flush=True)
        self.found[what] += 1


async def ask(bridge: Bridge, operation: op.Operation, findings: Findings, label: str) -> None:
    """Perform an operation, and judge how it ends."""
    loop, kind = asyncio.get_running_loop(), type(operation)
    began = loop.time()
    try:
        async with asyncio.timeout(LONGEST):
            value = await bridge.controller.perform(operation)
        right = _RIGHT.get(kind, lambda value: value is None or isinstance(value, dict | bool))
        if not right(value):
            findings.say(f"{label}: {kind.__name__} -> {type(value).__name__} out of range", f"{operation}: {value!r}")
        findings.ended["value"] += 1
    except Fault as fault:
        findings.ended[type(fault).__name__] += 1
        if "nternal error" in str(fault):
            findings.say(f"{label}: {kind.__name__}: {fault}", str(operation))
    except TimeoutError:
        findings.say(f"{label}: {kind.__name__} does not end", str(operation))
    except Exception as error:
        findings.say(f"{label}: {kind.__name__}: {error!r}", str(operation))
    findings.slowest[kind.__name__] = max(findings.slowest.get(kind.__name__, 0.0), loop.time() - began)


async def corrupt(driven: str, mount: str, rng: Random, size: int, findings: Findings) -> int:
    """Send this many reply bytes to one gateway; return how many there were."""
    label = f"{driven}:{mount}"
    asyncio.get_running_loop().set_exception_handler(
        lambda _, context: findings.say(f"{driven}: unhandled: {context.get('exception') or context['message']!r}",
                                        f"{label} {context!r}"))  # fmt: skip
    bridge = Bridge(mount, driven=driven, latency=0.0)
    bridge.wire_log.sinks[:] = [lambda entry: _hear(entry, driven, findings)]
    transport = CorruptingTransport(bridge.sim.feed, rng)
    bridge.controller.line.wire = transport  # type: ignore[assignment]
    if rng.random() < 0.3:
        transport.manner = None
    bridge.controller.start()
    try:
        async with asyncio.timeout(120.0):
            await bridge.controller.site_read.wait()
    except TimeoutError:
        findings.ended["never identified"] += 1
    transport.manner = None
    loop = asyncio.get_running_loop()
    end = loop.time() + size  # a gateway that polls receives more than a byte a second
    while transport.told < size:
        if loop.time() > end:
            findings.say(f"{driven}: the gateway sends nothing more", f"{label}: line {bridge.controller.line.state}")
            break
        if rng.random() < 0.1:
            transport.manner = rng.choice([None, None, *MANNERS])
        await asyncio.gather(*(ask(bridge, any_operation(rng), findings, driven) for _ in range(rng.choice([1, 1, 4]))))
        await asyncio.sleep(rng.choice([0.0, 0.3, 5.0]))
        _weigh(bridge, findings, driven)
    transport.manner = "true"
    bridge.sim.asleep = False  # as if a person had pressed a key
    for broken in transport.broken:
        findings.say(f"{driven}: {broken.partition(':')[2]}", broken)
    await _recover(bridge, findings, label)
    await bridge.controller.close()
    return transport.told


async def _recover(bridge: Bridge, findings: Findings, label: str) -> None:
    """Check that the gateway understands the mount again now that its replies are right."""
    try:
        async with asyncio.timeout(RECOVERED):
            while True:
                try:
                    await bridge.controller.read(op.Position())
                    return
                except Fault:
                    await asyncio.sleep(1.0)
    except TimeoutError:
        line, known = bridge.controller.line, bridge.controller.identified.is_set()
        findings.say(f"{label.partition(':')[0]}: does not recover",
                     f"{label}, line {line.state} {line.down_cause!r}, identified {known}")  # fmt: skip


def _hear(entry: Entry, driven: str, findings: Findings) -> None:
    """Check what the wire log says; used as its sink."""
    if entry.arrow == "!" and "internal error" in entry.note:
        findings.say(f"{driven}: {entry.note}")
    if entry.side == "mount" and entry.arrow == ">":
        findings.requests += 1
        if verdict := of_request(PROTOCOLS[driven], entry.data):
            findings.say(f"{driven}: {verdict}")


def _weigh(bridge: Bridge, findings: Findings, driven: str) -> None:
    """Check that nothing has grown that may not grow."""
    controller, driver = bridge.controller, bridge.driver
    held = sum(len(value) for value in vars(driver).values() if isinstance(value, dict | list | set | str | bytes))
    for what, size, most in (
        ("buffer", len(controller.line.transaction._buffer), 4096), ("queue", len(controller.line.queue), 200),
        ("tasks", len(controller.context.tasks), 200),
        ("jobs", len(controller.wanted.value.pending), 200), ("driver", held - len(driver.handlers), 200),
        ("urgent", len(controller.line.queue._urgent_times), 200),
    ):  # fmt: skip
        if size > most:
            findings.say(f"{driven}: {what} has grown", f"{size}, at most {most}")


def mounts() -> list[tuple[str, str]]:
    """Return every kind of mount that can be driven, alternating between the protocols."""
    meades = [("lx200", model) for model in load("lx200").models]
    hands = [("nexstar", model) for model in load("nexstar").models]
    return [pair for n, hand in enumerate(hands) for pair in (meades[n % len(meades)], hand)]
