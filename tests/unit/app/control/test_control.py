"""How an order reaches a gateway: by a port and a secret in a file, and only so."""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path

import msgspec
import pytest

from gateway.app.control import reach
from gateway.app.control.exchange import AnswerParts, ControlEndpoint, read_endpoints, sign, to_datagrams, verify
from gateway.app.control.reach import ask
from gateway.app.control.server import ControlServer
from gateway.core import requests
from gateway.core.errors import NoAnswer
from gateway.core.requests import Answer

pytestmark = pytest.mark.real_time
STOPPED = Answer("done", "stopped")
Work = Callable[[requests.Request], Awaitable[Answer]]


async def _good(request: requests.Request) -> Answer:
    assert request == requests.StopRequest()
    return STOPPED


async def _dead(_: requests.Request) -> Answer:
    raise NoAnswer


async def _broken(_: requests.Request) -> Answer:
    raise RuntimeError("a defect")


async def _long(_: requests.Request) -> Answer:
    return Answer("done", "".join(chr(33 + number % 900) for number in range(12_000)))


def _asked(folder: Path, carry_out: Work, secret: str | None = None) -> Answer | None:
    """What a gateway answers to ``Stop``; with ``secret`` to somebody who has guessed it."""

    async def program() -> Answer | None:
        served = ControlServer([folder], "nexstar@dev_ttyUSB0", "nexstar@/dev/ttyUSB0", carry_out)
        await served.open()
        [(path, endpoint)] = read_endpoints(folder)
        assert path.stat().st_mode & 0o777 == 0o600
        assert (endpoint.mount, endpoint.pid, endpoint.state) == ("nexstar@/dev/ttyUSB0", os.getpid(), str(folder))
        if secret is not None:
            endpoint = msgspec.structs.replace(endpoint, secret=secret)
        answer = await ask(endpoint, requests.StopRequest(), 60.0)
        await served.close()
        assert read_endpoints(folder) == []
        return answer

    return asyncio.run(program())


@pytest.mark.parametrize(
    ("carry_out", "answer"),
    [
        (_good, STOPPED),
        (_dead, Answer("failed", "No answer from mount.", "NoAnswer")),
        (_broken, Answer("failed", "internal error, please report it: RuntimeError('a defect')")),
    ],
)
def test_control_request_is_answered_once_it_is_done(tmp_path: Path, carry_out: Work, answer: Answer) -> None:
    assert _asked(tmp_path, carry_out) == answer


@pytest.mark.parametrize(
    "line", ["", "stop", "{}", '{"type":"goto"}', '{"type":"fly","number":"1"}', "\0", '{"type":"stop"}\n', "\xff"]
)
def test_malformed_control_request_is_refused_in_words(tmp_path: Path, line: str) -> None:
    async def program() -> str:
        served, loop = ControlServer([tmp_path], "m", "m", _good), asyncio.get_running_loop()
        await served.open()
        [(_, endpoint)] = read_endpoints(tmp_path)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
            port.setblocking(False)
            port.connect(("127.0.0.1", endpoint.port))
            await loop.sock_sendall(port, sign(endpoint.secret, "1", f"ask {line}"))
            heard = [verify(endpoint.secret, await loop.sock_recv(port, 9216)) for _ in range(2)]
        await served.close()
        return str(heard[1])

    assert "has another version" in asyncio.run(program())


def test_long_control_answer_arrives_whole(tmp_path: Path) -> None:
    assert _asked(tmp_path, _long) == asyncio.run(_long(requests.StopRequest()))  # type: ignore[arg-type]


@pytest.mark.parametrize("secret", ["", "0" * 32, "x" * 300])
def test_control_request_without_the_secret_does_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, secret: str
) -> None:
    monkeypatch.setattr(reach, "RECEIPT_TIMEOUT", 0.3)
    done: list[None] = []

    async def counted(_: requests.Request) -> Answer:
        done.append(None)
        return STOPPED

    answer = _asked(tmp_path, counted, secret)
    assert answer is not None and "does not answer" in answer.text and answer.fault == "NoAnswer"
    assert done == []


