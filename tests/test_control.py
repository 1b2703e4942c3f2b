"""How ``stop`` reaches a gateway: by a port and a secret in a file, and only so."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import msgspec
import pytest

from gateway import control
from gateway.cli import main
from gateway.control import Control, Door, ask_to_stop, doors
from gateway.errors import NoAnswer


async def _good() -> None:
    """Acknowledged."""


async def _dead() -> None:
    raise NoAnswer


async def _slow() -> None:
    await asyncio.sleep(60)


def _asked(directory: Path, stop: Callable[[], Awaitable[None]], secret: str | None = None) -> str | None:
    """What a gateway with that stop answers; with ``secret`` to somebody who has guessed it."""

    async def program() -> str | None:
        served = Control(directory, "nexstar@dev_ttyUSB0", "nexstar@/dev/ttyUSB0", stop)
        await served.open()
        [(path, door)] = doors(directory)
        assert path.stat().st_mode & 0o777 == 0o600
        answer = await ask_to_stop(path, door if secret is None else Door(door.mount, door.pid, door.port, secret))
        await served.close()
        assert doors(directory) == []
        return answer

    return asyncio.run(program())


@pytest.mark.parametrize(("stop", "answer"), [
    (_good, "stopped"),
    (_dead, "failed No answer from mount."),
    (_slow, "failed no answer from the mount within 0 s"),
])
def test_a_gateway_says_whether_its_mount_has_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: Callable[[], Awaitable[None]], answer: str
) -> None:
    monkeypatch.setattr(control, "ACKNOWLEDGED", 0.2)
    assert _asked(tmp_path, stop) == answer


@pytest.mark.parametrize("secret", ["", "0" * 32, "x" * 300])
def test_without_the_secret_nothing_is_stopped(tmp_path: Path, secret: str) -> None:
    stops: list[None] = []

    async def counted() -> None:
        stops.append(None)

    answer = _asked(tmp_path, counted, secret)
    assert answer is not None
    assert "does not answer" in answer
    assert stops == []


def test_what_cannot_be_looked_into_does_not_pass_for_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / "state"
    assert main(["stop", "--state", str(place)]) == 0
    assert "nothing to stop" in capsys.readouterr().out
    place.write_text("")
    assert main(["stop", "--state", str(place)]) == 2
    assert str(place) in capsys.readouterr().err


def test_what_a_killed_gateway_has_left_is_taken_away(tmp_path: Path) -> None:
    async def program() -> None:
        server = await asyncio.start_server(lambda *_: None, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        server.close()
        await server.wait_closed()
        stale = tmp_path / "lx200@COM3.77.control"
        (tmp_path / "garbage.control").write_bytes(b"{")
        for _ in range(2):
            stale.write_bytes(msgspec.json.encode(Door("lx200@COM3", 77, port, "s")))
            [(path, door)] = doors(tmp_path)
            assert await ask_to_stop(path, door) is None
            assert not stale.exists()
        stale.write_bytes(msgspec.json.encode(Door("lx200@COM3", 77, port, "s")))
        served = Control(tmp_path, "nexstar@sim", "nexstar@sim", _good)
        await served.open()
        assert not stale.exists(), "by the next gateway, too"
        await served.close()

    asyncio.run(program())
