"""Wishes from the command line: the same limits, refusals in words, and what was begun is ended, and nothing else."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from gateway.app.control.requests import RequestHandler
from gateway.app.mount_state import mount_state
from gateway.app.status import State
from gateway.astro.ephemeris.sky import Sky
from gateway.cli.mount.status import state_lines
from gateway.core import requests
from gateway.core.operations import Direction, Place
from gateway.diagnostics.virtual_time import run
from gateway.mount.site.site_clock import COMPUTER_SOURCE, CONFIG_SOURCE, MOUNT_SOURCE, SourcedSite, SourcedTime
from gateway.protocols.mechanics.truth import truth_of
from gateway.transport.web_server import WebServer
from tests.support import exact_sky
from tests.support.in_process_gateway import Bridge

NORTH = requests.MoveRequest(Direction.NORTH, 7, 3.0, number="m")
CRAB = requests.Spot(83.633, 22.014)


class Owner:
    """Somebody at the keyboard of a bridge's gateway."""

    def __init__(self, bridge: Any, name: str = "") -> None:
        surfaces = ["lx200:autostar@tcp://127.0.0.1:4030", "nexstar:6-8se@pty:/tmp/nexstar pier"]
        serving: Any = SimpleNamespace(
            state=lambda: mount_state(bridge.controller, name, "nexstar@sim", bridge.acceptor.hosts_present()),
            names=lambda: surfaces,
            web=WebServer(),
            open_failure="",
            store=None,
        )
        self.request_handler = RequestHandler(bridge.controller, serving)
        self._controller = bridge.controller

    async def wish(self, wish: requests.Request) -> str:
        return str(await self.request_handler.carry_out(wish))

    async def see(self) -> State:
        return msgspec.json.decode((await self.request_handler.carry_out(requests.StateRequest())).text, type=State)

    async def outcome(self, number: str) -> str:
        """What came of it in the end."""
        for _ in range(300):
            answer = await self.wish(requests.ProgressRequest(number))
            if not answer.startswith("under way"):
                return answer
            await asyncio.sleep(1)
        raise AssertionError("it never ends")


def moves(bridge: Any) -> bool:
    return truth_of(bridge.sim).moving


async def test_goto_from_the_command_line_arrives_and_reports_it() -> None:
    async with Bridge() as bridge:
        owner = Owner(bridge)
        assert await owner.wish(requests.GotoRequest(CRAB, number="g")) == "done it goes to 05:34:32 +22°00'50\""
        state = await owner.see()
        assert "05:34:32 +22°00'50\"" in state.wanted[0] and "mount-gateway goto" in state.wanted[0]
        assert state.look.slewing
        assert (await owner.outcome("g")).startswith("done it is there: 05:34:3")
        assert not (await owner.see()).wanted


async def test_goto_by_name_uses_the_position_of_the_object(monkeypatch: pytest.MonkeyPatch) -> None:
    async def at_once(function: Any, *arguments: Any) -> Any:
        return function(*arguments)  # virtual time waits for no thread

    monkeypatch.setattr(asyncio, "to_thread", at_once)
    async with Bridge() as bridge:
        take = Owner(bridge).request_handler.carry_out
        answer = await take(requests.GotoRequest(requests.Named("Aldebaran"), number="g"))
        assert answer.is_ok and answer.text.startswith("it goes to 04:37:")
        low = await take(requests.GotoRequest(requests.Named("canopus"), number="l"))
        assert low.text.startswith("Canopus is below the horizon (-")
        unknown = await take(requests.GotoRequest(requests.Named("Aldebarran"), number="h"))
        assert not unknown.is_ok and "did you mean Aldebaran" in unknown.text


