"""A stop waits for one exchange at most: measured at a mount that hears badly, over lines that lose replies and bytes.

The mount drops what comes while it is busy, and keeps half a command (``tests/support/lossy_line.py``).
"""

from __future__ import annotations

import asyncio
from functools import cache
from itertools import accumulate
from random import Random
from typing import Any, NamedTuple

import pytest

from gateway.astro.spherical import horizon_to_hour_angle
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge
from tests.support.lossy_line import LossyLine, is_stop
from tests.support.sampling import as_a_rule
from tests.support.truth import altitude

#: Seconds that a stop may wait beyond a usual exchange, and until the mount rests although bytes were lost.
WAITS, RESTS = 0.3, 4.0
#: Seconds that motors take to brake.
BRAKES = 1.0
#: Degrees a second: no axis of these mounts tracks faster, also at the Moon's rate, which a SynScan tells as a motion.
TRACKS = 0.0055


class Mount(NamedTuple):
    protocol: str
    model: str
    version: str | None = None
    latency: float = 0.05


MOUNTS = {
    "nexstar-gps/2.2": Mount("nexstar", "nexstar-gps", "2.2"), "cge/4.21": Mount("nexstar", "cge", "4.21"),
    "avx/5.31": Mount("nexstar", "avx", "5.31"), "starsense": Mount("nexstar", "cge-pro", "starsense-1.20"),
    "synscan": Mount("nexstar", "synscan"), "lx200gps": Mount("lx200", "lx200gps"),
    "autostar": Mount("lx200", "autostar"), "classic": Mount("lx200", "lx200", latency=0.5),
    "onstep": Mount("lx200", "onstep"), "teenastro": Mount("lx200", "teenastro"), "alpaca": Mount("alpaca", "german"),
}  # fmt: skip
SERIAL = [name for name, mount in MOUNTS.items() if mount.protocol != "alpaca"]


def bridge_to(name: str, **config: Any) -> Bridge:
    mount = MOUNTS[name]
    settings = {"lowest": -90.0, "sun": 0.0, **config}
    bridge = Bridge(mount.model, mount.version, driven=mount.protocol, latency=mount.latency, config=settings)
    if mount.protocol == "alpaca":
        bridge.controller.line.wire.newest_only = True  # type: ignore[attr-defined]
    return bridge


async def poll(bridge: Bridge, seconds: float) -> None:
    client = bridge.client("10.0.0.9")
    for _ in range(round(seconds * 2)):
        client.send(b":GR#:GD#")
        await asyncio.sleep(0.5)


async def seconds_to_rest(bridge: Bridge, since: float, at_most: float = 12.0) -> float:
    """Return how long after this loop time the true axes were last seen to turn."""
    loop, client, moved = asyncio.get_running_loop(), bridge.client("10.0.0.9"), 0.0
    while loop.time() < since + at_most:
        client.send(b":GR#:GD#")
        await asyncio.sleep(0.05)
        truth = truth_of(bridge.sim)
        if truth.moving and max(abs(truth.rate1), abs(truth.rate2)) > TRACKS:
            moved = loop.time() - since
    return moved


MOTIONS = {"arrow": b":RS#:Me#", "two": b":RS#:Mn#:Mw#", "goto": b":Sr08:00:00#:Sd+30*00:00#:MS#"}


@pytest.mark.parametrize("motion", list(MOTIONS))
@pytest.mark.parametrize("lost", [0, 1, 2, 3])
@pytest.mark.parametrize("name", list(MOUNTS))
@pytest.mark.safety_line(1)
async def test_stop_waits_for_at_most_one_exchange_after_any_loss(name: str, lost: int, motion: str) -> None:
    async with bridge_to(name) as bridge:
        client, loop, pressed = bridge.client(), asyncio.get_running_loop(), list[float]()
        client.send(MOTIONS[motion])
        await poll(bridge, 3.0)
        line = LossyLine(bridge, MOUNTS[name].latency)

        def stop() -> None:
            pressed.append(loop.time())
            client.send(b":Q#")

        stops = [data for _, data in line.heard if is_stop(data)]
        if lost:
            line.lose_replies(lost, lambda: loop.call_later(0.005, stop))
        else:
            stop()
        while not pressed:
            await poll(bridge, 0.5)
        moved = await seconds_to_rest(bridge, pressed[0])
        heard = [at - pressed[0] for at, data in line.heard if is_stop(data) and at >= pressed[0]]
        if not stops or heard:  # the gateway may have stopped a mount that it has not heard for long
            assert heard[0] <= MOUNTS[name].latency + WAITS + 0.01, line.heard
        assert moved <= MOUNTS[name].latency + WAITS + BRAKES + 0.2
        await asyncio.sleep(10.0)
        assert not bridge.controller.wanted.stop_owed


