"""What all pages are shown is made once: often while something moves, once a second at rest."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from gateway.app.gateway import Gateway
from gateway.console.mounts import Mounts
from gateway.console.page_session import PageSession
from gateway.console.shown import view
from gateway.console.shown.publisher import MOTION_PERIOD, REST_PERIOD
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import VirtualLoop
from gateway.mount.controller import MountController
from tests.support import exact_sky
from tests.support.busy_computer import Busy, run_busy


class Page:
    """A page: what it was sent, and when. While it is ``stalled`` it reads nothing."""

    def __init__(self, mounts: Mounts) -> None:
        self.sent: list[tuple[float, dict[str, Any]]] = []
        self.texts: list[str] = []
        self.stalled = False
        self.session = PageSession(mounts, self, "10.0.0.1", may_control=True)
        self.task = asyncio.create_task(self.session.run())

    def unread_byte_count(self) -> int:
        return 1000 if self.stalled else 0

    async def send(self, text: str) -> None:
        self.texts.append(text)
        self.sent.append((asyncio.get_running_loop().time(), json.loads(text)))

    def told(self, since: float) -> list[dict[str, Any]]:
        """The states of the first mount."""
        return [message["mounts"][0] for at, message in self.sent if at >= since and "mounts" in message]

    def rows(self) -> list[str]:
        return [row["words"] for _, message in self.sent for row in message.get("talk", [])]

    async def closes(self) -> None:
        self.task.cancel()
        await asyncio.wait([self.task])


Work = Callable[[Busy, Mounts], Coroutine[Any, Any, None]]


@pytest.fixture(autouse=True)
def _surfaces(monkeypatch: pytest.MonkeyPatch) -> None:
    """The gateway of these tests lets programs in without a port, so it has none to tell of."""
    monkeypatch.setattr(Gateway, "names", lambda self: ["lx200@tcp://127.0.0.1:4030"])


def played(path: Path, work: Work) -> None:
    """A gateway over a simulated mount that has told where it points, and what its pages share."""

    async def evening() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        async with Busy(loop, "nexstar:cpc/4.21", "lx200") as busy:
            await asyncio.sleep(5.0)
            await work(busy, Mounts([busy.gateway]))

    run_busy(evening(), path.name)


def test_console_sends_ten_messages_a_second_in_motion_and_one_at_rest(tmp_path: Path) -> None:
    async def work(busy: Busy, mounts: Mounts) -> None:
        loop, controller = asyncio.get_running_loop(), busy.gateway.controller
        pages = [Page(mounts) for _ in range(10)]
        await asyncio.sleep(1.0)
        began = loop.time()
        await asyncio.sleep(10.0 * REST_PERIOD)
        assert 9 <= len(pages[0].told(began)) <= 12
        heard = len(pages[0].texts)
        while len(pages[0].texts) == heard:  # until a message has just come
            await asyncio.sleep(0.01)
        pages[1].session.receive('{"do":"narrow","lowest":1}')
        await asyncio.sleep(2.5 * MOTION_PERIOD)
        assert pages[0].told(0.0)[-1]["limits"]["lowest"] == 1.0, "a change is told at once"
        await controller.perform(op.Move(op.Direction.NORTH, op.Rate(key=5)))
        await asyncio.sleep(0.5)
        assert pages[0].told(0.0)[-1]["by_hand"]
        began = loop.time()
        await asyncio.sleep(20.0 * MOTION_PERIOD)
        assert 15 <= len(pages[0].told(began)) <= 21
        await controller.stop()
        for page in pages[1:]:
            assert [id(text) for text in page.texts[1:]] == [id(text) for text in pages[0].texts[1:]], "made once"
        for page in pages:
            await page.closes()

    played(tmp_path, work)


def test_page_that_does_not_read_gets_the_newest_state_later_and_delays_nobody(tmp_path: Path) -> None:
    async def work(busy: Busy, mounts: Mounts) -> None:
        loop, slow, other = asyncio.get_running_loop(), Page(mounts), Page(mounts)
        await asyncio.sleep(2.0)
        slow.stalled, began = True, loop.time()
        await asyncio.sleep(5.0)
        assert not slow.told(began) and len(other.told(began)) >= 4
        slow.stalled, began = False, loop.time()
        await asyncio.sleep(1.5)
        assert slow.texts[-1] == other.texts[-1] and len(slow.told(began)) <= 3
        await slow.closes()
        await other.closes()

    played(tmp_path, work)


def test_publisher_does_not_read_the_mounts_abilities_for_every_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work(busy: Busy, mounts: Mounts) -> None:
        asked = 0
        abilities = view.abilities

        def count(controller: MountController) -> dict[str, Any]:
            nonlocal asked
            asked += 1
            return abilities(controller)

        monkeypatch.setattr(view, "abilities", count)
        page = Page(mounts)
        await asyncio.sleep(4.9)
        assert asked <= 6 and page.told(0.0)[-1]["speeds"]
        await page.closes()

    played(tmp_path, work)


def test_page_shows_planets_once_the_precise_astronomy_is_loaded(tmp_path: Path) -> None:
    async def work(busy: Busy, mounts: Mounts) -> None:
        page = Page(mounts)
        await asyncio.sleep(1.0)
        assert [body["name"] for body in page.told(0.0)[-1]["bodies"]] == ["Sun", "Moon"]
        exact_sky.load(busy.gateway.sky)
        await asyncio.sleep(1.2)
        assert [body["name"] for body in page.told(0.0)[-1]["bodies"]] == list(view.BODIES)
        await page.closes()

    played(tmp_path, work)


def test_publisher_listens_to_no_log_while_no_page_is_open(tmp_path: Path) -> None:
    async def work(busy: Busy, mounts: Mounts) -> None:
        sinks = busy.gateway.wire_log.sinks
        before = len(sinks)
        pages = [Page(mounts), Page(mounts)]
        await asyncio.sleep(0.5)
        looking = len(sinks)
        assert looking > before
        for page in pages:
            page.session.receive('{"do":"talk","on":true}')
        await asyncio.sleep(0.5)
        assert len(sinks) == looking + 1
        for page in pages:
            await page.closes()
        assert len(sinks) == before
        last = Page(mounts)
        await asyncio.sleep(0.5)
        assert last.told(0.0)
        await last.closes()

    played(tmp_path, work)


def test_page_that_fell_behind_gets_every_missed_log_note(tmp_path: Path) -> None:
    async def work(busy: Busy, mounts: Mounts) -> None:
        page = Page(mounts)
        page.session.receive('{"do":"talk","on":true}')
        await asyncio.sleep(0.5)
        for number in range(5):
            page.stalled = number in (1, 2, 3)
            busy.gateway.wire_log.note("10.0.0.1:1", f"note {number}")
            await asyncio.sleep(0.3)
        assert [words for words in page.rows() if words.startswith("note")] == [f"note {one}" for one in range(5)]
        await page.closes()

    played(tmp_path, work)


def test_publisher_exception_disconnects_pages_and_a_reopened_page_is_served(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work(busy: Busy, mounts: Mounts) -> None:
        page = Page(mounts)
        await asyncio.sleep(0.5)
        notes = list[str]()
        busy.gateway.wire_log.sinks.append(lambda entry: notes.append(entry.note))
        with monkeypatch.context() as patch:
            patch.setattr(view, "bodies", lambda controller: 1 / 0)
            exact_sky.load(busy.gateway.sky)  # so they are asked for anew
            with pytest.raises(ConnectionError):
                await page.task
        assert any("ZeroDivisionError" in note for note in notes)
        page = Page(mounts)
        await asyncio.sleep(0.5)
        assert "bodies" in page.told(0.0)[-1]
        await page.closes()

    played(tmp_path, work)
