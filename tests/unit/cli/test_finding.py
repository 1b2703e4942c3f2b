"""What is said while a mount is looked for, and when none was found."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.app.config import parse_endpoint
from gateway.cli.serve import finding
from gateway.cli.serve.finding import not_found_message, waiting_message
from gateway.core.errors import UserError
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge


def gateway_of(bridge: Bridge, at: str) -> Any:
    """What the words are made from."""

    async def found(seconds: float) -> bool:
        await asyncio.sleep(seconds)
        return bool(bridge.controller.identified.is_set())

    return SimpleNamespace(
        controller=bridge.controller,
        mount=parse_endpoint(at),
        title=at,
        wait_identified=found,
        config=SimpleNamespace(baud=9600),
    )


async def met(bridge: Bridge, at: str, answer: bytes | None) -> tuple[bool, list[str], str]:
    """Look for a mount that answers this to everything, None: as it should -> found, what was said, why not."""
    if answer is not None:
        wire: Any = bridge.controller.line.wire
        wire._feed = lambda data: answer
    said: list[str] = []
    gateway = gateway_of(bridge, at)
    bridge.controller.start()
    found = await finding._found(gateway, said.append)
    words = not_found_message(gateway)
    await bridge.controller.close()
    return found, said, words


def test_only_where_nothing_ever_came_the_cable_is_doubted() -> None:
    async def program() -> None:
        found, said, words = await met(Bridge("lx200", driven="lx200"), "lx200@/dev/ttyUSB0", b"")
        assert not found
        assert said == ["lx200@/dev/ttyUSB0: waiting for the mount's first answer; a classic LX200 may take 9 s"]
        assert words == (
            "lx200@/dev/ttyUSB0: no mount answers (is it switched on, and the cable in the hand "
            "control?); mount-gateway detect tries every port, --wait keeps trying"
        )

    run(program())


def test_what_was_asked_and_what_came_is_said() -> None:
    async def program() -> None:
        began = asyncio.get_running_loop().time()
        found, _, words = await met(Bridge("lx200", driven="lx200"), "lx200@socket://10.0.0.2:4030", b"hello\r\n")
        assert not found
        assert words == (
            "lx200@socket://10.0.0.2:4030: something is there, and no Meade LX200 was found. The last question that "
            "went wrong was :GR#: it answered hello\\x0d\\x0a. So the cable carries bytes; the baud rate may be "
            "another one, or the mount speaks another protocol; mount-gateway detect socket://10.0.0.2:4030 looks "
            "closer, --wait keeps trying"
        )
        assert asyncio.get_running_loop().time() - began < 12.0

    run(program())


@pytest.mark.parametrize("at", ["lx200@/dev/ttyUSB0", "lx200:lx200@/dev/ttyUSB0"])
def test_it_is_said_what_a_mount_is_waited_for(at: str) -> None:
    async def program() -> None:
        bridge = Bridge("lx200", driven="lx200", latency=0.5, named="lx200:" in at)
        found, said, _ = await met(bridge, at, None)
        assert found
        seconds = 4 if "lx200:" in at else 9
        assert said == [f"{at}: waiting for the mount's first answer; a classic LX200 may take {seconds} s"]

    run(program())


def test_a_mount_that_tells_where_it_points_is_waited_for_by_name_only() -> None:
    async def program() -> None:
        bridge = Bridge("lx200", driven="lx200")
        bridge.controller.start()
        await asyncio.sleep(1.0)
        assert waiting_message(gateway_of(bridge, "lx200@-")) == (
            "lx200@-: a mount answers, and programs get its position; it may take 9 s to report its model"
        )
        await bridge.controller.close()

    run(program())


def test_what_cannot_be_opened_is_told_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    async def program() -> None:
        bridge = Bridge("lx200", driven="lx200")

        async def broken(*_: Any) -> None:
            raise OSError(2, "no such port")

        monkeypatch.setattr(bridge.controller.line.wire, "open", broken)
        bridge.controller.start()
        with pytest.raises(UserError, match="no such port; mount-gateway detect shows which ports there are"):
            await finding._find(gateway_of(bridge, "lx200@/dev/ttyUSB0"), print)
        assert asyncio.get_running_loop().time() < 1001.0
        await bridge.controller.close()

    run(program())
