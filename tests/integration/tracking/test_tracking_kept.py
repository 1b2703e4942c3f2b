"""Tracking goes on in the mode and at the rate that were asked for, and what is told of both is what the mount does."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.protocols.mechanics.truth import truth_of
from tests.support.cable import Cable
from tests.support.in_process_gateway import Bridge

OPEN = {"lowest": -90.0, "sun": 0.0}
LETTERS = ["lx200gps", "autostar"]
#: Seconds of arc a second that a star drifts in right ascension: 58.0 Hz of 60.164; the Moon goes at 14.685.
RATES = {b":ST58.0#": 15.041 * (1 - 58.0 / 60.164), b":TL#": 15.041 - 14.685}
MOTIONS = {
    "arrow": b":RM#:Mn#", "guide arrow": b":RG#:Me#", "fast arrow": b":RS#:Me#", "both axes": b":RC#:Mn#:Mw#",
    "pulse": b":Mge0500#",
}  # fmt: skip


async def polled(bridge: Any, seconds: int, question: bytes = b":GR#") -> None:
    client = bridge.client("10.0.0.9")
    for _ in range(seconds):
        client.send(question)
        await asyncio.sleep(1.0)


async def drift(bridge: Any) -> float:
    """Arcseconds a second that the tube's direction moves in right ascension, over a quarter of a minute."""
    before, began = bridge.sim.true_position()[0], bridge.clock()
    await asyncio.sleep(15.0)
    return float(wrap180(bridge.sim.true_position()[0] - before) * 3600.0 / (bridge.clock() - began))


def cge_over(mount: str, *, polar: bool = True, tells_altaz: bool = False, **settings: Any) -> Bridge:
    """NexStar programs on a Meade: polar, and in land mode perhaps not telling so."""
    bridge = Bridge(mount, driven="lx200", presented="nexstar", surface="cge", config=OPEN, **settings)
    if "on" not in settings:
        bridge.sim.land_tells_altaz = tells_altaz
        if polar:
            bridge.sim.feed(b":AP#")
    return bridge


# --- a polar Meade --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mount", LETTERS)
@pytest.mark.parametrize(("polar", "tells_altaz"), [(True, False), (True, True), (False, False)])
@pytest.mark.parametrize(
    "between", ["", "t", "J", "tJt", "e", "polled", "reconnected", "goto", "goto t", "arrow", "slept"]
)
async def test_tracking_returns_in_its_previous_mode(mount: str, tells_altaz: bool, polar: bool, between: str) -> None:
    async with cge_over(mount, polar=polar, tells_altaz=tells_altaz) as bridge:
        client, mode = bridge.client(), b"\x02#" if polar else b"\x01#"
        assert await client.ask(b"t") == mode
        assert await client.ask(b"T\0") == b"#"
        await asyncio.sleep(1.0)
        assert bridge.sim.mode_letter == "L"
        if between == "polled":
            await polled(bridge, 20, b"t")
        elif between == "reconnected":
            cable = Cable(bridge)
            cable.pull()
            await asyncio.sleep(3.0)
            cable.plug()
            await polled(bridge, 15, b"E")
        elif between.startswith("goto"):
            await client.ask(b"r55555555,15555555")
            await polled(bridge, 80, b"t" if between.endswith("t") else b"E")
        elif between == "arrow":
            await client.ask(b"P\x02\x10\x24\x05\0\0\0")
            await asyncio.sleep(2.0)
            await client.ask(b"P\x02\x10\x24\0\0\0\0")
            await asyncio.sleep(3.0)
        elif between == "slept":
            client.send(b"x")
            await asyncio.sleep(5.0)
            client.send(b"y")
            await asyncio.sleep(8.0)
        else:
            for letter in between:
                await client.ask(letter.encode())
                await asyncio.sleep(3.0)
        assert await client.ask(b"T\2") == b"#"
        await asyncio.sleep(3.0)
        assert bridge.sim.mode_letter == ("P" if polar else "A")
        assert await client.ask(b"t") == mode
        assert abs(await drift(bridge)) < 0.01


