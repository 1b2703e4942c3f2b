"""A server that carries out a motion long after it was ordered, perhaps after the stop that followed, by truth.

Its answer comes when the motion begins, or when it has ended. The wire over HTTP is the real one, without sockets.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Any
from urllib.parse import urlencode

import pytest

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from gateway.protocols.alpaca.driver.telescope_http import TelescopeHttp
from gateway.transport.http_wire import HttpRequest, HttpWire
from tests.support.each import each
from tests.support.in_process_gateway import Bridge
from tests.support.truth import moving

URL = "http://127.0.0.1:1"


class OverHttp(HttpWire):
    """``late`` are the seconds after which the server carries out what begins a motion, and answers; ``mute``: that
    answer is lost for good."""

    def __init__(self, sim: Any, late: float = 0.0, latency: float = 0.02) -> None:
        super().__init__(URL, TelescopeHttp(URL))
        self.sim, self.late, self._latency, self.mute = sim, late, latency, False

    async def _probe_server(self) -> tuple[tuple[str, int], bool]:
        return ("127.0.0.1", 1), True

    async def _fetch(self, session: object, request: HttpRequest) -> tuple[int, bytes]:
        await asyncio.sleep(self._latency + (self.late if request.is_motion else 0.0))
        fields = urlencode(request.params)
        status, text = self.sim.request(request.method, f"{request.path}?{fields}", fields.encode())
        if request.is_motion and self.mute:
            await asyncio.Event().wait()
        if self.sim.delayed:
            await asyncio.sleep(max(0.0, self.sim.mechanics.arrives(self.sim.now) - self.sim.now))
        return status, text.encode()


@contextlib.asynccontextmanager
async def connected(**simulated: Any) -> AsyncIterator[tuple[Bridge, OverHttp]]:
    config = {"sun": 0.0, "lowest": -90.0}
    async with Bridge("german", driven="alpaca", config=config, simulated=simulated) as bridge:
        wire = OverHttp(bridge.sim)
        bridge.controller.line.wire = wire
        bridge.controller.line.transaction.connection_lost("over HTTP from now on")
        await asyncio.sleep(5.0)
        yield bridge, wire


async def travelled(late: float, stop: float, goto: bool, **simulated: Any) -> tuple[float, float]:
    """Order a motion, and a stop so many seconds later. Return how far the tube went after it, and how long it took."""
    async with connected(**simulated) as (bridge, wire):
        wire.late = late
        goal = op.Goto((bridge.sim.sky.lst(bridge.clock()) + 60.0) % 360.0, 30.0)
        order = goal if goto else op.Move(op.Direction.SOUTH, op.Rate(degrees=2.0))
        asked = asyncio.ensure_future(bridge.controller.perform(order))
        await asyncio.sleep(stop)
        began, stood = bridge.clock(), bridge.sim.true_position()
        with contextlib.suppress(Fault):
            await bridge.controller.stop()
        took = bridge.clock() - began
        await asyncio.sleep(late + 8.0)
        assert not moving(bridge.sim)
        asked.cancel()
        with contextlib.suppress(Fault, asyncio.CancelledError):
            await asked
        return separation(*bridge.sim.true_position(), *stood), took


@pytest.mark.parametrize("blocks", [False, True], ids=["answered-as-it-begins", "answered-at-its-end"])
@pytest.mark.parametrize("goto", [True, False], ids=["goto", "arrow"])
@each("stop", [0.1, 1.0, 2.5, 5.0])
def test_late_motion_of_an_alpaca_server_ends_at_once_after_a_stop(goto: bool, blocks: bool, stop: float) -> None:
    far, took = run(travelled(4.0, stop, goto, blocks=blocks))
    assert took < 0.6
    assert far < 1.5  # the stop is repeated every half second


async def moved_by_another_program(after: float) -> bool:
    """Return whether an arrow of another program goes on, so many seconds after a stop of ours; the answer to our own
    arrow before it never came."""
    async with connected() as (bridge, wire):
        wire.mute = True
        asked = asyncio.ensure_future(bridge.controller.perform(op.Move(op.Direction.SOUTH, op.Rate(degrees=2.0))))
        await asyncio.sleep(1.0)
        await bridge.controller.stop()
        await asyncio.sleep(after)
        bridge.sim.request("PUT", "/api/v1/telescope/0/moveaxis", b"Axis=0&Rate=0.5")
        await asyncio.sleep(5.0)
        asked.cancel()
        with contextlib.suppress(Fault, asyncio.CancelledError):
            await asked
        return bool(moving(bridge.sim))


def test_stop_is_repeated_a_bounded_number_of_times_when_an_order_gets_no_answer() -> None:
    assert run(moved_by_another_program(after=16.0))
    assert not run(moved_by_another_program(after=3.0))  # it could still be our own that begins late