@pytest.mark.parametrize("dead", [1.5, 2.5])
@pytest.mark.parametrize("name", SERIAL)
@pytest.mark.safety_line(1)
async def test_stop_ends_a_motion_soon_after_the_line_works_again(name: str, dead: float) -> None:
    """The mount hears nothing for a while from the stop on: the stop is written again while the line is checked."""
    async with bridge_to(name) as bridge:
        client, loop = bridge.client(), asyncio.get_running_loop()
        client.send(b":RS#:Me#")
        await poll(bridge, 3.0)
        line, since = LossyLine(bridge, MOUNTS[name].latency), loop.time()
        line.lose_bytes(range(100_000))
        loop.call_later(dead, line.lose_bytes, ())
        client.send(b":Q#")
        assert await seconds_to_rest(bridge, since) <= dead + 1.2 + BRAKES
        bridge.entries.clear()  # half a command has no form in the manual


@pytest.mark.parametrize("name", ["classic", "lx200gps"])
@pytest.mark.safety_line(1)
async def test_stop_without_a_reply_is_sent_again_when_the_reply_behind_it_is_late(name: str) -> None:
    """The end of the stop is lost with the beginning of the read behind it, which therefore gets no reply."""
    async with bridge_to(name) as bridge:
        client = bridge.client()
        client.send(b":RS#:Me#")
        await poll(bridge, 3.0)
        line, since = LossyLine(bridge, MOUNTS[name].latency), asyncio.get_running_loop().time()
        line.lose_bytes(range(2, 5))
        client.send(b":Qe#")
        await asyncio.sleep(0.1)
        client.send(b":Q#")
        assert await seconds_to_rest(bridge, since) <= 2.0 * MOUNTS[name].latency + 1.3 + BRAKES
        bridge.entries.clear()  # half a command has no form in the manual


#: What is on the wire when the stop comes, after what.
TRAFFIC = {
    "read": (b":RS#:Me#", b":GR#:GD#"), "second arrow": (b":RS#:Me#", b":RC#:Mn#"), "release": (b":RS#:Me#", b":Qe#"),
    "goto": (b"", b":Sr08:00:00#:Sd+30*00:00#:MS#"), "in a goto": (b":Sr08:00:00#:Sd+30*00:00#:MS#", b":GR#:D#"),
    "site": (b":RS#:Me#", b":St+44*10#:Sg350*30#"), "clock": (b":RS#:Me#", b":SG-01#:SL23:00:10#:SC01/15/26#"),
    "drive rate": (b":RS#:Mn#", b":TL#:TQ#"), "guide rate": (b":RS#:Me#", b":Rg07.5#"), "pulse": (b"", b":Mgn0800#"),
    "park": (b"", b":hP#"),
}  # fmt: skip


def settings_of(bridge: Bridge) -> dict[str, Any]:
    """Return what a program can set on the simulated mount, by truth; clocks to the nearest 4 seconds."""
    sim: Any = bridge.sim
    sky = sim.mechanics.sky
    found = {
        "latitude": round(sky.latitude, 1),
        "longitude": round(sky.longitude, 1),
        "ahead": round(sky.clock_ahead / 4.0),
    }
    for name in ("mode", "settings", "parked"):
        if hasattr(sim, name):
            value = getattr(sim, name)
            found[name] = repr(sorted(value.items()) if isinstance(value, dict) else value)
    return found


class Interrupted(NamedTuple):
    """A stop amid traffic of which bytes are lost: ``places`` count them from its first, ``after`` seconds."""

    mount: str
    traffic: str
    places: range
    after: float
    keeps_half: bool


def interrupted(number: int) -> Interrupted:
    by = Random(f"stop {number}")
    first = by.randrange(by.choice((8, 20, 60)))
    return Interrupted(
        by.choice(SERIAL),
        by.choice(list(TRAFFIC)),
        range(first, first + by.choice((1, 1, 2, 3))),
        by.choice((0.0, 0.01, 0.1, by.uniform(0.0, 0.6), by.uniform(0.0, 4.0))),
        by.random() < 0.5,
    )


async def play(case: Interrupted, stop: bool = True) -> tuple[float, bool, dict[str, Any], dict[str, Any]]:
    """Return when the mount came to rest, whether it slews 12 s later, and its settings before and after."""
    async with bridge_to(case.mount) as bridge:
        client = bridge.client()
        before, traffic = TRAFFIC[case.traffic]
        was = settings_of(bridge)
        if case.places:
            client.send(before)
        await poll(bridge, 3.0)
        line = LossyLine(bridge, MOUNTS[case.mount].latency, case.keeps_half)
        line.lose_bytes(case.places)
        bridge.client("10.0.0.9").send(traffic)
        await asyncio.sleep(case.after)
        since = asyncio.get_running_loop().time()
        if stop:
            client.send(b":Q#")
        moved = await seconds_to_rest(bridge, since)
        after = settings_of(bridge)
        bridge.entries.clear()  # half a command has no form in the manual
        return moved, bridge.sim.slewing, was, after


@cache
def asked_for(mount: str, traffic: str) -> dict[str, Any]:
    """Return the settings that a program asks for: those of a mount at rest, on a good line."""
    return run(play(Interrupted(mount, traffic, range(0), 0.0, True), stop=False))[3]


