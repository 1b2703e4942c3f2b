"""One site and clock for each reader: what one program sets on a mount that keeps its own changes nothing for others.

Three programs on one aligned NexStar, each on a surface of its own. The mount stands at 45 N, 10 E, at 22:00 UTC.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import EVENING, Bridge
from tests.support.three_programs import PROTOCOLS, ThreePrograms
from tests.unit.mount.site.test_sources import as_lx200

#: What the program that is wrong sets: Sydney, and the evening of 2020-01-01 (UTC).
LATITUDE, LONGITUDE, LONG_AGO = -33.9, 151.2, 1577916000.0
Reading = tuple[float, float, float, float]


def readings(mount: str, wrong: str, folder: Path, **others: Any) -> dict[str, dict[str, Reading]]:
    """Return what each program reads before, at once after, and later than the wrong one sets; and after a restart."""
    found: dict[str, dict[str, Reading]] = {}

    async def program() -> None:
        async with ThreePrograms(mount, state=folder, config={"sun": 0.0}, **others) as three:
            found["before"] = {who: await three.reading(who) for who in PROTOCOLS}
            await three.sets(wrong, LATITUDE, LONGITUDE, LONG_AGO)
            found["during"] = {who: await three.reading(who) for who in PROTOCOLS}
            await asyncio.sleep(120.0)
            found["after"] = {who: await three.reading(who) for who in PROTOCOLS}
        async with ThreePrograms(mount, state=folder, config={"sun": 0.0}, on=three, **others) as again:
            found["restarted"] = {who: await again.reading(who) for who in PROTOCOLS}

    run(program())
    return found


@pytest.mark.parametrize("mount", ["cge", "cpc"])
@pytest.mark.parametrize("wrong", PROTOCOLS)
def test_wrong_site_of_one_program_changes_nothing_for_others(mount: str, wrong: str, tmp_path: Path) -> None:
    found = readings(mount, wrong, tmp_path)
    for moment, told in found.items():
        for who, (latitude, longitude, ahead, sidereal) in told.items():
            if who == wrong and moment in ("during", "after"):
                assert (latitude, longitude) == pytest.approx((LATITUDE, LONGITUDE), abs=0.1), (moment, who)
                assert ahead == pytest.approx((LONG_AGO - EVENING) / 3600.0, abs=0.1)
            else:
                assert (latitude, longitude, ahead) == (45.0, 10.0, 0.0), (moment, who)
                assert sidereal == pytest.approx(found["before"][who][3], abs=0.1), (moment, who)


@pytest.mark.parametrize("wrong", PROTOCOLS)
async def test_site_taken_by_the_mount_applies_to_all_and_the_log_names_its_setter(wrong: str, tmp_path: Path) -> None:
    async with ThreePrograms("lx200gps", driven="lx200", config={"sun": 0.0, "site": (45.0, 10.0)}) as three:
        await three.sets(wrong, LATITUDE, LONGITUDE)
        await asyncio.sleep(5.0)
        for who in PROTOCOLS:
            assert (await three.reading(who))[:2] == pytest.approx((LATITUDE, LONGITUDE), abs=0.1)
        notes = [entry.note for entry in three.entries if entry.note]
        host = f"10.0.0.{1 + PROTOCOLS.index(wrong)}"
        assert any(host in note and "has set the mount's site" in note for note in notes), notes
        assert any(note.startswith("WARNING") and "the configuration says 45.0 N 10.0 E" in note for note in notes)
        state = three.gateway.request_handler.state()
        assert host in state.site and "the configuration says 45.0 N 10.0 E" in state.site
        reply = await three.lx200("10.0.0.9").ask(as_lx200(*below(three)), 3, b"#")
        assert reply == b"111Object Below Horizon.#"  # the mount's own site judges


def below(bridge: Bridge) -> tuple[float, float]:
    """A place 60 degrees high at 45 N 10 E, which is below the horizon in Sydney."""
    return (bridge.controller.astrometry.sky.sidereal_time(bridge.clock(), 10.0)) % 360.0, 75.0


@pytest.mark.parametrize("mount", ["cge", "cpc"])
@pytest.mark.parametrize(
    "said", [b":St10*00#:Sg120*30#", b":St-33*52#:Sg208*48#:SG-10#", b":SL12:00:00#:SC01/02/27#:SG+03#"]
)
async def test_wrong_site_of_a_program_causes_no_refused_gotos(mount: str, said: bytes, tmp_path: Path) -> None:
    """Not its own either; not after a restart."""
    async with ThreePrograms(mount, state=tmp_path, config={"sun": 0.0}) as three:
        await three.lx200("10.0.0.7").ask(said, 3, b"", 2.0)
        await asyncio.sleep(4.0)
        for host in ("10.0.0.7", "10.0.0.8"):
            reply = await three.lx200(host).ask(as_lx200(*below(three)), 3, b"0")
            assert reply == b"110", reply
            three.controller.begin_stop()
            await asyncio.sleep(3.0)
    async with ThreePrograms(mount, state=tmp_path, config={"sun": 0.0}, on=three) as again:
        assert await again.lx200("10.0.0.8").ask(as_lx200(*below(again)), 3, b"0") == b"110"


async def test_two_programs_each_read_back_what_they_set() -> None:
    async with ThreePrograms("cge") as three:
        await three.sets("lx200", 20.0, 30.0)
        await three.sets("nexstar", -20.0, -30.0)
        assert (await three.reading("lx200"))[:2] == (20.0, 30.0)
        assert (await three.reading("nexstar"))[:2] == (-20.0, -30.0)
        assert (await three.reading("alpaca"))[:2] == (45.0, 10.0)


async def test_halves_of_a_site_from_two_programs_are_not_combined() -> None:
    async with ThreePrograms("cge", aligned=False) as three:
        one, other = three.lx200("10.0.0.7"), three.lx200("10.0.0.8")
        await one.ask(b":St+20*00#")
        await other.ask(b":Sg300*00#")
        await asyncio.sleep(6.0)
        sent = [frame for frame in three.sent_requests() if frame[:1] == b"W"]
        assert all(frame != b"W" + bytes((20, 0, 0, 0, 60, 0, 0, 0)) for frame in sent[:1]), sent


@pytest.mark.parametrize("again", ["another connection", "a new connection"])
async def test_zone_set_alone_survives_a_reconnect(again: str) -> None:
    async with ThreePrograms("cpc") as three:
        one = three.lx200("10.0.0.7")
        assert await one.ask(b":SG-02#") == b"1"
        await asyncio.sleep(3.0)
        if again == "a new connection":
            one.close()
            await asyncio.sleep(300.0)
        same = three.lx200("10.0.0.7")
        assert (await same.ask(b":GG#", end=b"#"))[:3] == b"-02"
        assert (await same.ask(b":GL#", end=b"#"))[:2] == b"00"
        assert (await three.lx200("10.0.0.8").ask(b":GG#", end=b"#"))[:3] == b"+00"
        assert (await three.reading("lx200"))[2] == 0.0


@pytest.mark.parametrize("polls", [True, False])
async def test_site_set_at_the_keypad_applies_within_ten_seconds(polls: bool) -> None:
    """At whatever moment, with a program that polls, and without any."""
    for since in range(3, 60, 8):
        async with Bridge("cge", config={"sun": 0.0}) as bridge:
            client = bridge.client()
            for second in range(since + 10):
                await asyncio.sleep(1.0)
                if second == since:
                    bridge.sim.feed(b"W" + bytes((33, 52, 0, 1, 151, 12, 0, 0)))
                if polls:
                    await client.ask(b":GR#")
            reply = await bridge.client().ask(as_lx200(*below(bridge)), ending=b"#")
            assert reply.startswith(b"111Object Below Horizon"), (since, reply)
            site = bridge.controller.sources.site()
            assert site is not None and site.latitude == pytest.approx(-33.87, abs=0.01), since


async def test_site_set_by_a_program_survives_a_restart_on_a_mount_without_one(tmp_path: Path) -> None:
    """By any protocol, and under the name of who has set it."""
    config = {"sun": 0.0}
    async with ThreePrograms("nexstar-gps", "1.2", state=tmp_path, config=config) as three:
        await three.sets("alpaca", 45.0, 10.0)
    async with ThreePrograms("nexstar-gps", "1.2", state=tmp_path, config=config, on=three) as again:
        assert (await again.reading("lx200"))[:2] == (45.0, 10.0)
        assert again.controller.sources.sites()[0].source == "a program (10.0.0.1, 2026-01-15)"
