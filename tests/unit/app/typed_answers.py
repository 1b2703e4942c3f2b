"""Type checkers know which answer ``perform`` returns: mypy checks this module with the package (pyproject.toml)."""

from __future__ import annotations

from typing import assert_type

from gateway import BlockingMount, Mount, op
from gateway.core.operations.values import Chosen, Pulsed, Values


async def answers(gateway: Mount) -> None:
    assert_type(await gateway.perform(op.Position()), op.Equatorial)
    assert_type(await gateway.perform(op.HorizontalPosition()), op.Horizontal)
    assert_type(await gateway.perform(op.Slewing()), bool)
    assert_type(await gateway.perform(op.GetIdentity()), op.Identity)
    assert_type(await gateway.perform(op.SiderealTime()), float)
    assert_type(await gateway.perform(op.NativeRequest("get_version")), bytes)
    assert_type(await gateway.perform(op.Goto(80.0, 20.0)), None)
    assert_type(await gateway.perform(op.Pulse(op.Direction.NORTH, 100)), Pulsed | None)
    assert_type(await gateway.perform(op.PassThrough("get_version")), Values | None)
    assert_type(await gateway.perform(op.Choose("LM")), Chosen)
    assert_type(await gateway.site(), op.Place)


def answers_without_an_event_loop(gateway: BlockingMount) -> None:
    assert_type(gateway.perform(op.Position()), op.Equatorial)
    assert_type(gateway.perform(op.GetSite()), op.Place)
    assert_type(gateway.perform(op.Goto(80.0, 20.0)), None)
    assert_type(gateway.site(), op.Place)
    assert_type(gateway.time(), op.Moment)
    assert_type(gateway.goto_object("Vega"), None)
    assert_type(gateway.park(), None)
