"""The pace of a simulated serial line: ten bits a byte, each way, one byte after the other."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest

from gateway.app.simulated import _SimulatedConnection, serve_simulator
from gateway.protocols.nexstar.simulator.hand_control import SimulatedHandControl
from gateway.transport.baud import MAX_WAITING_BYTES, PacedLine
from tests.support.simulated_meade import Clock

#: Seconds that a byte takes at 9600 baud.
BYTE = 10.0 / 9600.0


async def test_paced_bytes_arrive_one_after_the_other() -> None:
    loop = asyncio.get_running_loop()
    began, heard = loop.time(), []
    pace = PacedLine(9600, lambda data: heard.append((data, loop.time() - began)))
    pace.send(b"ab")
    await asyncio.sleep(1.5 * BYTE)
    pace.send(b"c")  # behind those that are on the line
    await asyncio.sleep(10 * BYTE)
    pace.send(b"d")  # on an idle one
    await asyncio.sleep(2 * BYTE)
    assert [data for data, _ in heard] == [b"a", b"b", b"c", b"d"]
    assert [at for _, at in heard] == pytest.approx([BYTE, 2 * BYTE, 3 * BYTE, 12.5 * BYTE])


async def test_paced_bytes_that_arrive_too_fast_are_lost_and_closing_drops_the_rest() -> None:
    heard: list[bytes] = []
    pace = PacedLine(9600, heard.append)
    pace.send(b"x" * (2 * MAX_WAITING_BYTES))
    await asyncio.sleep((MAX_WAITING_BYTES + 1) * BYTE)
    assert len(b"".join(heard)) == MAX_WAITING_BYTES
    pace.send(b"gone")
    pace.close()
    await asyncio.sleep(1.0)
    assert b"gone" not in b"".join(heard)


@pytest.mark.parametrize(
    ("baud", "latency", "seconds"), [(9600, 0.0, 19 * BYTE), (9600, 0.2, 0.2 + 19 * BYTE), (None, 0.0, 0.0)]
)
async def test_simulator_answer_takes_as_long_as_its_baud_rate_needs(
    baud: int | None, latency: float, seconds: float
) -> None:
    """``e`` is one byte, its answer eighteen."""
    loop = asyncio.get_running_loop()
    heard = b""

    def hear(data: bytes) -> None:
        nonlocal heard
        heard += data

    caller = _SimulatedConnection(SimulatedHandControl("cpc", clock=Clock()), latency, baud, hear)
    began = loop.time()
    caller.feed(b"e")
    while len(heard) < 18:
        await asyncio.sleep(BYTE / 8)
    assert loop.time() - began == pytest.approx(seconds, abs=BYTE / 4)
    caller.feed(b"e")
    caller.close()
    await asyncio.sleep(1.0)
    assert len(heard) == (18 if baud else 36)


@pytest.mark.parametrize(("place", "baud", "least"), [
    ("tcp://127.0.0.1:0", None, 0.0), ("tcp://127.0.0.1:0", 1200, 0.15), ("pty", None, 0.019), ("pty", 1200, 0.15),
])  # fmt: skip
def test_simulator_delays_bytes_on_pseudo_terminals_and_on_tcp_by_option(
    place: str, baud: int | None, least: float, tmp_path: Path
) -> None:
    """Nineteen bytes: 0.02 s at 9600 baud, 0.16 s at 1200."""
    serial = pytest.importorskip("serial")

    async def program() -> float:
        where = f"pty:{tmp_path / 'mount'}" if place == "pty" else place
        [port] = await serve_simulator(SimulatedHandControl("cpc", clock=time.time), [where], 0.0, baud)
        try:
            return await asyncio.to_thread(ask, port.address)
        finally:
            await port.close()

    def ask(where: str) -> float:
        url = where.removeprefix("pty:").replace("tcp://", "socket://")
        with serial.serial_for_url(url, baudrate=baud or 9600, timeout=60.0) as line:
            began = time.monotonic()
            line.write(b"e")
            assert len(line.read(18)) == 18
            return time.monotonic() - began

    assert least <= asyncio.run(program()) < least + 2.0
