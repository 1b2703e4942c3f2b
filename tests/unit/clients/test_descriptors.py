"""No file can be opened any more: programs are refused in words, and what is connected moves the mount all the same."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.core.errors import MappingError
from gateway.protocols.nexstar import counting
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.system import file_limits
from tests.support.in_process_gateway import Bridge
from tests.unit.transport.test_ports import address, ask, serving


class Resource(SimpleNamespace):
    """The limits of a process."""

    RLIMIT_NOFILE, RLIM_INFINITY = 7, -1

    def getrlimit(self, which: int) -> tuple[int, int]:
        return self.soft, self.hard

    def setrlimit(self, which: int, limits: tuple[int, int]) -> None:
        self.soft, self.hard = limits


@pytest.mark.parametrize(
    ("soft", "hard", "after", "says"),
    [
        (1024, 1048576, 1258, ""),
        (1024, -1, 1258, ""),
        (-1, -1, -1, ""),
        (4096, 4096, 4096, ""),
        (1024, 1024, 1024, "no more than about 966 programs can be connected, not the 1200 of max-clients;"),
        (256, 512, 512, "no more than about 454 programs"),
        (30, 30, 30, "no more than about 0 programs"),
    ],
)  # fmt: skip
def test_gateway_raises_its_file_limit_as_far_as_allowed(
    soft: int, hard: int, after: int, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = Resource(soft=soft, hard=hard)
    monkeypatch.setattr(file_limits, "resource", limits)
    words = file_limits.raise_file_limit(1200, 3)
    assert (limits.soft, limits.hard) == (after, hard)
    assert says in words if says else words == ""


@pytest.mark.real_time
async def test_client_without_a_free_descriptor_is_refused_in_one_line_and_admitted_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with serving("lx200@tcp://127.0.0.1:0") as gateway:
        notes: list[str] = []
        gateway.wire_log.sinks.append(lambda entry: notes.append(entry.note) if entry.arrow == "!" else None)
        here = await asyncio.open_connection(*address(gateway))
        assert await ask(here, b":GVP#")
        free = os.open(os.devnull, os.O_RDONLY)
        os.close(free)
        monkeypatch.setattr(
            file_limits, "open_file_limit", lambda: free + file_limits.RESERVED_FILES
        )  # the next one has this number
        for _ in range(5):
            reader, writer = await asyncio.open_connection(*address(gateway))
            with contextlib.suppress(ConnectionResetError):
                assert await reader.read() == b""
            writer.close()
        [line] = [note for note in notes if "refused on surface" in note]
        assert "files open at a time" in line
        assert "ulimit -n" in line
        assert await ask(here, b":GVP#") == b"Autostar#"
        monkeypatch.undo()
        late = await asyncio.open_connection(*address(gateway))
        assert await ask(late, b":GVP#") == b"Autostar#"
        late[1].close()
        here[1].close()


async def test_arrow_begins_though_no_file_can_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    counting.rate_tables.cache_clear()

    async def nothing_opens(function: Any, *arguments: Any) -> Any:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    def no_table(protocol: CommandSet, name: str) -> Any:
        raise MappingError(name, "[file]", os.strerror(errno.EMFILE))

    async with Bridge(state=tmp_path, in_thread=nothing_opens) as bridge:
        monkeypatch.setattr(CommandSet, "extra_table", no_table)
        client = bridge.client()
        for _ in range(3):
            client.send(b":RM#:Mn#")
            await asyncio.sleep(2.0)
            assert bridge.controller.wanted.axes_moved_by_hand == {2}
            client.send(b":Qn#")
            await asyncio.sleep(8.0)
            assert bridge.controller.wanted.axes_moved_by_hand == set()
        assert (
            len(
                [
                    words
                    for words in bridge.warned
                    if "motion marker" in words or "written" in words or "state file" in words
                ]
            )
            == 1
        )
        assert not any("internal error" in entry.note for entry in bridge.entries)


async def test_internal_error_in_an_arrow_request_is_logged(monkeypatch: pytest.MonkeyPatch) -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        client.send(b":RM#:Me#")
        await asyncio.sleep(2.0)

        async def defect(*_: Any) -> Any:
            raise ValueError("broken")

        monkeypatch.setattr(bridge.controller.admission, "admit", defect)
        client.send(b":Mn#")
        await asyncio.sleep(3.0)
        assert any("internal error" in entry.note and "broken" in entry.note for entry in bridge.entries)
        assert bridge.controller.wanted.axes_moved_by_hand == set()
