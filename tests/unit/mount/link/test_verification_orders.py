"""An order does not wait for ever for older ones like it to be settled."""

from __future__ import annotations

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoAnswer
from gateway.mount.link.answers import LateReplies
from tests.support.in_process_gateway import Bridge
from tests.support.virtual import run


def test_an_order_that_is_never_clear_of_doubt_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(late: LateReplies, ask: object, now: float) -> float:
        return now + 1e6

    async def program() -> None:
        async with Bridge("cge") as bridge:
            monkeypatch.setattr(LateReplies, "until", never)
            began = bridge.controller.now()
            with pytest.raises(NoAnswer):
                await bridge.controller.perform(op.Backlash(1, 5))
            assert bridge.controller.now() - began < 20.0

    run(program())
