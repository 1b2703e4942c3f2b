"""Cached replies: each is valid for as long as the readings that it was made of."""

from __future__ import annotations

from typing import Any

from gateway.clients.commands.turn import ReplyCache
from gateway.core import operations as op


class Controller:
    answer_version = 1

    def fresh_until(self, kinds: list[Any]) -> float:
        return 5.0 if op.Position in kinds else 9.0


def test_cached_reply_expires_with_the_readings_that_it_is_made_of() -> None:
    controller: Any = Controller()
    cache = ReplyCache(controller)
    cache.store(b"e", b"position", [op.Position], 0.0)
    cache.store(b"t", b"tracking", [op.GetStatus], 1.0)
    assert cache.look_up(b"e", 4.9) == (b"position", [op.Position])
    assert cache.look_up(b"e", 5.1) is None
