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
        wire.feed = lambda data: answer
    said: list[str] = []
    gateway = gateway_of(bridge, at)
    bridge.controller.start()
    found = await finding._wait_for_mount(gateway, said.append)
    words = not_found_message(gateway)
    await bridge.controller.close()
    return found, said, words


async def test_cable_is_suspected_only_where_no_byte_ever_arrived() -> None:
    found, said, words = await met(Bridge("lx200", driven="lx200"), "lx200@/dev/ttyUSB0", b"")
    assert not found
    assert len(said) == 1 and "may take 9 s" in said[0]
    assert words.startswith("lx200@/dev/ttyUSB0: ") and "is it switched on" in words and "--wait" in words


async def test_failed_mount_search_says_what_was_sent_and_received() -> None:
    began = asyncio.get_running_loop().time()
    found, _, words = await met(Bridge("lx200", driven="lx200"), "lx200@socket://10.0.0.2:4030", b"hello\r\n")
    assert not found
    assert (
        ":GR#: it answered hello\\x0d\\x0a" in words
        and "baud rate" in words
        and "detect socket://10.0.0.2:4030" in words
    )
    assert asyncio.get_running_loop().time() - began < 12.0


@pytest.mark.parametrize("at", ["lx200@/dev/ttyUSB0", "lx200:lx200@/dev/ttyUSB0"])
async def test_run_says_how_long_the_first_answer_may_take(at: str) -> None:
    bridge = Bridge("lx200", driven="lx200", latency=0.5, named="lx200:" in at)
    found, said, _ = await met(bridge, at, None)
    assert found
    seconds = 4 if "lx200:" in at else 9
    assert len(said) == 1 and said[0].startswith(at) and f"may take {seconds} s" in said[0]


async def test_push_to_mount_is_waited_for_only_if_named() -> None:
    bridge = Bridge("lx200", driven="lx200")
    bridge.controller.start()
    await asyncio.sleep(2.0)
    assert "a mount answers" in waiting_message(gateway_of(bridge, "lx200@-"))
    await bridge.controller.close()


@pytest.mark.parametrize(("named", "seconds"), [(True, 4.0), (False, 9.0)])
async def test_run_waits_for_the_first_position_of_a_slow_classic_lx200(named: bool, seconds: float) -> None:
    """Half a second for each answer, and no answer to what a classic does not know."""
    now = asyncio.get_running_loop().time
    bridge = Bridge("lx200", driven="lx200", latency=0.5, named=named)
    began, said = now(), list[str]()
    bridge.controller.start()
    assert await finding._wait_for_mount(gateway_of(bridge, "lx200:lx200@-" if named else "lx200@-"), said.append)
    assert await bridge.client().ask(b":GR#", ending=b"#")
    assert now() - began < seconds - 0.3  # the process has to start, too
    await bridge.controller.close()


class Slow:
    """A port that opens and is silent; its hand control starts after some seconds."""

    def __init__(self, bridge: Bridge, after: float) -> None:
        self.said: list[str] = []
        self.times: list[float] = []
        self.heard = b""
        self._began = asyncio.get_running_loop().time()
        self._wire: Any = bridge.controller.line.wire
        self._feed, self._from = self._wire.feed, self._began + after
        self._wire.feed = self._answer

    def _answer(self, data: bytes) -> bytes:
        self.heard += data
        return bytes(self._feed(data)) if asyncio.get_running_loop().time() > self._from else b""

    def warn(self, words: str) -> None:
        self.said.append(words)
        self.times.append(asyncio.get_running_loop().time() - self._began)


async def nobody(where: str, baud: int) -> None:
    await asyncio.sleep(4.5)


