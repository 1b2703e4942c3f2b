"""What a mount could not hear when it was set is told later, or reads tell the old value again and the log says why."""

from __future__ import annotations

import asyncio
import calendar
from datetime import UTC, datetime
from typing import Any

import pytest

from gateway.astro.axes import Observer
from tests.support.cable import Cable, lose_commands, lose_replies
from tests.support.in_process_gateway import Bridge

CLASSICS = ["lx200", "lx200-16"]
MEADES = [*CLASSICS, "autostar", "lx200gps"]
#: 33 degrees 51' 30" S, 151 degrees 12' 36" E.
SYDNEY = b"W\x21\x33\x1e\x01\x97\x0c\x24\x00"
#: 20:30:40 on 14 March 2027, 10 hours east, no daylight saving.
MARCH = b"H\x14\x1e\x28\x03\x0e\x1b\x0a\x00"


def unix(text: str) -> float:
    return float(calendar.timegm(datetime.fromisoformat(text).timetuple()))


def utc(bridge: Any) -> float:
    """What the mount's own clock shows now, Unix seconds."""
    bridge.sim.true_position()  # what is due by now has happened
    return float(bridge.sim.utc())


def notes(bridge: Any) -> str:
    return "\n".join(entry.note for entry in bridge.entries if entry.note)


def nexstar_to(mount: str, **settings: Any) -> Bridge:
    return Bridge(
        mount, driven="lx200", presented="nexstar", surface="cge", config={"lowest": -90.0, "sun": 0.0}, **settings
    )


async def plugged_in(bridge: Any, cable: Cable) -> None:
    """Until the line is up again, and what follows has been done; programs poll meanwhile."""
    cable.plug()
    client = bridge.client("10.0.0.9")
    for _ in range(25):
        client.send(b":GR#")
        await asyncio.sleep(1.0)


# --- a classic calculates its planets -----------------------------------------------------------------------------


@pytest.mark.parametrize("mount", CLASSICS)
@pytest.mark.parametrize("gap", [0.0, 0.02, 0.3, 2.0, 4.9])
async def test_site_set_while_a_classic_calculates_is_sent_whole_afterwards(mount: str, gap: float) -> None:
    async with nexstar_to(mount) as bridge:
        client = bridge.client()
        assert await client.ask(MARCH) == b"#"
        set_at = bridge.clock()
        await asyncio.sleep(gap)
        assert await client.ask(SYDNEY) == b"#"
        assert (await client.ask(b"w"))[:8] == SYDNEY[1:]  # at once
        await asyncio.sleep(30.0)
        latitude, longitude = bridge.sim.site
        assert latitude == pytest.approx(-33.8583, abs=0.01)
        assert longitude == pytest.approx(151.21, abs=0.01)
        elapsed = bridge.clock() - set_at
        assert utc(bridge) - elapsed == pytest.approx(unix("2027-03-14 10:30:40"), abs=2.0)
        assert sum(one.startswith(b":SC") for one in bridge.sent_requests()) == 1


@pytest.mark.parametrize("mount", CLASSICS)
@pytest.mark.parametrize("gap", [0.0, 1.5])
async def test_date_year_and_time_set_in_sequence_all_reach_the_mount(mount: str, gap: float) -> None:
    async with nexstar_to(mount) as bridge:
        client = bridge.client()
        for command in (
            b"P\x03\xb2\x83\x03\x0e\x00\x00",
            b"P\x03\xb2\x84\x07\xeb\x00\x00",
            b"P\x04\xb2\xb3\x14\x1e\x28\x00",
        ):
            assert await client.ask(command) == b"#"
            set_at = bridge.clock()
            await asyncio.sleep(gap)
        await asyncio.sleep(40.0)
        assert utc(bridge) - (bridge.clock() - set_at) == pytest.approx(unix("2027-03-14 20:30:40"), abs=2.0)


@pytest.mark.parametrize("mount", CLASSICS)
async def test_second_of_two_times_reaches_the_mount(mount: str) -> None:
    async with nexstar_to(mount) as bridge:
        client = bridge.client()
        await client.ask(MARCH)
        await asyncio.sleep(1.0)
        await client.ask(b"H\x15\x00\x00\x04\x01\x1b\x01\x00")  # 21:00:00 on 1 April 2027, one hour east
        set_at = bridge.clock()
        await asyncio.sleep(30.0)
        assert utc(bridge) - (bridge.clock() - set_at) == pytest.approx(unix("2027-04-01 20:00:00"), abs=2.0)
        assert (await client.ask(b"h"))[:2] == b"\x15\x00"


