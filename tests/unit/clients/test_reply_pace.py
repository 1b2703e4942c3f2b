"""Replies leave at the pace of a serial line where programs were written beside one; commands act when they arrive."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.app.bindings import make_surface
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.clients.reply_pace import HARDWARE_REPLY_TIME, delay_replies
from gateway.mount.policy import Limits
from gateway.transport.handler import NewConnection
from tests.support.process import Running

#: How often the script below asks, and what it prints: how many replies it has lost.
TIMES = 10
SCRIPT = """
import os, sys, termios, time, tty
port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
tty.setraw(port)
os.set_blocking(port, False)
lost = 0
for _ in range(int(sys.argv[2])):
    os.write(port, b":GR#")
    time.sleep(0.001)
    termios.tcflush(port, termios.TCIFLUSH)
    heard, until = b"", time.monotonic() + 5.0
    while not heard.endswith(b"#") and time.monotonic() < until:
        try:
            heard += os.read(port, 64)
        except BlockingIOError:
            time.sleep(0.0005)
    lost += not heard.endswith(b"#")
print(lost)
"""


class Echo:
    """Answers each byte at once, and notes when it acted."""

    def __init__(self, connected: NewConnection) -> None:
        self.write, self.change, self.acted = connected.write, connected.change_baud, list[float]()
        self.all_answered = True

    def feed(self, data: bytes) -> None:
        self.acted.append(asyncio.get_running_loop().time())
        if data == b"B" and self.change is not None:
            self.write(b"1")
            self.change(19200)
        else:
            self.write(data)

    def close(self) -> None: ...

    def peer_closed(self) -> None: ...


async def paced_echo(seconds: float) -> tuple[Any, Echo, list[tuple[float, bytes]], list[int]]:
    heard: list[tuple[float, bytes]] = []
    rates: list[int] = []
    made: list[Echo] = []
    now = asyncio.get_running_loop().time

    def accept(connected: NewConnection) -> Echo:
        made.append(Echo(connected))
        return made[0]

    def write(data: bytes) -> None:
        if data:
            heard.append((now(), data))

    def change(baud: int) -> int:
        assert heard, "the acknowledgement leaves at the old rate"
        rates.append(baud)
        return 9600

    connected = NewConnection("x", "x", write, change_baud=change)
    return delay_replies(accept, seconds)(connected), made[0], heard, rates


async def test_paced_reply_waits_while_its_command_acts_at_once() -> None:
    port, echo, heard, _ = await paced_echo(0.006)
    now = asyncio.get_running_loop().time
    began = now()
    port.feed(b":GR#")
    assert echo.acted == [began] and not heard and not port.all_answered
    await asyncio.sleep(0.02)
    assert heard == [(pytest.approx(began + 0.006), b":GR#")] and port.all_answered


async def test_paced_continuous_stream_of_bytes_is_delayed_only_by_one_pace() -> None:
    port, _, heard, _ = await paced_echo(0.006)
    began = asyncio.get_running_loop().time()
    for _ in range(20):
        port.feed(b"a")
        await asyncio.sleep(0.001)
    await asyncio.sleep(0.02)
    assert b"".join(data for _, data in heard) == b"a" * 20
    assert heard[0][0] - began == pytest.approx(0.006) and heard[-1][0] - began < 0.0265
    assert len(heard) < 10


async def test_baud_rate_changes_after_its_acknowledgement_and_discards_old_bytes() -> None:
    port, _, heard, rates = await paced_echo(0.006)
    port.feed(b"B")
    assert [data for _, data in heard] == [b"1"] and rates == [19200]
    port.feed(b"late")
    port.close()
    await asyncio.sleep(0.02)
    assert len(heard) == 1


def test_reply_without_a_pace_is_written_directly() -> None:
    def accept(connected: NewConnection) -> Echo:
        return Echo(connected)

    assert delay_replies(accept, 0.0) is accept
    assert 0.005 <= HARDWARE_REPLY_TIME <= 0.01


@pytest.mark.skipif(sys.platform != "linux", reason="pseudo-terminals and tcflush as on Linux")
def test_program_that_discards_its_input_after_writing_loses_no_reply(tmp_path: Path, started: list[Running]) -> None:
    """A busy computer delays the program, hence a longer pace than the usual one."""
    port = tmp_path / "port"
    gateway = Running("run", "--mount", "nexstar:6-8se@sim", "--surface", f"lx200@pty:{port}", "--reply-after", "500")
    started.append(gateway)
    gateway.ready()
    command = [sys.executable, "-c", SCRIPT, str(port), str(TIMES)]
    lost = int(subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=True).stdout)
    assert lost <= TIMES // 5


@pytest.mark.parametrize(
    ("where", "written", "sign"),
    [
        ("tcp://127.0.0.1:4030", None, b"*"),
        ("pty:/tmp/port", None, b"\xdf"),
        ("/dev/ttyUSB1", None, b"\xdf"),
        ("rfc2217://127.0.0.1:4030", None, b"\xdf"),
        ("tcp://127.0.0.1:4030", "0xDF", b"\xdf"),
        ("pty:/tmp/port", "*", b"*"),
    ],
)
def test_degree_character_of_replies_follows_the_setting_of_the_port(where: str, written: Any, sign: bytes) -> None:
    config = SurfaceConfig(at=f"lx200@{where}", degree=written)
    binding = make_surface(Endpoint("lx200", where), config, Limits())
    write: Callable[[str, bytes], bytes] = binding.surface.to_mount_form
    for reply in (b"+45*30:15#", b"90*#", b"351*40#", b"-00*05#"):
        assert write("GD", reply) == reply.replace(b"*", sign)
    for text in (b"M31 * GAL#", b"12:34:56#", b"0", b"LX2001#"):
        assert write("LI", text) == text