async def test_slowly_starting_hand_control_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.diagnostics.detect.scan_port.answering_protocol", nobody)
    bridge, now = Bridge("gt", "101.0"), asyncio.get_running_loop().time
    began, slow = now(), Slow(bridge, 25.0)
    bridge.controller.start()
    await finding.find_mount(gateway_of(bridge, "nexstar@/dev/ttyUSB0"), slow.warn)
    assert 25.0 < now() - began < 30.0
    assert "asks for 40 s" in slow.said[-1] and "--no-wait" in slow.said[-1]
    assert 4.0 < slow.times[-1] < 4.5
    assert await bridge.client().ask(b":GR#", ending=b"#")
    await bridge.controller.close()


@pytest.mark.parametrize(
    ("longest", "least", "most", "hints"), [(finding.SEARCH_TIMEOUT, 40.0, 40.5, [4.0]), (0.0, 8.5, 9.5, [])]
)
async def test_search_for_a_mount_on_a_silent_port_is_given_up(
    longest: float, least: float, most: float, hints: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.diagnostics.detect.scan_port.answering_protocol", nobody)
    bridge, now = Bridge("cpc"), asyncio.get_running_loop().time
    began, slow = now(), Slow(bridge, 1000.0)
    bridge.controller.start()
    with pytest.raises(UserError, match=r"no mount answers \(.* --wait keeps trying"):
        await finding.find_mount(gateway_of(bridge, "nexstar@/dev/ttyUSB0"), slow.warn, longest)
    assert least < now() - began < most
    assert slow.times == pytest.approx([finding.WAITING_MESSAGE_DELAY, *hints], abs=0.5)
    await bridge.controller.close()


@pytest.mark.parametrize("longest", [finding.SEARCH_TIMEOUT, 0.0])
async def test_address_of_an_unsupported_protocol_is_refused_without_further_search(
    longest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.diagnostics.detect.scan_port.answering_protocol", nobody)
    bridge, now = Bridge("cpc"), asyncio.get_running_loop().time
    began, slow = now(), Slow(bridge, 1000.0)
    bridge.controller.start()
    with pytest.raises(UserError, match="AUX protocol"):
        await finding.find_mount(gateway_of(bridge, "nexstar@socket://1.2.3.4:2000"), slow.warn, longest)
    assert 8.5 < now() - began < 9.5
    assert slow.times == pytest.approx([finding.WAITING_MESSAGE_DELAY], abs=0.5)
    assert slow.heard and b";" not in slow.heard  # with it every packet of AUX begins
    await bridge.controller.close()


def test_run_reports_a_mount_with_a_wrong_protocol_or_garbage_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    async def program() -> None:
        now = asyncio.get_running_loop().time

        async def meade(where: str, baud: int) -> str | None:
            return "lx200" if where == "/dev/ttyUSB0" else None

        monkeypatch.setattr("gateway.diagnostics.detect.scan_port.answering_protocol", meade)
        for at, answer, words in (
            ("nexstar@/dev/ttyUSB0", b"", "the mount speaks lx200; write lx200@/dev/ttyUSB0"),
            ("nexstar@socket://1.2.3.4:2000", b"", "Celestron's AUX protocol: that is not supported"),
            ("nexstar@/dev/ttyUSB1", b"hello", "something answers, but not as a NexStar"),
        ):
            bridge, began = Bridge("cpc"), now()
            wire: Any = bridge.controller.line.wire
            wire.feed = lambda data, answer=answer: answer
            bridge.controller.start()
            with pytest.raises(UserError, match=words):
                await finding.find_mount(gateway_of(bridge, at), list[str]().append)
            assert now() - began < 12.0
            await bridge.controller.close()

    run(program())


async def test_port_that_cannot_be_opened_is_reported_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    bridge = Bridge("lx200", driven="lx200")

    async def broken(*_: Any) -> None:
        raise OSError(2, "no such port")

    monkeypatch.setattr(bridge.controller.line.wire, "open", broken)
    bridge.controller.start()
    with pytest.raises(UserError, match="mount-gateway detect shows which ports"):
        await finding.find_mount(gateway_of(bridge, "lx200@/dev/ttyUSB0"), print)
    assert asyncio.get_running_loop().time() < 1001.0
    await bridge.controller.close()