@pytest.mark.parametrize("number", range(as_a_rule(40, whole=400)))
@pytest.mark.safety_line(1)
def test_stop_ends_all_motion_though_bytes_of_the_previous_request_were_lost(number: int) -> None:
    case = interrupted(number)
    moved, slews, was, now = run(play(case))
    assert moved <= RESTS, case
    assert not slews, case
    asked = asked_for(case.mount, case.traffic)
    wrong = {name: (now[name], was[name], asked[name]) for name in was if now[name] not in (was[name], asked[name])}
    if wrong:
        alone = run(play(case, stop=False))[3]
        assert not [name for name in wrong if alone[name] in (was[name], asked[name])], (case, wrong)


async def set_with_loss(name: str, traffic: bytes, place: int | None) -> tuple[dict[str, Any], list[int]]:
    """Return the settings of a mount 20 s after a program has set something, of which the byte at ``place`` was lost,
    and the place of a byte in each word of the setting.
    """
    async with bridge_to(name) as bridge:
        await poll(bridge, 2.0)
        line = LossyLine(bridge, MOUNTS[name].latency)
        line.lose_bytes(() if place is None else (place,))
        bridge.client().send(traffic)
        await poll(bridge, 20.0)
        ends = accumulate(len(data) for _, data in line.heard)
        words = [end - 5 for end, (_, data) in zip(ends, line.heard, strict=True) if data.startswith(b":S")]
        bridge.entries.clear()  # half a command has no form in the manual
        return settings_of(bridge), words


@pytest.mark.parametrize("traffic", ["site", "clock"])
@pytest.mark.parametrize("name", ["lx200gps", "autostar", "classic", "onstep", "teenastro"])
def test_site_or_clock_is_set_though_one_of_its_bytes_was_lost(name: str, traffic: str) -> None:
    """A word with a missing digit is refused, or taken for another value: else the clock is an hour off."""
    said = TRAFFIC[traffic][1]
    asked, places = run(set_with_loss(name, said, None))
    assert places
    for place in places:
        now = run(set_with_loss(name, said, place))[0]
        assert now == {**asked, "ahead": pytest.approx(asked["ahead"], abs=1)}, place


@pytest.mark.parametrize("lost", [1, 2, 3])
@pytest.mark.parametrize("name", ["lx200gps", "cge/4.21", "synscan", "onstep", "alpaca"])
@pytest.mark.safety_line(1)
async def test_limit_ends_a_motion_in_time_though_replies_were_lost(name: str, lost: int) -> None:
    """An arrow leads down from 32 degrees, and lowest is 10: what is lost is lost at 18."""
    async with bridge_to(name, lowest=10.0) as bridge:
        client, ask, sky = bridge.client(), bridge.controller.perform, bridge.sim.mechanics.sky
        hour_angle, dec = horizon_to_hour_angle(180.0, 32.0, sky.latitude)
        await ask(op.Goto((sky.lst(bridge.clock()) - hour_angle) % 360.0, dec))
        while await ask(op.Slewing()):
            await poll(bridge, 0.5)
        await asyncio.sleep(2.0)
        line, low, armed = LossyLine(bridge, MOUNTS[name].latency), 90.0, False
        client.send(b":RS#:Ms#")
        for tenth in range(250):
            await asyncio.sleep(0.1)
            client.send(b":GR#:GD#" if tenth % 5 == 0 else b"")
            low = min(low, altitude(bridge.sim))
            if low < 18.0 and not armed:
                armed = True
                line.lose_replies(lost, lambda: None)
        assert armed and low > 10.0 - 0.5


@pytest.mark.parametrize("name", ["cge/4.21", "autostar", "onstep"])
async def test_flood_of_stops_does_not_keep_the_line_down(name: str) -> None:
    """What is written serves them all, so the checks of the line are answered between two writings."""
    async with bridge_to(name) as bridge:
        client = bridge.client()
        client.send(b":RS#:Me#")
        await poll(bridge, 3.0)
        line = LossyLine(bridge, MOUNTS[name].latency)
        line.lose_replies(1_000_000, lambda: None)
        await poll(bridge, 12.0)
        assert bridge.controller.line.state == "down"
        line.lose_replies(0, lambda: None)
        for _ in range(500):
            client.send(b":Q#")
            await asyncio.sleep(0.02)
        assert bridge.controller.line.usable
        await asyncio.sleep(4.0)
        assert not bridge.controller.wanted.stop_owed
        assert await client.ask(b":GD#", ending=b"#")


@pytest.mark.parametrize("name", ["cge/4.21", "autostar", "onstep"])
async def test_stop_is_written_until_a_mute_mount_hears_it(name: str) -> None:
    """It hears nothing for ten seconds, and says nothing after that."""
    async with bridge_to(name) as bridge:
        client, wire = bridge.client(), bridge.controller.line.wire
        client.send(b":RS#:Me#")
        await poll(bridge, 3.0)
        hear = wire.feed  # type: ignore[attr-defined]
        wire.feed = lambda data: b""  # type: ignore[attr-defined]
        client.send(b":Q#")
        await asyncio.sleep(10.0)
        wire.feed = lambda data: hear(data) and b""  # type: ignore[attr-defined]
        await asyncio.sleep(8.0)
        assert not truth_of(bridge.sim).moving
