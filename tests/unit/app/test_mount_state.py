"""Everything that shows a mount tells the same of it, because all of it is drawn from one value."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import msgspec
import pytest

from gateway.app.gateway import Gateway
from gateway.app.status import State, activity
from gateway.cli.serve.live import StatusLines
from gateway.console.shown.view import state as page_state
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.metrics import GAUGES, MountCounts
from gateway.fleet import mount_messages
from tests.support.each import each
from tests.support.in_process_gateway import Bridge


def faces(gateway: Gateway) -> tuple[State, dict[str, Any], dict[str, Any], str, dict[str, float]]:
    """What ``status``, the page, MQTT, the live line and the metrics tell at one moment."""
    page = page_state(gateway, 0)
    state = gateway.state()
    told = msgspec.json.decode(msgspec.json.encode(state.to_state()), type=State)
    gauges = {name: value(state, MountCounts(gateway.controller)) for name, _, value in GAUGES}
    return told, page, mount_messages.published_state(gateway), StatusLines([gateway]).line(), gauges


@each(
    ("does", "order"),
    [
        ("tracking", None),
        ("slewing", op.Goto(120.0, 30.0)),
        ("moved by hand", op.Move(op.Direction.NORTH, op.Rate(key=7))),
        ("not tracking", op.SetTracking(on=False)),
        ("held, tracking", "hold"),
        ("asleep", op.Hibernate()),
        ("down", "gone"),
    ],
)
async def test_status_page_mqtt_and_api_show_the_same_mount_state(
    does: str, order: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with Bridge("cpc", config={"sun": 0.0, "lowest": -90.0}) as bridge:
        controller = bridge.controller
        await asyncio.sleep(5.0)
        if isinstance(order, op.Operation):
            await controller.perform(order)
        elif order == "hold":
            controller.hold.is_on = True
        elif order == "gone":
            controller.line._mark_down("the mount does not answer")
        await asyncio.sleep(0.5)
        for read in (op.Position(), op.GetStatus()):
            with contextlib.suppress(Fault):
                await controller.read(read)
        state, page, mqtt, line, gauges = faces(bridge.gateway)
        look = state.look
        shown = look.state if does == "down" else activity(look)
        assert shown == does and does in line and mqtt["does"] == page["does"] == activity(look)
        assert look.moves is page["moves"] is mqtt["moving"] is (does in ("slewing", "moved by hand"))
        assert look.online is mqtt["online"] is bool(gauges["up"]) is (does != "down")
        assert look.held is page["held"] is mqtt["held"] and look.asleep is page["asleep"] is mqtt["asleep"]
        assert look.position is not None
        assert mqtt["ra_hours"] == round(look.position.ra / 15.0, 5) and page["position"]["ra"] == round(
            look.position.ra, 5
        )
        assert mqtt["altitude_degrees"] == pytest.approx(page["position"]["alt"], abs=0.01)
        assert (page["target"] is not None) is (does == "slewing") is any("goto to" in one for one in state.wanted)
        assert state.programs == () and gauges["clients"] == mqtt["programs"] == 0