# --- the line is down ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mount", "driven"), [("6-8se", "nexstar"), ("cge", "nexstar"), *((mount, "lx200") for mount in MEADES)]
)
async def test_settings_made_while_the_line_is_down_are_sent_when_it_is_back(mount: str, driven: str) -> None:
    async with Bridge(mount, driven=driven, aligned=driven == "lx200", surface="autostar") as bridge:
        client, cable = bridge.client(), Cable(bridge)
        cable.pull()
        await asyncio.sleep(3.0)
        assert (await client.ask(b":SG+05#:SL20:00:00#:SC03/14/27#", 0.5, ending=b"!")).startswith(b"111Upd")
        set_at = bridge.clock()
        assert await client.ask(b":Sg074*30#:St+40*45#", ending=b"11") == b"11"
        assert await client.ask(b":GG#") == b"+05#"
        await asyncio.sleep(9.0)
        assert await client.ask(b":Gt#", 1.0) == b"+40*45#"
        await plugged_in(bridge, cable)
        where = bridge.sim.site if driven == "lx200" else bridge.sim.mechanics.sky[:2]
        assert where == pytest.approx((40.75, -74.5), abs=0.01)
        assert utc(bridge) - (bridge.clock() - set_at) == pytest.approx(unix("2027-03-15 01:00:00"), abs=2.0)
        assert await client.ask(b":Gg#") == b"+074*30#"
        assert "it is sent later" in notes(bridge)


async def test_settings_made_while_the_line_is_down_are_not_sent_to_another_mount() -> None:
    async with Bridge("cge", aligned=False, surface="autostar") as bridge:
        client, cable = bridge.client(), Cable(bridge)
        await client.ask(b":GR#")
        cable.pull()
        await asyncio.sleep(3.0)
        assert await client.ask(b":Sg074*30#:St+40*45#", ending=b"11") == b"11"
        bridge.sim.facts = {**bridge.sim.facts, "id": 20}
        sent = len(bridge.sent_requests())
        await plugged_in(bridge, cable)
        assert not [data for data in bridge.sent_requests()[sent:] if data.startswith(b"W")]
        assert "another mount is on the line" in notes(bridge)


async def test_failure_of_an_older_site_leaves_the_newer_one_in_force() -> None:
    """The newer one comes while the last attempt at the older one is unanswered."""
    async with Bridge("autostar", driven="lx200", surface="autostar", latency=0.05) as bridge:
        client = bridge.client()
        await asyncio.sleep(8.0)
        lost = lose_commands(bridge, (b":St",), 3)
        await client.ask(b":Sg074*30#:St+40*45#")
        for moment in range(60):
            bridge.client("10.0.0.9").send(b":GR#")
            if moment == 25:
                await client.ask(b":St+41*15#")
            elif moment > 25:
                assert await client.ask(b":Gt#", 1.0) == b"+41*15#"
            await asyncio.sleep(0.5)
        assert len(lost) == 3


async def test_goto_is_never_deferred_until_the_line_is_back() -> None:
    for mount, driven in (("cpc", "nexstar"), ("lx200", "lx200"), ("lx200gps", "lx200")):
        async with Bridge(mount, driven=driven, config={"lowest": -90.0, "sun": 0.0}) as bridge:
            client, cable = bridge.client(), Cable(bridge)
            cable.pull()
            await asyncio.sleep(1.0)
            began = bridge.clock()
            assert await client.ask(b":Sr08:00:00#:Sd+30*00:00#:MS#", ending=b".#") == b"111No answer from mount.#"
            client.send(b":Me#")
            assert bridge.clock() - began < 0.1
            before = len(bridge.sent_requests())
            await plugged_in(bridge, cable)
            assert not [
                one for one in bridge.sent_requests()[before:] if one[:1] in b"rR" or one[:2] in (b":M", b"P\2")
            ]