async def test_log_holds_each_request_and_its_outcome() -> None:
    async with Bridge() as bridge:
        owner = Owner(bridge)
        await owner.wish(requests.GotoRequest(CRAB, number="g", who="a page"))
        await owner.wish(requests.GotoRequest(requests.Spot(10.0, -80.0), who="a page"))
        await owner.wish(requests.CancelRequest("g"))
        for _ in range(3):  # the first presses, the others keep it alive
            await owner.wish(requests.PressKeyRequest(Direction.NORTH, 7, number="p", who="a page"))
        await owner.wish(requests.ReleaseKeyRequest(number="p", who="a page"))
        for silent in (requests.StateRequest(), requests.ReadSlowRequest(), requests.ProgressRequest("g")):
            await owner.wish(silent)
        said = [(entry.side, entry.arrow, entry.note) for entry in bridge.entries if entry.arrow in "*!"]
        asked = [entry for entry in said if entry[0] == "a page"]
        assert [(arrow, note.partition(":")[0]) for _, arrow, note in asked] == [
            ("*", "Goto"),
            ("!", "Goto"),
            ("*", "Cancel"),
            ("*", "Arrow"),
            ("*", "Release of an arrow"),
        ], asked


async def test_goto_from_the_command_line_beyond_a_limit_is_refused_in_words() -> None:
    async with Bridge(config={"lowest": 15.0}) as bridge:
        owner = Owner(bridge)
        answer = await owner.wish(requests.GotoRequest(requests.Spot(83.6, -70.0), number="g"))
        assert answer.startswith("failed ") and "altitude, 15°" in answer
        assert not moves(bridge)
        far = await owner.wish(requests.SyncRequest(requests.Spot(200.0, 40.0), number="s"))
        assert far.startswith("failed Sync refused: ")
        told = (await owner.see()).lately[-1]
        assert ": Sync refused: " in told and "Sync: " not in told
        assert "up to 15°" in far
        lately = (await owner.see()).lately
        assert any("mount-gateway goto: Goto: " in words for words in lately)
        await asyncio.sleep(70)
        assert (await owner.see()).lately == ()


async def test_status_shows_refused_client_requests_without_a_log() -> None:
    async with Bridge() as bridge:
        bridge.wire_log.sinks.clear()
        client = bridge.client("192.168.1.23")
        for _ in range(2):
            await client.ask(b":Sr05:34:32#:Sd-80*00:00#:MS#", ending=b"#")
        state = await Owner(bridge).see()
        [refused] = [words.partition(" ago, ")[2] for words in state.lately]
        assert refused.startswith("192.168.1.23: Goto: ") and "(2 times)" in refused
        assert state.programs == ("192.168.1.23",)
        crowd = msgspec.structs.replace(state, programs=("10.0.0.2", "192.168.1.23", "10.0.0.2"))
        assert any("10.0.0.2 (2 times), 192.168.1.23" in line for line in state_lines(crowd))
        bridge.wire_log.sinks.append(bridge.entries.append)


async def test_move_ends_by_itself_when_its_requester_is_gone() -> None:
    async with Bridge() as bridge:
        owner = Owner(bridge)
        wish = asyncio.ensure_future(owner.wish(NORTH))
        await asyncio.sleep(1.5)
        assert moves(bridge)
        assert any(words.startswith("an arrow up, asked for") for words in (await owner.see()).wanted)
        assert await wish == "done it was moved north for 3.0 s"
        await asyncio.sleep(1)
        assert not moves(bridge)


async def test_move_of_a_parked_mount_reports_that_it_is_no_longer_parked() -> None:
    async with Bridge() as bridge:
        owner = Owner(bridge)
        await owner.wish(requests.ParkRequest(number="p"))
        assert (await owner.outcome("p")).endswith("it is parked")
        assert "it is no longer parked" in await owner.wish(NORTH)
        assert "parked" not in await owner.wish(NORTH)


async def test_move_command_longer_than_the_dead_man_time_is_refused() -> None:
    async with Bridge(config={"dead_man": 5.0}) as bridge:
        answer = await Owner(bridge).wish(requests.MoveRequest(Direction.NORTH, 7, 6.0, number="m"))
        assert answer.startswith("failed ") and "5 s (--dead-man)" in answer and "1 to 9" in answer
        assert not moves(bridge)


