"""A port that is unplugged and plugged in again, in real time."""

from __future__ import annotations

import asyncio

from tests.support.replug import replug


def test_programs_survive_unplugging_and_replugging_the_port() -> None:
    figures = asyncio.run(replug(2, seed=1))
    assert figures["up"]
    assert not figures["wrong"]
    assert not figures["dropped"]
    assert figures["answered"] == figures["asked"] > 0
