"""A night that is recorded while pages are open replays: what they do is in the recording, what they see is not."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from random import Random
from typing import Any

import pytest

from gateway.app.gateway import Gateway
from gateway.app.recording.format import read
from gateway.console.mounts import Mounts
from gateway.console.page_session import PageSession
from gateway.diagnostics.replay.replaying import replay
from tests.support.busy_computer import Recorded, run_busy
from tests.support.sampling import as_a_rule

#: What pages ask for; each time one of these.
ASKED: tuple[dict[str, Any], ...] = (
    {"do": "goto", "ra": 83.6, "dec": 22.0},
    {"do": "goto", "ra": 83.6, "dec": -80.0},
    {"do": "jog", "direction": "north", "rate": 7},
    {"do": "jog", "direction": "east", "rate": 3},
    {"do": "let_go"},
    {"do": "stop"},
    {"do": "hold"},
    {"do": "release"},
    {"do": "track", "on": True, "rate": "lunar"},
    {"do": "site", "latitude": 48.1, "longitude": 11.6},
    {"do": "sync", "ra": 80.0, "dec": 30.0},
    {"do": "ask", "ra": 80.0, "dec": 30.0},
    {"do": "record", "on": True},
    {"do": "record", "on": False},
    {"do": "talk", "on": True},
    {"do": "park"},
    {"do": "narrow", "lowest": 30.0},
    {"do": "narrow"},
    {"do": "look"},
    {"do": "guide", "direction": "w", "ms": 300},
    {"do": "guide_rate", "rate": 0.25},
    {"do": "unpark"},
    {"do": "beat"},
)
SECONDS = as_a_rule(5.0, whole=25.0)


class _Browser:
    """Takes what it is sent; now and then it has not taken the last of it."""

    def __init__(self, random: Random) -> None:
        self.states, self._random = 0, random

    def waiting(self) -> int:
        return self._random.choice((0, 0, 0, 200_000))

    async def send(self, text: str) -> None:
        value = json.loads(text)
        assert "internal error" not in value.get("words", "")
        self.states += "state" in value or "diff" in value
        await asyncio.sleep(self._random.choice((0.0, 0.0, 0.3)))


async def _page(mounts: Mounts, recorded: Recorded, random: Random, browser: _Browser) -> None:
    """A person who does this and that, and comes back after having gone."""
    loop = recorded.loop
    end = loop.time() + SECONDS
    while loop.time() < end:
        session = PageSession(mounts, browser, "10.0.0.9", acts=True)
        shown = asyncio.ensure_future(session.run())
        for number in range(1, random.randrange(5, 40)):
            session.take(json.dumps({"id": number, **random.choice(ASKED)}))
            await asyncio.sleep(random.choice((0.0, 0.05, 0.4, 1.0)))
        shown.cancel()
        await asyncio.wait([shown])


async def _program(recorded: Recorded, random: Random) -> None:
    told = bytearray()
    guest = recorded.arrive("10.0.0.1:4711", told.extend)
    end = recorded.loop.time() + SECONDS
    while recorded.loop.time() < end:
        guest.feed(
            random.choice((b":GR#", b":GD#", b":GA#", b":D#", b":Mn#", b":Q#", b":Sr05:34:32#:Sd+22*00:52#:MS#"))
        )
        await asyncio.sleep(random.choice((0.0, 0.03, 0.2)))
    guest.close()


@pytest.mark.parametrize("mount", ["nexstar:cpc/4.21", "lx200:lx200gps"])
def test_a_night_with_pages_replays(tmp_path: Path, mount: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    monkeypatch.setattr(Gateway, "names", lambda self: ["lx200@tcp://127.0.0.1:4030"])  # it has no port to tell of
    path = tmp_path / "night.rec"

    async def night() -> int:
        async with Recorded(path, mount, "lx200") as recorded:
            mounts, browsers = Mounts([recorded.gateway]), [_Browser(Random(number)) for number in range(3)]
            pages = [_page(mounts, recorded, Random(number), browser) for number, browser in enumerate(browsers)]
            await asyncio.gather(*pages, _program(recorded, Random(9)))
            return sum(browser.states for browser in browsers)

    assert run_busy(night(), mount) > as_a_rule(50, whole=100)
    outcome = replay(read(path))
    assert (outcome.differences, outcome.strayed) == ([], [])
    assert outcome.replies > as_a_rule(25, whole=50)
    assert " c " in path.read_text("utf-8"), "what pages ask for is not in the recording"