async def test_cancelled_move_ends_at_once() -> None:
    async with Bridge() as bridge:
        owner = Owner(bridge)
        wish = asyncio.ensure_future(owner.wish(requests.MoveRequest(Direction.WEST, 9, 20.0, number="m")))
        await asyncio.sleep(2)
        assert (await owner.wish(requests.CancelRequest("m"))).startswith("done")
        assert (await wish).startswith("done it was moved west for 1.")
        await asyncio.sleep(2)
        assert not moves(bridge)
        await owner.wish(requests.GotoRequest(CRAB, number="g"))
        await asyncio.sleep(2)
        assert moves(bridge)
        assert await owner.wish(requests.CancelRequest("g")) == "done the mount was stopped"
        await asyncio.sleep(2)
        assert not moves(bridge)


async def test_cancelling_a_move_leaves_a_newer_motion_alone() -> None:
    async with Bridge() as bridge:
        owner, client = Owner(bridge), bridge.client()
        await owner.wish(requests.GotoRequest(CRAB, number="g"))
        await asyncio.sleep(1)
        assert await client.ask(b":Sr03:00:00#:Sd+60*00:00#:MS#", ending=b"110") == b"110"
        await asyncio.sleep(1)
        assert (await owner.wish(requests.CancelRequest("g"))).startswith("done nothing ")
        assert bridge.controller.slewing
        assert (await owner.see()).wanted[0].startswith("a goto to 03:00:00 +60°00'00\"")


async def test_move_cancelled_before_it_arrives_is_not_begun() -> None:
    async with Bridge() as bridge:
        owner = Owner(bridge)
        await owner.wish(requests.CancelRequest("g"))
        assert (await owner.wish(requests.GotoRequest(CRAB, number="g"))).startswith("failed It was cancelled.")
        await asyncio.sleep(2)
        assert not moves(bridge)


async def test_waiting_requester_is_told_of_a_stop_by_a_program() -> None:
    async with Bridge() as bridge:
        owner, client = Owner(bridge), bridge.client()
        await owner.wish(requests.GotoRequest(CRAB, number="g"))
        await asyncio.sleep(2)
        client.send(b":Q#")
        assert (await owner.outcome("g")).startswith("failed it was stopped") and "127.0.0.1" in await owner.outcome(
            "g"
        )
        wish = asyncio.ensure_future(owner.wish(requests.MoveRequest(Direction.WEST, 9, 20.0, number="m")))
        await asyncio.sleep(2)
        client.send(b":Q#")
        assert (await wish).startswith("failed Stopped.")  # twenty seconds are not waited for
        assert "move: Move ended by a stop" in " ".join((await owner.see()).lately)


async def test_arrow_kept_pressed_through_a_stop_stays_ended() -> None:
    """Whoever holds it learns that it moves nothing any more, and must press anew."""
    async with Bridge() as bridge:
        owner, client = Owner(bridge), bridge.client()
        press = requests.PressKeyRequest(Direction.NORTH, 7, number="p")
        assert await owner.wish(press) == "done it is moved north"
        client.send(b":Q#")
        await asyncio.sleep(2)
        assert (await owner.wish(press)).startswith("failed Stopped.")
        assert not moves(bridge)
        assert await owner.wish(requests.PressKeyRequest(Direction.NORTH, 7, number="q")) == "done it is moved north"


async def test_goto_being_sent_is_not_listed_as_not_yet_begun() -> None:
    async with Bridge(latency=0.5) as bridge:
        owner = Owner(bridge)
        wish = asyncio.ensure_future(owner.wish(requests.GotoRequest(CRAB, number="g")))
        while not bridge.controller.wanted.value.active:
            await asyncio.sleep(0.05)
        assert not [line for line in (await owner.see()).wanted if "not begun yet" in line]
        assert (await wish).startswith("done")