def test_control_request_repeated_after_a_lost_answer_is_done_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every answer is lost the first time, and the work takes longer than the patience of who asks."""
    monkeypatch.setattr(reach, "RESEND_PERIOD", 0.05)
    done: list[None] = []

    async def slow(_: requests.Request) -> Answer:
        done.append(None)
        await asyncio.sleep(0.3)
        return STOPPED

    sent: list[tuple[str, str]] = []
    sending = ControlServer._send

    def lossy(control: ControlServer, number: str, text: str, addr: object) -> None:
        sent.append((number, text))
        if sent.count((number, text)) > 1:
            sending(control, number, text, addr)

    monkeypatch.setattr(ControlServer, "_send", lossy)
    assert _asked(tmp_path, slow) == STOPPED
    assert len(done) == 1


def test_control_client_waits_for_a_gateway_that_has_received_its_request(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reach, "RESEND_PERIOD", 0.05)
    monkeypatch.setattr(reach, "RECEIPT_TIMEOUT", 1.0)

    async def slow(_: requests.Request) -> Answer:
        await asyncio.sleep(1.3)
        return STOPPED

    assert _asked(tmp_path, slow) == STOPPED


async def test_random_datagrams_do_not_harm_the_control_port(tmp_path: Path) -> None:
    served = ControlServer([tmp_path], "m", "m", _good)
    await served.open()
    [(_, endpoint)] = read_endpoints(tmp_path)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for data in (
            b"",
            b"\0" * 3000,
            b"stop",
            b" ",
            b"x" * 60_000,
            sign("guessed", "1", "ask stop"),
            sign(endpoint.secret, "1", "stop"),
            sign(endpoint.secret, "", ""),
        ):
            stranger.sendto(data, ("127.0.0.1", endpoint.port))
    assert await ask(endpoint, requests.StopRequest(), 60.0) == STOPPED
    await served.close()


def test_forged_or_altered_control_message_is_rejected() -> None:
    assert verify("s", sign("s", "7", "ask stop")) == ("7", "ask stop")
    assert verify("t", sign("s", "7", "ask stop")) is None
    assert verify("s", sign("s", "7", "ask stop") + b"!") is None
    assert verify("s", b"\xff\xfe") is None
    gathered, told = AnswerParts(), to_datagrams("x" * 4500)
    assert [gathered.add(part) for part in (told[2], "tell 9 2 x", "tell x", "wait", told[0])] == [None] * 5
    assert gathered.add(told[1]) == "x" * 4500


def test_closing_gateway_answers_waiting_control_clients(tmp_path: Path) -> None:
    async def program() -> Answer | None:
        forever = asyncio.Event()

        async def never(_: requests.Request) -> Answer:
            await forever.wait()
            return STOPPED

        served = ControlServer([tmp_path], "m", "m", never)
        await served.open()
        [(_, endpoint)] = read_endpoints(tmp_path)
        asking = asyncio.ensure_future(ask(endpoint, requests.StopRequest(), 60.0))
        await asyncio.sleep(0.2)
        await served.close()
        return await asking

    answer = asyncio.run(program())
    assert answer is not None and answer.text.startswith("the gateway is shutting down")


# --- the files --------------------------------------------------------------------------------------------------


def _nobodys_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


async def test_control_file_of_a_killed_gateway_is_removed_and_junk_ignored(tmp_path: Path) -> None:
    endpoint = ControlEndpoint("lx200@COM3", 2**22 + 1, _nobodys_port(), "s")
    stale = tmp_path / "lx200@COM3.77.control"
    (tmp_path / "garbage.control").write_bytes(b"{")
    (tmp_path / "deep.control").write_bytes(b"[" * 60_000)
    (tmp_path / "folder.control").mkdir()
    (tmp_path / "link.control").symlink_to("/dev/zero")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.control")
    stale.write_bytes(msgspec.json.encode(endpoint))
    assert read_endpoints(tmp_path) == [(stale, endpoint)]
    assert await ask(endpoint, requests.StopRequest(), 60.0) is None
    served = ControlServer([tmp_path], "nexstar@sim", "nexstar@sim", _good)
    await served.open()
    assert not stale.exists()
    assert [found.mount for _, found in read_endpoints(tmp_path)] == ["nexstar@sim"]
    await served.close()


async def test_gateway_is_found_though_one_of_its_folders_is_not_writable(tmp_path: Path) -> None:
    (tmp_path / "full").write_text("")
    served = ControlServer([tmp_path / "full", tmp_path], "m", "m", _good)
    await served.open()
    [(_, endpoint)] = read_endpoints(tmp_path)
    assert (endpoint.state, await ask(endpoint, requests.StopRequest(), 60.0)) == (str(tmp_path / "full"), STOPPED)
    await served.close()
    nowhere = ControlServer([tmp_path / "full"], "m", "m", _good)
    with pytest.raises(OSError, match="Not a directory"):
        await nowhere.open()
    await nowhere.close()
