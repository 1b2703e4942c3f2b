"""What all pages are shown is made once, and programs have their turn between any two pieces of the work."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from gateway.app.gateway import Gateway
from gateway.console.shown import view
from gateway.console.shown.publisher import Publisher
from gateway.diagnostics.virtual_time import VirtualLoop
from gateway.mount.controller import MountController
from tests.support.busy_computer import Busy, run_busy

Work = Callable[[Busy, Publisher], Coroutine[Any, Any, None]]


@pytest.fixture(autouse=True)
def _surfaces(monkeypatch: pytest.MonkeyPatch) -> None:
    """The gateway of these tests lets programs in without a port, so it has none to tell of."""
    monkeypatch.setattr(Gateway, "names", lambda self: ["lx200@tcp://127.0.0.1:4030"])


def published(path: Path, work: Work) -> None:
    """A gateway over a simulated mount that has told where it points, and its publisher."""

    async def evening() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        async with Busy(loop, "nexstar:cpc/4.21", "lx200") as busy:
            await asyncio.sleep(5.0)
            await work(busy, Publisher([busy.gateway], lambda: [None]))

    run_busy(evening(), path.name)


def bodies(text: str) -> list[str]:
    """The names of the bodies that a frame tells of."""
    mounts = next(iter(json.loads(text).values()))["mounts"]
    return [body["name"] for body in (mounts[0] if isinstance(mounts, list) else mounts["0"])["bodies"]]


def test_a_frame_is_made_once_for_all_pages(tmp_path: Path) -> None:
    async def work(busy: Busy, publisher: Publisher) -> None:
        for _ in range(20):
            publisher.subscribe()
        first = await asyncio.gather(*(publisher.next(0) for _ in range(20)))
        second = await asyncio.gather(*(publisher.next(first[0].number) for _ in range(20)))
        assert len({id(frame) for frame in first}) == len({id(frame) for frame in second}) == 1
        assert first[0].whole is first[0].whole
        assert len(second[0].changes) < len(second[0].whole) / 2
        assert second[0].number == first[0].number + 1

    published(tmp_path, work)


def test_what_a_mount_can_is_not_asked_for_every_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def work(busy: Busy, publisher: Publisher) -> None:
        asked = 0
        abilities = view.abilities

        def count(controller: MountController) -> dict[str, Any]:
            nonlocal asked
            asked += 1
            return abilities(controller)

        monkeypatch.setattr(view, "abilities", count)
        publisher.subscribe()
        number = 0
        for _ in range(10):
            frame = await publisher.next(number)
            number = frame.number
        assert asked <= 4, "ten frames are two seconds"
        assert json.loads(frame.whole)["state"]["mounts"][0]["speeds"]

    published(tmp_path, work)


def test_programs_have_their_turn_between_any_two_pages(tmp_path: Path) -> None:
    async def work(busy: Busy, publisher: Publisher) -> None:
        turns, told = 0, []

        async def count() -> None:
            nonlocal turns
            while True:
                await asyncio.sleep(1e-5)
                turns += 1

        async def page() -> None:
            publisher.subscribe()
            await publisher.next((await publisher.next(0)).number)
            told.append(turns)

        counting = asyncio.create_task(count())
        await asyncio.gather(*(page() for _ in range(20)))
        counting.cancel()
        assert len(set(told)) == 20, told

    published(tmp_path, work)


def test_planets_are_shown_as_soon_as_the_astronomy_is_exact(tmp_path: Path) -> None:
    async def work(busy: Busy, publisher: Publisher) -> None:
        publisher.subscribe()
        frame = await publisher.next(0)
        assert bodies(frame.whole) == ["Sun", "Moon"]
        busy.gateway.sky.load()
        number = frame.number
        while (frame := await publisher.next(frame.number)).number < number + 2:
            pass
        assert bodies(frame.whole) == list(view.BODIES)

    published(tmp_path, work)


def test_who_is_not_shown_the_conversation_costs_nothing(tmp_path: Path) -> None:
    async def work(busy: Busy, publisher: Publisher) -> None:
        sinks = busy.gateway.wire_log.sinks
        before = len(sinks)
        publisher.subscribe()
        publisher.subscribe()
        looking = len(sinks)
        assert looking > before
        publisher.listen(1)
        publisher.listen(1)
        assert len(sinks) == looking + 1
        publisher.listen(-1)
        assert len(sinks) == looking + 1
        publisher.listen(-1)
        publisher.leave()
        assert len(sinks) == looking
        publisher.leave()
        assert len(sinks) == before
        publisher.subscribe()
        assert (await publisher.next(0)).number == 1
        publisher.leave()

    published(tmp_path, work)


def test_a_page_that_was_behind_misses_no_row_that_is_kept(tmp_path: Path) -> None:
    async def work(busy: Busy, publisher: Publisher) -> None:
        publisher.subscribe()
        publisher.listen(1)
        frame = await publisher.next(0)
        start = publisher.count
        for number in range(5):
            busy.gateway.wire_log.note("10.0.0.1:1", f"note {number}")
            frame = await publisher.next(frame.number)
        await publisher.next(frame.number)
        notes = [row["words"] for row in publisher.since(start) if row["words"].startswith("note")]
        assert notes == [f"note {number}" for number in range(5)]
        assert publisher.since(publisher.count) == []
        publisher.listen(-1)
        publisher.leave()

    published(tmp_path, work)


def test_a_defect_is_told_to_every_page_and_the_next_one_begins_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work(busy: Busy, publisher: Publisher) -> None:
        publisher.subscribe()
        frame = await publisher.next(0)
        with monkeypatch.context() as patch:
            patch.setattr(view, "bodies", lambda controller: 1 / 0)
            busy.gateway.sky.load()  # so they are asked for anew
            with pytest.raises(ZeroDivisionError):
                await publisher.next(frame.number)
            with pytest.raises(ConnectionError):
                await publisher.next(frame.number)
        publisher.subscribe()
        assert "bodies" in (await publisher.next(0)).whole
        publisher.leave()

    published(tmp_path, work)
