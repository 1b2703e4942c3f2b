"""``stopped`` is only said of a mount that was seen to rest, whatever it acknowledged."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.app.control.orders import stop_mount
from gateway.astro.axes import Build
from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge

NORTH = b"P\2\x11\x24\x09\0\0\0"
#: (driven protocol, mount, firmware, what it needs to be told)
MOUNTS: list[tuple[str, str, str | None, dict[str, Any]]] = [
    ("nexstar", "6-8se", None, {}),
    ("nexstar", "cge", None, {}),
    ("nexstar", "nexstar-gps", "1.2", {"mode": "alt-az"}),
    ("nexstar", "nexstar-gps", "1.6", {"mode": "alt-az"}),
    *(("lx200", mount, None, {}) for mount in ("lx200", "lx200-16", "autostar", "lx200gps")),
]


def bridge_of(driven: str, mount: str, version: str | None, config: dict[str, Any], **others: Any) -> Bridge:
    return Bridge(mount, version, driven=driven, presented="nexstar", surface=None, config=config, **others)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("driven", "mount", "version", "config"), MOUNTS)
@pytest.mark.parametrize("state", ["tracking", "not tracking", "not aligned", "coarse"])
async def test_resting_mount_is_recognised_with_and_without_tracking(
    driven: str, mount: str, version: str | None, config: dict[str, Any], state: str
) -> None:
    async with bridge_of(driven, mount, version, config, aligned=state != "not aligned") as bridge:
        client = bridge.client()
        bridge.driver.low = state == "coarse"
        if state == "not tracking":
            await client.ask(b"T\0", 3.0)
        client.send(NORTH)
        await asyncio.sleep(3)
        began = bridge.controller.now()
        assert (await stop_mount(bridge.controller)).is_ok
        assert bridge.controller.now() - began < 6.0
        before = bridge.sim.true_position()
        await asyncio.sleep(1)
        assert separation(*before, *bridge.sim.true_position()) < 0.006


def _deaf(bridge: Bridge, *commands: bytes) -> None:
    """A mount that acknowledges these commands as always, and does not carry them out."""
    hear = bridge.controller.line.wire.feed  # type: ignore[attr-defined]

    def feed(data: bytes) -> bytes:
        return b"#" * (bridge.driver.protocol.name == "nexstar") if data.startswith(commands) else bytes(hear(data))

    bridge.controller.line.wire.feed = feed  # type: ignore[attr-defined]


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("driven", "mount", "version", "config"), [
    ("nexstar", "6-8se", None, {}), ("nexstar", "cge", None, {}),
    *(("lx200", mount, None, {}) for mount in ("lx200", "lx200-16", "autostar", "lx200gps")),
])  # fmt: skip
@pytest.mark.parametrize("rate", [9, 4])
async def test_acknowledged_stop_without_effect_is_not_reported_as_stopped(
    driven: str, mount: str, version: str | None, config: dict[str, Any], rate: int
) -> None:
    async with bridge_of(driven, mount, version, config) as bridge:
        bridge.client().send(NORTH.replace(b"\x09", bytes((rate,))))
        await asyncio.sleep(3)
        _deaf(bridge, b"P\2\x10\x24\0", b"P\2\x11\x24\0", b"M", b"T", b":Q")
        began = bridge.controller.now()
        answer = await stop_mount(bridge.controller)
        assert "still moves after 8 s" in answer.text
        assert bridge.controller.now() - began < 14.0


@pytest.mark.parametrize(("driven", "mount"), [
    ("nexstar", "cge"), ("nexstar", "6-8se"), ("lx200", "lx200"), ("lx200", "lx200-16"), ("lx200", "autostar"),
])  # fmt: skip
async def test_axis_that_turns_the_tube_on_the_spot_counts_as_moving(driven: str, mount: str) -> None:
    """At the pole or in the zenith, where a motor runs and the place on the sky stays the same."""
    async with bridge_of(driven, mount, None, {"highest": 90.0}, speed=4.0) as bridge:
        bridge.sim.true_position()
        equatorial = bridge.sim.mechanics.build is not Build.ALTAZ
        await bridge.controller.perform(op.Goto(30.0, 90.0) if equatorial else op.GotoHorizontal(0.0, 90.0))
        for _ in range(90):
            if not bridge.sim.slewing:
                break
            await asyncio.sleep(1)
        assert (await stop_mount(bridge.controller)).is_ok
        bridge.client().send(b"P\2\x10\x24\x09\0\0\0")
        await asyncio.sleep(3)
        _deaf(bridge, b"P\2\x10\x24\0", b"P\2\x11\x24\0", b"M", b"T", b":Q")
        assert "still moves" in (await stop_mount(bridge.controller)).text


def test_stop_waits_for_a_mount_that_runs_on() -> None:
    async def program() -> None:
        async with bridge_of("nexstar", "cge", None, {}) as bridge:
            bridge.client().send(NORTH)
            await asyncio.sleep(3)
            hear, later = bridge.controller.line.wire.feed, asyncio.get_running_loop().call_later  # type: ignore[attr-defined]

            def feed(data: bytes) -> bytes:
                if data.startswith((b"P\2\x11\x24\0", b"T")):  # two seconds of it
                    later(2.0, hear, data)
                    return b"#"
                return bytes(hear(data))

            bridge.controller.line.wire.feed = feed  # type: ignore[attr-defined]
            began = bridge.controller.now()
            assert (await stop_mount(bridge.controller)).is_ok
            assert 2.0 < bridge.controller.now() - began < 6.0

    run(program())


@pytest.mark.parametrize("question", [b"e", b"E"])
async def test_stop_is_not_reported_done_while_positions_are_unread(question: bytes) -> None:
    async with bridge_of("nexstar", "cge", None, {}) as bridge:
        bridge.client().send(NORTH)
        await asyncio.sleep(3)
        hear = bridge.controller.line.wire.feed  # type: ignore[attr-defined]
        bridge.controller.line.wire.feed = lambda data: b"" if data[:1] in b"eE" else hear(data)  # type: ignore[attr-defined]
        answer = await stop_mount(bridge.controller)
        assert answer.text.startswith("the stop was sent") and "cannot see" in answer.text


async def test_stop_on_a_line_that_is_down_is_reported_as_pending() -> None:
    async with bridge_of("nexstar", "cge", None, {}) as bridge:
        bridge.client().send(NORTH)
        await asyncio.sleep(3)
        hear = bridge.controller.line.wire.feed  # type: ignore[attr-defined]
        bridge.controller.line.wire.feed = lambda data: b""  # type: ignore[attr-defined]
        for _ in range(2):  # at first it is only silent, then known to be down
            answer = await stop_mount(bridge.controller)
            assert not answer.is_ok
            assert "sends the stop first" in answer.text
            await asyncio.sleep(20)
        sent = len(bridge.sent_requests())
        bridge.controller.line.wire.feed = hear  # type: ignore[attr-defined]
        await asyncio.sleep(10)
        orders = [frame for frame in bridge.sent_requests()[sent:] if frame[:1] != b"K"]
        assert set(orders[:6]) >= {b"P\2\x11$\0\0\0\0", b"P\2\x10$\0\0\0\0", b"M"}
        assert (await stop_mount(bridge.controller)).is_ok


async def test_program_that_keeps_pressing_an_arrow_is_named_with_a_remedy() -> None:
    async with bridge_of("nexstar", "cge", None, {}) as bridge:
        client = bridge.client()

        async def press() -> None:
            while True:
                client.send(NORTH)
                await asyncio.sleep(0.3)

        pressing = asyncio.ensure_future(press())
        await asyncio.sleep(2)
        answer = await stop_mount(bridge.controller)
        pressing.cancel()
        assert "moving again" in answer.text and "stop --hold" in answer.text


async def test_hibernating_mount_counts_as_resting() -> None:
    async with bridge_of("nexstar", "cpc", None, {}) as bridge:
        bridge.client().send(b"x")
        await asyncio.sleep(12)
        assert bridge.sim.asleep
        assert (await stop_mount(bridge.controller)).is_ok