async def test_goto_refusal_says_how_to_align_or_release_mount() -> None:
    async with Bridge(aligned=False) as bridge:
        owner = Owner(bridge)
        assert "Align it at the hand control" in await owner.wish(requests.GotoRequest(CRAB, number="g"))
        bridge.controller.hold.is_on = True
        assert "mount-gateway stop --release" in await owner.wish(requests.GotoRequest(CRAB, number="h"))
        assert any("stop --release" in limit for limit in (await owner.see()).allowed)


async def test_status_lists_site_clock_and_tracking() -> None:
    async with Bridge() as bridge:
        owner = Owner(bridge, "pier")
        state = await owner.see()
        assert state.look.age < 1.0
        told = "\n".join(state_lines(state))
        assert "  now       " in told
        assert "tracking\n" in told and "none: no motion\n" in told
        down = msgspec.structs.replace(state.look, state="down", reason="no such port")
        told = "\n".join(state_lines(msgspec.structs.replace(state, look=down)))
        assert " 0 s ago\n  orders" in told  # nobody knows whether it still tracks
        assert "down: no such port" in told
        assert (state.look.name, state.mount) == ("pier", "nexstar@sim")
        assert state.identity_text == "Celestron NexStar, 6-8se, version 4.21"
        assert state.site == "45.0 N 10.0 E, from the mount"
        assert state.clock == "2026-01-15 22:00:01 UTC, from the mount"


def test_site_conflict_with_the_config_is_reported_once() -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            state = mount_state(bridge.controller)
            for by, told in (("", "the mount"), ("10.0.0.2", "the mount, as 10.0.0.2 set it")):
                sites = [
                    SourcedSite(Place(45.0, 10.0), MOUNT_SOURCE, by),
                    SourcedSite(Place(48.1, 11.6), CONFIG_SOURCE),
                ]
                shown = msgspec.structs.replace(state, sites=sites, times=[SourcedTime(0.0, MOUNT_SOURCE)]).site
                whole = f"45.0 N 10.0 E, from {told}; the configuration says 48.1 N 11.6 E, 366 km away: correct the"
                assert shown.startswith(whole)
                assert "the key site of the configuration" in shown


def test_wrong_clock_is_reported_with_both_times_and_how_to_set_each() -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            times = [SourcedTime(0.0, MOUNT_SOURCE), SourcedTime(7200.0, COMPUTER_SOURCE)]
            for sites in ([], [SourcedSite(Place(45.0, 10.0), MOUNT_SOURCE)]):
                shown = msgspec.structs.replace(mount_state(bridge.controller), sites=sites, times=times).time
                for words in (
                    "1970-01-01 00:00 and 1970-01-01 02:00 UTC",
                    "hand control",
                    "the clock of this computer",
                ):
                    assert words in shown

    run(program())

    run(program())


async def test_meade_obeys_move_goto_cancel_and_park_requests() -> None:
    sky = Sky()
    exact_sky.load(sky)
    async with Bridge(driven="lx200", mount="lx200gps", presented="nexstar", surface=None, sky=sky) as bridge:
        owner = Owner(bridge)
        assert (await owner.wish(NORTH)).startswith("done it was moved north for 3.0 s")
        assert (await owner.wish(requests.GotoRequest(CRAB, number="g"))).startswith("done it goes to 05:34:32")
        assert (await owner.outcome("g")).startswith("done it is there: 05:34:")
        assert (await owner.wish(requests.GotoRequest(requests.Body("Jupiter"), number="j"))).startswith(
            "done it goes to 07:"
        )
        assert (await owner.wish(requests.CancelRequest("j"))) == "done the mount was stopped"
        assert (await owner.wish(requests.ParkRequest(number="p"))).startswith("done it goes to its park position")
        assert await owner.outcome("p") == "done it is parked"


async def test_memory_for_many_control_requests_is_bounded() -> None:
    async with Bridge() as bridge:
        owner = Owner(bridge)
        for number in range(200):
            await owner.wish(requests.CancelRequest(str(number)))
        await asyncio.sleep(61)
        for number in range(200, 270):
            await owner.wish(requests.CancelRequest(str(number)))
        assert sum(len(there) for there in bridge.controller.presence._by_host.values()) <= 64 + 70 + 2
