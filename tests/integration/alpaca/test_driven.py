"""An Alpaca telescope driven by the gateway, for programs that speak LX200 or NexStar: judged by where the tube is.

The telescope is the Alpaca surface of another gateway, over a simulated NexStar or Meade, reached by its lines.
"""

from __future__ import annotations

import asyncio

import pytest

from gateway.app.bindings import make_surface
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.clients.acceptor import ConnectionAcceptor
from gateway.core import operations as op
from gateway.core.errors import Fault, Unsupported
from gateway.mount.policy import Limits
from gateway.protocols.base.session import SharedSettings
from gateway.transport.handler import NewConnection
from tests.support.in_process_gateway import Bridge
from tests.support.two_gateways import TwoGateways


def chain(driven: str, model: str) -> TwoGateways:
    inner = Bridge(
        model, driven=driven, presented="alpaca", surface=None, latency=0.02, config={"lowest": -90.0, "sun": 0.0}
    )
    return TwoGateways(inner, "alpaca", "lx200", "autostar")


@pytest.mark.parametrize(("driven", "model"), [("nexstar", "6-8se"), ("lx200", "lx200gps")])
async def test_mount_behind_a_second_gateway_parks_unparks_and_tracks(driven: str, model: str) -> None:
    whole = chain(driven, model)
    sim = whole.inner.sim
    async with whole:
        ask = whole.controller.perform
        await ask(op.Park())
        for _ in range(60):
            await asyncio.sleep(2.0)
            if (await ask(op.GetActivity())).parked:
                break
        assert not sim.tracking and not sim.slewing
        with pytest.raises(Fault, match=r"parked: unpark it first.*says"):
            await ask(op.Goto(*sim.true_position()))
        await ask(op.Unpark())
        assert sim.tracking and not (await ask(op.GetActivity())).parked
        await ask(op.SetTracking(on=False, heard=True))
        assert not sim.tracking
        await ask(op.SetTracking(on=True, heard=True))
        assert sim.tracking
        if model == "6-8se":
            with pytest.raises(Unsupported, match="no home position"):
                await ask(op.Home())


async def test_alpaca_program_cannot_set_pier_side_past_the_gateways_checks() -> None:
    inner = Bridge("german", driven="alpaca", presented="lx200", config={"sun": 0.0})
    inner.sim.lacks -= {"sideofpier_put"}
    async with inner:
        face = inner.binding.surface
        made = make_surface(Endpoint("alpaca", "-"), SurfaceConfig(at="alpaca@-"), Limits())
        made.surface.speaks_mount_protocol = True
        assert face is not made.surface
        client = ConnectionAcceptor(inner.controller, made, SharedSettings(), inner.clock)
        heard: list[bytes] = []
        one = client.accept(NewConnection("x", "x", lambda data: heard.append(bytes(data))))
        for line in (b"put connected Connected=true", b"get doesrefraction", b"put sideofpier SideOfPier=1"):
            one.feed(line + b"\n")
            await asyncio.sleep(2.0)
        assert heard[:2] == [b"null\n", b"false\n"] and b"Not available" in heard[2]
        assert not any(b"put sideofpier" in line for line in inner.sent_requests())
        one.close()
