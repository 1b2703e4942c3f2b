"""The line that tells how the mounts are: what is on it, what is left out where it is narrow, and what it costs."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.app.mount_state import mount_state
from gateway.app.status import AverageRate, State, StatusLine, status_text
from gateway.astro.ephemeris.almanac import DAY, Almanac
from gateway.cli.mount.status import state_lines
from gateway.cli.serve.live import StatusLines, status_line
from gateway.core import operations as op
from gateway.core.operations import Equatorial, Position, Status, Tracking
from gateway.diagnostics.virtual_time import run
from gateway.transport.handler import NewConnection
from tests.support.each import each
from tests.support.in_process_gateway import Bridge

CRAB = Equatorial((5 + 34 / 60 + 32 / 3600) * 15, 22 + 0 / 60 + 52 / 3600)
ALIGNED = Status(Tracking.ALTAZ, aligned=True, equatorial=False)


def seen(**others: Any) -> StatusLine:
    usual = {"name": "cpc", "state": "up", "position": CRAB, "status": ALIGNED, "programs": 2, "rate": 4.125}
    return StatusLine(**{**usual, **others})


@each(
    ("line", "text"),
    [
        (seen(), "cpc  05:34:32 +22°00'52\"  tracking  2 programs  4.1/s"),
        (seen(position=Equatorial(359.9999, -0.5), programs=1),
         "cpc  00:00:00 -00°30'00\"  tracking  1 program  4.1/s"),
        (seen(slewing=True, by_hand=True), "cpc  05:34:32 +22°00'52\"  slewing  2 programs  4.1/s"),
        (seen(by_hand=True), "cpc  05:34:32 +22°00'52\"  moved by hand  2 programs  4.1/s"),
        (seen(status=Status(Tracking.OFF, True, False)),
         "cpc  05:34:32 +22°00'52\"  not tracking  2 programs  4.1/s"),
        (seen(status=Status(Tracking.ALTAZ, False, False)),
         "cpc  05:34:32 +22°00'52\"  not aligned  2 programs  4.1/s"),
        (seen(status=None, programs=0), "cpc  05:34:32 +22°00'52\"  no programs  4.1/s"),
        (seen(age=41.2), "cpc  05:34:32 +22°00'52\" 41 s ago  tracking  2 programs  4.1/s"),
        (seen(asleep=True), "cpc  05:34:32 +22°00'52\"  asleep  2 programs  4.1/s"),
        (seen(held=True), "cpc  05:34:32 +22°00'52\"  held, tracking  2 programs  4.1/s"),
        (seen(held=True, status=None), "cpc  05:34:32 +22°00'52\"  held  2 programs  4.1/s"),
        (seen(state="busy"), "cpc  05:34:32 +22°00'52\"  busy  2 programs  4.1/s"),
        (seen(position=None, status=None), "cpc  no position yet  2 programs  4.1/s"),
        (seen(state="opening", position=None, rate=0), "cpc  opening  2 programs  0.0/s"),
        (seen(state="down", reason="the mount does not answer", slewing=True, rate=0),
         "cpc  down: the mount does not answer  2 programs  0.0/s"),
    ],
)  # fmt: skip
def test_status_line_shows_position_and_state(line: StatusLine, text: str) -> None:
    assert status_text([line]) == text


@each(
    ("columns", "text"),
    [
        (54, "cpc  05:34:32 +22°00'52\"  tracking  2 programs  4.1/s"),
        (50, "cpc  05:34:32 +22°00'52\"  tracking  2 programs"),
        (40, "cpc  05:34:32 +22°00'52\"  tracking"),
        (30, "cpc  05:34:32 +22°00'52\""),
        (14, "cpc  05:34:32…"),
        (1, "…"),
        (0, ""),
    ],
)
def test_narrow_status_line_shows_the_most_important_values(columns: int, text: str) -> None:
    assert status_text([seen()], columns) == text


def test_status_line_never_exceeds_its_width() -> None:
    both = [seen(name="pier"), seen(name="dome", state="down", reason="cannot open /dev/ttyUSB1: no such port")]
    assert status_text(both).count("|") == 1
    assert all(len(status_text(both, columns)) <= columns for columns in range(160))


@pytest.mark.parametrize(("age", "told"), [(3.0, '52", 3 s ago; tracking'), (41.2, '52" 41 s ago; tracking')])
def test_status_shows_the_age_of_a_position_once(age: float, told: str) -> None:
    [line] = [line for line in state_lines(State(seen(age=age), "nexstar@sim")) if line.startswith("  now ")]
    assert line.endswith(f"+22°00'{told}")


def test_shown_request_rate_is_that_of_the_latest_interval() -> None:
    rate = AverageRate(2)
    counts = [(0, 7), (1, 11), (2, 13), (4, 13), (6, 13)]
    assert [rate.add_sample(at, count) for at, count in counts] == [0, 4, 3, 2 / 3, 0]


def gateway(bridge: Bridge, name: str | None = None) -> Any:
    """As much of a gateway as a look needs."""
    return SimpleNamespace(
        state=lambda: mount_state(bridge.controller, name or "", "nexstar@sim", bridge.acceptor.hosts_present())
    )


async def test_reading_the_status_sends_nothing_to_the_mount() -> None:
    async with Bridge(mount="cpc") as bridge:
        pier, rate = gateway(bridge), AverageRate()
        await asyncio.sleep(20)
        settled = len(bridge.sent_requests())
        await asyncio.sleep(30)
        unseen = len(bridge.sent_requests())
        for _ in range(300):
            assert status_line(pier, rate).state == "up"
            await asyncio.sleep(0.1)
        assert len(bridge.sent_requests()) - unseen <= unseen - settled + 4  # heartbeats, site and status, as before
        first = status_line(pier, rate)
        assert (first.name, first.slewing, first.programs) == ("cpc", False, 0)
        assert first.position is not None and first.status is not None and first.status.aligned
        client = bridge.client()
        await client.ask(b":RM#:Me#:GR#")
        assert status_line(pier, rate).by_hand
        assert status_line(pier, rate).programs == 1
        await client.ask(b":Q#:GR#")
        await asyncio.sleep(1)
        assert not status_line(pier, rate).by_hand
        await client.ask(b":Sr05:34:32#:Sd+22*00:52#:MS#", ending=b"110")
        await asyncio.sleep(1)
        assert status_line(gateway(bridge, "pier"), rate).name == "pier"
        assert "slewing" in status_text([status_line(pier, rate)])
        assert status_line(pier, rate).rate > 0
        assert pier.state().to_state().sky == "closed form"
        moment = bridge.controller.sources.times()[0].unix
        bridge.controller.astrometry.sky.use(Almanac({int(moment // DAY): bytes(8 * 333)}))
        assert pier.state().to_state().sky == f"almanac of {datetime.fromtimestamp(moment, UTC):%Y-%m-%d}"


async def test_status_counts_programs_as_they_connect_and_leave() -> None:
    async with Bridge() as bridge:
        acceptor = bridge.acceptor
        one, other, passing, line, serial = (
            acceptor.accept(NewConnection(name, host, lambda data: None))
            for name, host in (
                ("10.0.0.1:4", "10.0.0.1"),
                ("10.0.0.1:5", "10.0.0.1"),
                ("10.0.0.2:6", "10.0.0.2"),
                ("/tmp/lx200", "pty:/tmp/lx200"),
                ("/dev/ttyS0", "/dev/ttyS0"),
            )
        )
        assert len(acceptor.hosts_present()) == 3  # nobody has been heard on the two serial lines
        line.feed(b":GR#")
        serial.feed(b":")
        assert len(acceptor.hosts_present()) == 5
        passing.close()
        assert len(acceptor.hosts_present()) == 5  # it may open a connection for every command
        one.close()
        assert len(acceptor.hosts_present()) == 4  # its host is still here with another one
        await asyncio.sleep(11)
        assert len(acceptor.hosts_present()) == 1
        other.close()
        line.close()
        await asyncio.sleep(11)
        assert len(acceptor.hosts_present()) == 0


async def test_status_line_reports_an_impossible_declination() -> None:
    async with Bridge() as bridge:
        bridge.controller.cache.put(Position, Equatorial(0.0, 95.0), bridge.controller.now())
        onlooker = StatusLines([gateway(bridge)])
        assert "beyond 90 degrees" in onlooker.line()
        assert onlooker.line(12) == "an altitude,"


def test_status_tells_programs_of_one_computer_apart_by_surface() -> None:
    async def program() -> None:
        async with Bridge(config={"sun": 0.0, "lowest": -90.0}) as bridge:
            surfaces = ["lx200 tcp://127.0.0.1:4030", "nexstar tcp://127.0.0.1:4031"]

            def orders(*surfaces: str) -> tuple[str, ...]:
                return mount_state(bridge.controller).to_state(surfaces).wanted

            for who, ends in (("127.0.0.1", f"by 127.0.0.1 at {surfaces[1]}"), ("pty:/tmp/x", "by pty:/tmp/x")):
                activity = bridge.controller.presence.add_connection(who, 2)
                await bridge.controller.perform(op.Goto(120.0, 30.0), activity=activity)
                assert orders(*surfaces)[0].endswith(ends)
                assert orders()[0].endswith(f"by {who}")
            replaced = "the goto of pty:/tmp/x replaces the goto of 127.0.0.1"
            assert [entry.note for entry in bridge.entries if "replaces" in entry.note] == [replaced]

    run(program())