@pytest.mark.parametrize("mount", LETTERS)
async def test_tracking_returns_in_its_previous_mode_after_a_gateway_restart(mount: str, tmp_path: Path) -> None:
    first = cge_over(mount, tells_altaz=True, state=tmp_path)
    async with first:
        await first.client().ask(b"T\0")
        await asyncio.sleep(3.0)
    async with cge_over(mount, on=first, state=tmp_path) as bridge:
        client = bridge.client()
        assert await client.ask(b"t") == b"\0#"
        await client.ask(b"T\2")
        await asyncio.sleep(3.0)
        assert bridge.sim.mode_letter == "P"


@pytest.mark.parametrize("mount", LETTERS)
@pytest.mark.parametrize("again", [b":AP#", b":AA#"])
@pytest.mark.parametrize("between", [b":GW#", b"\x06", b":G0#", b""])
async def test_tracking_returns_in_its_previous_mode_for_lx200_programs(
    mount: str, again: bytes, between: bytes
) -> None:
    async with Bridge(mount, driven="lx200", surface="lx200gps", config=OPEN) as bridge:
        bridge.sim.land_tells_altaz = True
        bridge.sim.feed(b":AP#")
        await polled(bridge, 8, b":GW#")
        client = bridge.client()
        client.send(b":AL#")
        await asyncio.sleep(2.0)
        assert await client.ask(b"\x06") == b"L"
        if between:
            await client.ask(between)
        client.send(again)
        await asyncio.sleep(3.0)
        assert bridge.sim.mode_letter == "P"
        assert await client.ask(b":GW#", ending=b"1") == b"PT1"
        assert await client.ask(b"\x06") == b"P"


async def test_tracking_command_undoes_switching_off_at_the_hand_control() -> None:
    for mount in LETTERS:
        async with cge_over(mount) as bridge:
            client = bridge.client()
            assert await client.ask(b"t") == b"\x02#"
            bridge.sim.feed(b":AL#")
            await client.ask(b"T\2")
            await asyncio.sleep(3.0)
            assert truth_of(bridge.sim).tracking
            assert bridge.sim.mode_letter == "P"


# --- what cannot be done is not told as done ------------------------------------------------------------------------


@pytest.mark.parametrize("mount", ["lx200", "lx200-16"])
async def test_classic_that_cannot_stop_tracking_still_reports_tracking(mount: str) -> None:
    async with cge_over(mount) as bridge:
        client = bridge.client()
        assert await client.ask(b"T\0") == b"#"
        await asyncio.sleep(2.0)
        assert await client.ask(b"t") == b"\x02#"
        assert truth_of(bridge.sim).tracking
    async with Bridge(mount, driven="lx200", surface="lx200gps", config=OPEN) as bridge:
        client = bridge.client()
        assert await client.ask(b":AL#\x06") == b"P"
        assert await client.ask(b":GW#", ending=b"1") == b"PT1"


# --- the rate -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mount", "polar", "rate"),
    [
        ("cge", True, b":TL#"),
        ("cge", True, b":ST58.0#"),
        ("cgx", True, b":ST58.0#"),
        ("avx", True, b":TL#"),
        ("lx200gps", True, b":ST58.0#"),
        ("lx200gps", False, b":TL#"),
        ("autostar", True, b":TL#"),
        ("lx200", True, b":ST58.0#"),
    ],
)
@pytest.mark.parametrize(
    "between", ["off, on", "slept", "goto", "off, goto, on", "goto, stopped", "reconnected", "parked", *MOTIONS]
)
async def test_drive_rate_runs_on_after_any_interruption(mount: str, polar: bool, rate: bytes, between: str) -> None:
    driven = "nexstar" if mount in ("cge", "cgx", "avx") else "lx200"
    more = {"hibernate": True} if driven == "nexstar" else {}
    async with Bridge(mount, driven=driven, surface="lx200gps", config=OPEN | more) as bridge:
        if polar and driven == "lx200":
            bridge.sim.feed(b":AP#")
        await polled(bridge, 8)
        client = bridge.client()
        client.send(rate)
        await polled(bridge, 3)
        before = await drift(bridge)
        assert before == pytest.approx(RATES[rate], abs=0.02)
        if between.startswith("off"):
            client.send(b":AL#")
            await polled(bridge, 4)
        if "goto" in between:
            await client.ask(b":Sr08:00:00#:Sd+20*00:00#:MS#", ending=b"0")
            await polled(bridge, 3 if between.endswith("stopped") else 40)
        if between.endswith("stopped"):
            client.send(b":Q#")
        if between.endswith("on"):
            client.send(b":AP#")
        if between == "slept":
            client.send(b":hN#")
            await polled(bridge, 6)
            client.send(b":hW#")
        if between == "parked":
            client.send(b":hP#")
            await polled(bridge, 60)
            client.send(b":I#")
        if between in MOTIONS:
            client.send(MOTIONS[between])
            await polled(bridge, 2)
            client.send(b":Qn#:Qe#:Qw#")
        if between == "reconnected":
            cable = Cable(bridge)
            cable.pull()
            await asyncio.sleep(3.0)
            cable.plug()
        await polled(bridge, 15)
        assert await drift(bridge) == pytest.approx(before, abs=0.02)
        lunar = b"58.7#" if driven == "nexstar" else b"57.9#"  # as its motors turn; a Meade's own number
        assert await client.ask(b":GT#") == (lunar if rate == b":TL#" else b"58.0#")
        assert (await client.ask(b":GW#", ending=b"1"))[1:2] == b"T"