@pytest.mark.parametrize(
    ("aligned", "has", "told", "words"),
    [
        (False, (50.0, 20.0), b"+50*00#", "the site was changed at the mount"),
        (True, (45.0, 10.0), b"+40*45#", "site that was set is stored"),
    ],
)
async def test_deferred_settings_are_dropped_if_the_mount_was_set_or_aligned_at_its_keys(
    aligned: bool, has: tuple[float, float], told: bytes, words: str
) -> None:
    async with Bridge("6-8se", aligned=False, surface="autostar") as bridge:
        client, cable = bridge.client(), Cable(bridge)
        cable.pull()
        await asyncio.sleep(2.0)
        await client.ask(b":Sg074*30#:St+40*45#", ending=b"11")
        if aligned:
            bridge.sim.aligned = True
        else:
            bridge.sim.relocate(Observer(*has, bridge.sim.mechanics.sky.clock_ahead))
        await plugged_in(bridge, cable)
        assert bridge.sim.mechanics.sky[:2] == has
        assert await client.ask(b":Gt#") == told
        assert words in notes(bridge)


# --- single commands are lost -------------------------------------------------------------------------------------


@pytest.mark.parametrize("lost", [b":St", b":Sg", b":SG", b":SL", b":SC"])
@pytest.mark.parametrize("mount", ["lx200", "lx200gps"])
@pytest.mark.parametrize("heard", [False, True])
async def test_setting_lost_on_the_line_is_sent_again(mount: str, lost: bytes, heard: bool) -> None:
    async with nexstar_to(mount) as bridge:
        missed = (lose_replies if heard else lose_commands)(bridge, (lost,), 1)
        client = bridge.client()
        await client.ask(SYDNEY)
        await client.ask(MARCH)
        set_at = bridge.clock()
        for _ in range(40):
            client.send(b"E")
            await asyncio.sleep(1.0)
        assert missed
        assert bridge.sim.site == pytest.approx((-33.8583, 151.21), abs=0.01)
        assert utc(bridge) - (bridge.clock() - set_at) == pytest.approx(unix("2027-03-14 10:30:40"), abs=2.0)
        assert "changed at the mount" not in notes(bridge)


@pytest.mark.parametrize("command", [b":SC", b":St"])
async def test_reads_report_the_mounts_value_after_three_failed_settings(command: bytes) -> None:
    async with nexstar_to("lx200") as bridge:
        missed = lose_commands(bridge, (command,), 100)
        client = bridge.client()
        await client.ask(SYDNEY)
        await client.ask(MARCH)
        for _ in range(90):
            client.send(b"E")
            await asyncio.sleep(1.0)
        assert len(missed) == 3
        assert "it is not in force: No answer" in notes(bridge)
        shown = await client.ask(b"h" if command == b":SC" else b"w")
        if command == b":St":
            assert shown[:2] == b"\x2d\x00"  # 45 degrees north
        else:
            assert shown[5:6] == b"\x1a"  # the year is 2026


async def test_setting_with_a_lost_acknowledgement_is_not_sent_twice() -> None:
    async with Bridge("6-8se", aligned=False, presented="nexstar", surface=None) as bridge:
        lose_replies(bridge, (b"W",), 1)
        client = bridge.client()
        await client.ask(SYDNEY)
        await asyncio.sleep(30.0)
        assert bridge.sim.mechanics.sky[:2] == pytest.approx((-33.8583, 151.21), abs=0.01)
        assert (await client.ask(b"w"))[:8] == SYDNEY[1:]
        assert len([one for one in bridge.sent_requests() if one[:1] == b"W"]) == 1


# --- guide rates and the like -------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["down", "lost"])
async def test_guide_rate_and_backlash_are_sent_when_the_motors_answer_again(how: str) -> None:
    async with Bridge("cge", "4.21", presented="nexstar", surface="cge") as bridge:
        client, cable = bridge.client(), Cable(bridge)
        if how == "down":
            cable.pull()
            await asyncio.sleep(2.0)
        else:
            lose_commands(bridge, (b"P\x02\x10\x46", b"P\x02\x10\x10"), 2)
        await client.ask(b"P\x02\x10\x46\x40\0\0\0", 4.0)
        await client.ask(b"P\x02\x10\x10\x1e\0\0\0", 4.0)
        await plugged_in(bridge, cable)
        heard = bridge.sent_requests()
        assert b"P\x02\x10\x46\x40\0\0\0" in heard
        assert await client.ask(b"P\x01\x10\x47\0\0\0\x01") == b"\x40#"
        assert heard.count(b"P\x02\x10\x10\x1e\0\0\0") == (1 if how == "down" else 2)


