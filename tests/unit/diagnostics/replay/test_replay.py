"""A recorded evening replays: every client receives the bytes that it received then."""

from __future__ import annotations

import asyncio
import functools
import tempfile
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import pytest

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.app.recording.format import read
from gateway.app.recording.recorder import Recorder
from gateway.app.simulated import make_simulator
from gateway.core.wire_log import WireLog
from gateway.diagnostics.replay.replaying import Outcome, replay
from gateway.diagnostics.virtual_time import run
from gateway.mount.link.line import MountLink
from gateway.transport.handler import Connected
from gateway.transport.wires import SimulatedTransport
from tests.support.sampling import as_a_rule

EVENING = 1768514400.0
#: What each client sends, on three connections one after the other.
TURNS = as_a_rule(60, whole=120)
PAIRS = {
    "lx200 on nexstar": ("nexstar:cpc/4.21", "lx200"),
    "nexstar on lx200": ("lx200:lx200gps", "nexstar"),
    "lx200 on lx200": ("lx200:autostar", "lx200"),
    "lx200 on a port for every protocol": ("nexstar:cpc/4.21", "any"),
}
LX200 = (
    b":GR#",
    b":GD#",
    b":GA#:GZ#",
    b":D#",
    b":GS#",
    b":Sr05:34:32#",
    b":Sd+22*00:52#",
    b":MS#",
    b":GL#",
    b":RM#:Mn#",
    b":Qn#",
    b":junk#",
    b":Q#",
    b":GVP#",
    b"\x06",
)
NEXSTAR = (
    b"e",
    b"z",
    b"L",
    b"J",
    b"r34AB0500,12CE0500",
    b"h",
    b"w",
    b"t",
    b"M",
    b"V",
    b"Kx",
    bytes((80, 2, 16, 36, 5, 0, 0, 0)),
    bytes((80, 2, 16, 36, 0, 0, 0, 0)),
    b"m",
)


class _Mute(SimulatedTransport):
    """A simulated mount whose cable comes off for a while."""

    async def open(self, on_data: Any, on_lost: Any) -> None:
        self.lose = lambda: on_lost("pulled out")
        await super().open(on_data, on_lost)


@functools.cache
def _evening(mount: str, presented: str) -> tuple[bytes, bytes]:
    """Such an evening's recording, and all that the clients were told: whoever breaks the recording has a copy."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "evening.rec"
        told = _live(path, mount, presented)
        return path.read_bytes(), told


def _live(path: Path, mount: str, presented: str) -> bytes:
    """An evening with three clients and one lost cable, recorded -> all that the clients were told."""
    told = bytearray()

    async def evening() -> None:
        loop = asyncio.get_running_loop()
        began = loop.time()

        def clock() -> float:
            return EVENING + loop.time() - began

        config, surfaces = MountConfig(at=f"{mount}@sim"), [SurfaceConfig(at=f"{presented}@tcp://:0")]
        transcript = WireLog(clock)
        gateway = Gateway(config, surfaces, transcript, clock=clock)
        wire = _Mute("sim", make_simulator(gateway.mount, clock=clock, speed=3.0).connection, 0.0731)
        settings = {"began": clock(), "config": {"mount": config, "surface": surfaces}, "past": gateway.previous_run,
                    "rules": gateway.rules}  # fmt: skip
        recorder = Recorder(path, loop.time, msgspec.to_builtins(settings), longest=200_000)
        transcript.sinks.append(recorder.put)
        gateway.prepare(lambda reply_rules, to: MountLink(wire, reply_rules, to))
        gateway.begin()
        random = Random(path.name)
        words = NEXSTAR if presented == "nexstar" else LX200

        async def client(number: int) -> None:
            await asyncio.sleep(0.31 * number)
            for turn in range(TURNS):
                if turn % (TURNS // 3) == 0:
                    guest = gateway.acceptors[0].accept(
                        Connected(f"10.0.0.{number}:{turn}", f"10.0.0.{number}", told.extend, lambda last: None)
                    )
                guest.feed(words[turn * (number + 1) % len(words)])
                await asyncio.sleep(random.uniform(0.1, 0.3))

        clients = [asyncio.create_task(client(number)) for number in (1, 2, 3)]
        await asyncio.sleep(TURNS * 0.08)
        wire.lose()
        await asyncio.gather(*clients)
        await asyncio.sleep(2.0)
        await gateway.close()
        recorder.close()

    run(evening())
    return bytes(told)


def _replayed(path: Path) -> Outcome:
    return replay(read(path))


@pytest.mark.parametrize("pair", PAIRS)
def test_every_client_receives_the_same_bytes_again(pair: str, tmp_path: Path) -> None:
    path = tmp_path / "evening.rec"
    recording, told = _evening(*PAIRS[pair])
    path.write_bytes(recording)
    outcome = _replayed(path)
    assert outcome.differences == []
    assert outcome.strayed == []
    assert outcome.clients == 9
    assert outcome.replies > as_a_rule(80, whole=150) and outcome.requests > 50
    assert len(told) >= as_a_rule(400, whole=1000)


def test_a_recording_of_an_older_format_replays() -> None:
    outcome = _replayed(Path(__file__).parent / "recordings" / "format-1.rec")
    assert outcome.differences == []
    assert outcome.strayed == []
    assert (outcome.clients, outcome.replies, outcome.requests) == (9, 79, 96)
    assert "older format" in outcome.guessed


def test_another_answer_of_the_mount_shows(tmp_path: Path) -> None:
    path = tmp_path / "evening.rec"
    lines = _evening(*PAIRS["lx200 on nexstar"])[0].decode("latin-1").split("\n")
    touched = [n for n, line in enumerate(lines) if " mount < " in line and len(line.split(" ")[3]) == 18]
    for n in touched[4:]:
        lines[n] = lines[n][:-18] + "1234" + lines[n][-14:]
    path.write_text("\n".join(lines), "latin-1")
    assert _replayed(path).differences
