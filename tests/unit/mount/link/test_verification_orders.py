"""An order does not wait for ever for older ones like it to be settled."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoAnswer
from gateway.mount.link.line import MountLink
from tests.support.in_process_gateway import Bridge
from tests.support.virtual import run


def test_an_order_that_is_never_clear_of_doubt_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    async def never(line: MountLink, ask: object) -> None:
        await asyncio.sleep(1e6)

    async def program() -> None:
        async with Bridge("cge") as bridge:
            monkeypatch.setattr(MountLink, "clear_of_doubt", never)
            began = bridge.controller.now()
            with pytest.raises(NoAnswer):
                await bridge.controller.perform(op.Backlash(1, 5))
            assert bridge.controller.now() - began < 20.0

    run(program())