# --- what is told at once, and what is not thrown away ------------------------------------------------------------


@pytest.mark.parametrize("ahead", [-25.0, 3.0, 20.0, 28.0, 40.0])
@pytest.mark.parametrize("aligned", [True, False])
async def test_time_close_to_the_mounts_clock_is_sent_again_at_once(ahead: float, aligned: bool) -> None:
    async with Bridge("6-8se", aligned=aligned, surface="autostar") as bridge:
        client = bridge.client()
        wanted = bridge.clock() + ahead
        text = datetime.fromtimestamp(wanted, UTC).strftime("%H:%M:%S").encode()
        assert await client.ask(b":SL" + text + b"#") == b"1"
        assert (await client.ask(b":GL#"))[:-1] == text
        await asyncio.sleep(10.0)
        told = (await client.ask(b":GL#")).decode()
        seconds = sum(int(part) * 60**power for power, part in enumerate(reversed(told[:-1].split(":"))))
        assert seconds == pytest.approx((wanted + 10.0) % 86400.0, abs=2.0)
        if aligned:
            assert "clock that was set is stored" in notes(bridge)
        else:
            assert utc(bridge) == pytest.approx(wanted + 10.0, abs=2.0)


@pytest.mark.parametrize(
    ("mount", "driven", "aligned"),
    [
        ("cge", "nexstar", False),
        ("avx", "nexstar", False),
        ("cge", "nexstar", True),
        ("lx200gps", "lx200", True),
        ("lx200", "lx200", True),
    ],
)
async def test_site_and_time_are_sent_again_exactly_as_set(mount: str, driven: str, aligned: bool) -> None:
    """Seconds, zone and daylight saving too: 20:30:40 in a zone one hour east, in summer."""
    async with Bridge(mount, driven=driven, aligned=aligned, presented="nexstar", surface="cge") as bridge:
        client = bridge.client()
        assert await client.ask(b"H\x14\x1e\x28\x07\x0e\x1b\x01\x01") == b"#"
        assert await client.ask(SYDNEY) == b"#"
        assert (await client.ask(b"h")) == b"\x14\x1e\x28\x07\x0e\x1b\x01\x01#"
        assert (await client.ask(b"w"))[:8] == SYDNEY[1:]
        await asyncio.sleep(30.0)
        assert (await client.ask(b"h"))[:2] + client.received[3:] == b"\x14\x1f\x07\x0e\x1b\x01\x01#"
        if driven == "nexstar" and not aligned:
            assert (bridge.sim.zone, bridge.sim.daylight) == (1, 1)


async def test_daylight_saving_set_at_the_hand_control_is_reported() -> None:
    async with Bridge("cge", aligned=False, presented="nexstar", surface="cge") as bridge:
        bridge.sim.feed(b"H\x14\x1e\x28\x07\x0e\x1a\x01\x01")
        client = bridge.client()
        for _ in range(120):
            client.send(b"E")
            await asyncio.sleep(1.0)
        assert (await client.ask(b"h"))[6:] == b"\x01\x01#"


@pytest.mark.parametrize("pause", [0.5, 4.0, 30.0])
async def test_offset_set_after_the_local_time_leaves_the_time_unchanged(pause: float) -> None:
    async with Bridge("6-8se", aligned=False, surface="autostar") as bridge:
        client = bridge.client()
        set_at = bridge.clock()
        await client.ask(b":SL20:15:30#")
        await asyncio.sleep(pause)
        await client.ask(b":SC03/14/27#")
        await asyncio.sleep(pause)
        await client.ask(b":SG+05#")
        await asyncio.sleep(10.0)
        elapsed = bridge.clock() - set_at
        assert utc(bridge) - elapsed == pytest.approx(unix("2027-03-15 01:15:30"), abs=2.0)
        assert (await client.ask(b":GG#")) == b"+05#"
