"""A limit counts also when the position comes late: then the motion ends by its last known speed."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.mount.safety.watch import StopDeadline
from tests.integration.safety.test_by_hand import DOWN, UP, ready
from tests.support.in_process_gateway import Bridge
from tests.support.looks import altitude, extremes, notes
from tests.support.sampling import as_a_rule


@pytest.mark.parametrize("every", [0.3, 0.35, 0.5, 0.7])
def test_cancelled_gotos_do_not_delay_position_readings(every: float) -> None:
    """They go to the line before positions do; on a slow one more than a second may pass without one."""

    async def program(height: float) -> None:
        async with Bridge(
            "cpc", "4.03", presented="nexstar", surface="cpc", config={"highest": 75.0}, latency=0.2
        ) as bridge:
            hand, other = bridge.client("127.0.0.1"), bridge.client("127.0.0.2")
            await bridge.controller.perform(op.GotoHorizontal(180.0, height))
            await ready(bridge, hand, b"e")
            hand.send(UP)
            high = 0.0
            for _ in range(round(4.0 / every)):
                other.send(b"r34AB0500,12CE0500")
                high = max(high, (await extremes(bridge, every / 2))[1])
                other.send(b"M")
                high = max(high, (await extremes(bridge, every / 2))[1])
            assert high <= 75.01, height

    for step in range(0, 6, as_a_rule(3, whole=1)):
        run(program(62.0 + 0.4 * step))


@pytest.mark.parametrize(("motor", "limits"), [(UP, {"highest": 80.0}), (DOWN, {"lowest": 20.0})])
@pytest.mark.parametrize("from_the_first", [True, False])
async def test_motion_without_positions_ends_before_the_altitude_limit(
    motor: bytes, limits: dict[str, float], from_the_first: bool
) -> None:
    async with Bridge("6-8se", presented="nexstar", surface="cpc", config=limits) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.GotoHorizontal(180.0, 50.0))
        await ready(bridge, client, b"e")
        client.send(motor)
        await extremes(bridge, 0.1 if from_the_first else 2.0)
        bridge.controller.reader.position_read.disconnect(bridge.controller.watch.check_position)
        low, high = await extremes(bridge, 10.0)
        assert 20.0 <= low <= high <= 80.0
        assert low < 28.0 or high > 72.0, "it is ended late, not at once"
        assert any("estimated from its speed" in note for note in notes(bridge))


async def test_motion_ended_in_time_triggers_no_deadline() -> None:
    async with Bridge("6-8se", presented="nexstar", surface="cpc", config={"highest": 80.0}) as bridge:
        client = bridge.client()
        client.send(UP)
        await asyncio.sleep(3.0)
        bridge.controller.reader.position_read.disconnect(bridge.controller.watch.check_position)
        client.send(b"P\x02\x11\x24\0\0\0\0")
        await asyncio.sleep(60.0)
        assert altitude(bridge) < 75.0
        assert not any("stopped" in note for note in notes(bridge))
        assert not bridge.controller.stop_count


async def test_nearest_of_two_limits_sets_the_deadline() -> None:
    rung: list[str] = []
    deadline = StopDeadline(asyncio.get_running_loop(), rung.append)
    deadline.arm(2.0, "second")
    deadline.arm(1.0, "first")
    deadline.arm(3.0, "third")
    await asyncio.sleep(0.99)
    assert rung == []
    await asyncio.sleep(5.0)
    assert rung == ["first"]
    deadline.arm(1.0, "another")
    deadline.disarm()
    await asyncio.sleep(2.0)
    assert rung == ["first"]
