"""``:SB``: the rate of a real serial port changes after the answer, and comes back when nobody follows."""

from __future__ import annotations

import asyncio
import contextlib
import os
import termios
import tty

import pytest

from gateway.diagnostics.virtual_time import run
from gateway.transport import baud
from gateway.transport.serial_port import SerialPort
from tests.support.in_process_gateway import Bridge

SPEEDS = {termios.B9600: 9600, termios.B19200: 19200, termios.B38400: 38400, termios.B57600: 57600}


class Cable:
    """A pseudo-terminal pair: the gateway opens one end by name, the test holds the other."""

    def __init__(self) -> None:
        self.end, self._other = os.openpty()
        tty.setraw(self._other)
        os.set_blocking(self.end, False)
        self.name = os.ttyname(self._other)

    def rate(self) -> int:
        return SPEEDS[termios.tcgetattr(self._other)[5]]

    async def ask(self, data: bytes, seconds: float = 60.0) -> bytes:
        os.write(self.end, data)
        heard = b""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not heard:
                    await asyncio.sleep(0.01)
                    with contextlib.suppress(BlockingIOError):
                        heard += os.read(self.end, 100)
        return heard

    async def until(self, rate: int, seconds: float = 60.0) -> bool:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while self.rate() != rate:
                    await asyncio.sleep(0.01)
        return self.rate() == rate

    def close(self) -> None:
        os.close(self.end)
        os.close(self._other)


@pytest.mark.real_time
@pytest.mark.parametrize("follows", [True, False])
async def test_baud_rate_changes_after_the_answer_and_stays_if_the_program_follows(
    follows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(baud, "TRIAL_TIME", 1.0)
    cable = Cable()
    async with Bridge(latency=0.0) as bridge:
        port = await SerialPort.open(cable.name, bridge.acceptor.accept)
        assert cable.rate() == 9600
        assert await cable.ask(b":SB4#") == b"1"
        assert await cable.until(19200)
        os.write(cable.end, b":GVP#" if follows else b"\xf8\x87\x0f")  # what the wrong rate makes of it
        await asyncio.sleep(1.2)
        assert await cable.until(19200 if follows else 9600)
        assert await cable.ask(b":GVP#") not in (b"", b"1")
        await port.close()
    cable.close()


def test_second_baud_rate_change_falls_back_to_the_first_rate() -> None:
    async def program() -> None:
        rates = [9600]

        def change(rate: int) -> int:
            rates.append(rate)
            return rates[-2]

        trial = baud.BaudTrial(change)
        trial.begin(19200)
        await asyncio.sleep(1.0)
        trial.begin(38400)
        await asyncio.sleep(baud.TRIAL_TIME - 0.5)
        assert rates[-1] == 38400
        await asyncio.sleep(1.0)
        assert rates[-1] == 9600
        trial.begin(57600)
        trial.confirm()
        await asyncio.sleep(2 * baud.TRIAL_TIME)
        assert rates[-1] == 57600

    run(program())


async def test_baud_rate_change_is_acknowledged_without_a_serial_port() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        assert await client.ask(b":SB1#") == b"1"
        assert await client.ask(b":GVP#") == b"Autostar#"