# --- registers ------------------------------------------------------------------------------------------------------


async def test_rates_set_while_the_line_was_down_apply_afterwards() -> None:
    async with Bridge("lx200gps", driven="lx200", surface="lx200gps", config=OPEN) as bridge:
        client, cable = bridge.client(), Cable(bridge)
        cable.pull()
        await asyncio.sleep(2.0)
        assert await client.ask(b":Rg05.0#:Sw3#") == b"1"
        client.send(b":RE01.5#")
        cable.plug()
        await polled(bridge, 15)
        assert bridge.sim.stored_values["Rg"] == pytest.approx(5.0)
        client.send(b":RS#:Mw#")
        await asyncio.sleep(2.0)
        assert abs(truth_of(bridge.sim).rate1) == pytest.approx(3.0, abs=0.1)
        client.send(b":Qw#:RE01.5#:Mn#")
        await asyncio.sleep(2.0)
        assert abs(truth_of(bridge.sim).rate2) == pytest.approx(1.5, abs=0.1)


@pytest.mark.parametrize("off_and_on", [False, True])
async def test_meade_registers_are_sent_anew_after_a_lost_line(off_and_on: bool) -> None:
    """The telescope may have been switched off and on meanwhile, or not."""
    async with Bridge("lx200gps", driven="lx200", surface="lx200gps", config=OPEN) as bridge:
        client, cable = bridge.client(), Cable(bridge)
        await client.ask(b":Rg05.0#:Sw3#")
        client.send(b":RS#:Mw#")
        await asyncio.sleep(2.0)
        client.send(b":Qw#")
        await polled(bridge, 4)
        cable.pull()
        await asyncio.sleep(2.0)
        if off_and_on:
            bridge.sim.power_on()
        cable.plug()
        await polled(bridge, 15)
        await client.ask(b":Sw8#")
        client.send(b":RS#:Mw#")
        await asyncio.sleep(3.0)
        assert abs(truth_of(bridge.sim).rate1) == pytest.approx(8.0, abs=0.1)
        client.send(b":Qw#")
        await polled(bridge, 6)
        client.send(b":Rg15.0#")
        await polled(bridge, 3)
        assert bridge.sim.stored_values["Rg"] == pytest.approx(15.0, abs=0.1)


async def test_lunar_rate_is_not_sent_to_a_fork_that_tracks_in_alt_az_again() -> None:
    async with Bridge("cpc", config=OPEN) as bridge:
        for order in (
            op.SetTracking(on=True, mode=op.Tracking.EQ_NORTH), op.TrackRate(name="lunar"),
            op.SetTracking(on=True, mode=op.Tracking.ALTAZ),
        ):  # fmt: skip
            await bridge.controller.perform(order)
            await asyncio.sleep(5.0)
        assert bridge.sim.feed(b"t") == b"\1#"
        assert abs(await drift(bridge)) < 0.1
