"""A recording made on a busy computer replays: not one reply of a crowd is another, whole and part by part."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import signal
import stat
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random

import pytest

from gateway.app.control.orders import stopped
from gateway.app.recording.format import read
from gateway.app.state.file import MarkerContent
from gateway.cli import main
from gateway.core.wire_log import SKY_READY
from gateway.diagnostics.replay.replaying import Outcome, replay
from gateway.mount.motion.left_moving import LeftMotion
from gateway.transport.handler import ConnectionRefused
from tests.support.busy_computer import Overtaking, Recorded, run_busy
from tests.support.process import Running, ask
from tests.support.proven import EVENING, Proven, run_calm
from tests.support.sampling import as_a_rule

LX200 = (
    b":GR#",
    b":GR#",
    b":GD#",
    b":GD#",
    b":GA#:GZ#",
    b":D#",
    b":GL#",
    b":GC#",
    b":Sr05:34:32#:Sd+22*00:52#",
    b":MS#",
    b":Mn#",
    b":Qn#",
    b":Q#",
    b":GV",
    b"P#",
    b":junk#",
    b"\x06",
)
NEXSTAR = (
    b"e",
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
    b"K",
    b"x",
    b"P\x02\x10\x24\x05\x00\x00\x00",
    b"P\x02\x10\x24\x00\x00\x00\x00",
)
PAIRS = {
    "lx200 on nexstar": ("nexstar:cpc/4.21", "lx200", LX200),
    "nexstar on lx200": ("lx200:lx200gps", "nexstar", NEXSTAR),
    "lx200 on lx200": ("lx200:autostar", "lx200", LX200),
    "lx200 on alpaca": ("alpaca:german", "lx200", LX200),
}


async def _program(recorded: Recorded, number: int, words: tuple[bytes, ...], until: float) -> None:
    """A program that asks faster than the mount answers, and now and then begins anew."""
    random, loop, told = Random(number), recorded.loop, bytearray()
    while loop.time() < until:
        try:
            guest = recorded.arrive(f"10.0.{number}.1:{random.randrange(10_000)}", told.extend)
        except ConnectionRefused:
            await asyncio.sleep(0.3)
            continue
        for _ in range(random.randrange(1, 60)):
            guest.feed(random.choice(words))
            await asyncio.sleep(random.choice((0.0, 0.01, 0.04, 0.1)))
        if number % 2:
            guest.peer_closed()  # it sends no more, and is still told what is due to it
            await asyncio.sleep(0.05)
        guest.close()


def _live(path: Path, pair: str, *, seconds: float = 5.0, many: int = 30, longest: int = 10_000_000) -> None:
    mount, presented, words = PAIRS[pair]

    async def night() -> None:
        async with Recorded(path, mount, presented, longest, max_clients=max(1, many - 3)) as recorded:
            loop = recorded.loop
            crowd = [asyncio.create_task(_program(recorded, n, words, loop.time() + seconds)) for n in range(many)]
            await asyncio.sleep(seconds / 3)
            recorded.wire.lose()
            recorded.ahead = 3600.0  # somebody sets the computer's clock
            recorded.gateway.sky.load()
            loop.enter(recorded.gateway.wire_log.note, "mount", SKY_READY)
            await asyncio.sleep(seconds / 3)
            with contextlib.suppress(Exception):
                await recorded.gateway.entrance.carry_out("s", recorded.gateway.controller.stop)
            recorded.gateway.entrance.apply_event("d", recorded.gateway.was_stopped)
            await recorded.gateway.entrance.carry_out("o", lambda: stopped(recorded.gateway.controller))
            await asyncio.gather(*crowd)

    run_busy(night(), path.name)


@functools.cache
def _played(pair: str, many: int) -> bytes:
    """What is in the recording of such a night: every test that only reads it, or breaks its own copy, has the same."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "night.rec"
        _live(path, pair, many=many)
        return path.read_bytes()


def _replayed(path: Path) -> Outcome:
    outcome = replay(read(path))
    assert outcome.differences == []
    assert outcome.strayed == []
    return outcome


@pytest.mark.parametrize("pair", as_a_rule([*PAIRS][:3], whole=[*PAIRS]))
def test_not_one_reply_of_a_crowd_is_another(pair: str, tmp_path: Path) -> None:
    path = tmp_path / "many.rec"  # by its name the computer is busy: with some there is hardly time for a crowd
    _live(path, pair, seconds=as_a_rule(3.5, whole=7.0), many=as_a_rule(15, whole=30))
    outcome = _replayed(path)
    assert outcome.clients > as_a_rule(20, whole=40)
    assert outcome.replies > as_a_rule(150, whole=300)
    assert outcome.requests > 60
    text = path.read_text("latin-1")
    for wanted in ("refused on surface", " mount l pulled out", " mount s", " mount d", " mount o", " mount q"):
        assert wanted in text
    assert text.count(" mount k ") == 2


def test_a_stop_overtakes_a_read_of_a_mount_over_http_also_while_it_is_recorded(tmp_path: Path) -> None:
    """The reply to the read that was given up may arrive just then; each takes 0.3 s."""
    path, sent, late = tmp_path / "night.rec", list[float](), list[float]()

    async def night() -> None:
        async with Recorded(path, "alpaca:german@http://127.0.0.1:9", "lx200") as recorded:
            loop, write = recorded.loop, recorded.wire.write

            def noted(data: bytes) -> None:
                sent.extend([loop.time()] if data.startswith(b"put abortslew") else [])
                write(data)

            recorded.wire.write = noted  # type: ignore[method-assign]
            await asyncio.sleep(30.0)
            guest = recorded.arrive("10.0.0.1:5000", lambda data: None)
            for number in range(40):
                guest.feed(b":Sr05:34:32#:Sd+22*00:52#:MS#" if not number % 4 else b":GR#")
                await asyncio.sleep(5.0 + 0.03 * number)
                asked = loop.time()
                guest.feed(b":Q#")
                await asyncio.sleep(2.0)
                late.append(min(at for at in sent if at >= asked) - asked)
            guest.close()

    run_busy(night(), "overtaken")
    assert max(late) < 0.02
    _replayed(path)


def test_a_reply_that_a_newer_request_overtakes_at_the_entrance_is_not_delivered(tmp_path: Path) -> None:
    delivered: list[bytes] = []

    async def program() -> None:
        async with Recorded(tmp_path / "night.rec", "alpaca:german", "lx200") as recorded:
            echo = Overtaking("echo", lambda later: lambda data: data, 0.01)
            wire = recorded.gateway.entrance.wire(echo)
            await wire.open(delivered.append, lambda reason: None)
            echo._deliver(b"of a read\n")
            wire.write(b"of a stop\n")
            await asyncio.sleep(0.1)

    run_busy(program(), "overtaken")
    assert delivered == [b"of a stop\n"]


def test_every_part_of_a_recording_replays_up_to_its_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "night.rec"
    _live(path, "lx200 on nexstar", longest=12_000, seconds=4.0, many=6)
    parts = sorted(tmp_path.glob("night.rec.*"), key=lambda part: int(part.suffix[1:]), reverse=True)
    assert len(parts) >= 3
    replies = [_replayed(part).replies for part in [*parts, path]]
    assert replies == sorted(replies)
    assert len(set(replies)) >= 3
    assert main(["replay", str(parts[0])]) == 0
    assert "the recording continues after" in capsys.readouterr().out
    parts[0].unlink()
    assert main(["replay", str(path)]) == 2
    assert "beginning is missing" in capsys.readouterr().err


def test_another_answer_of_the_mount_shows(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    lines = _played("lx200 on nexstar", 4).decode("latin-1").split("\n")
    touched = [n for n, line in enumerate(lines) if " mount < " in line and len(line.split(" ")[3]) == 18]
    for n in touched[4:]:
        lines[n] = lines[n][:-18] + "1234" + lines[n][-14:]
    path.write_text("\n".join(lines), "latin-1")
    assert replay(read(path)).differences


def test_a_reply_that_is_missing_or_too_much_shows(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    lines = _played("lx200 on nexstar", 4).decode("latin-1").split("\n")
    first = next(n for n, line in enumerate(lines) if " 10.0." in line and " < " in line)
    path.write_text("\n".join([*lines[:first], *lines[first + 1 :]]), "latin-1")
    assert replay(read(path)).differences
    path.write_text("\n".join([*lines[:first], lines[first], *lines[first:]]), "latin-1")
    assert replay(read(path)).differences


def test_two_connections_of_one_name_at_a_time_are_told_apart(tmp_path: Path) -> None:
    """One port of a computer can be connected to two of ours."""
    path = tmp_path / "night.rec"
    told = bytearray(), bytearray()

    async def night() -> None:
        async with Recorded(path, "nexstar:cpc", "lx200") as recorded:
            await asyncio.sleep(2.0)
            first, second = (recorded.arrive("10.0.0.1:5000", one.extend) for one in told)
            for guest, words in ((first, b":Sr01:00:00#"), (second, b":Sr02:00:00#"), (first, b":Gr#")):
                guest.feed(words)
            await asyncio.sleep(0.1)
            first.close()
            second.feed(b":Gr#")
            await asyncio.sleep(1.0)
            second.close()
            recorded.arrive("10.0.0.1:5000", told[0].extend).feed(b":GVP#")
            await asyncio.sleep(1.0)

    run_busy(night(), "names")
    assert told == (b"101:00:00#Autostar#", b"102:00:00#")
    assert _replayed(path).clients == 3


@pytest.mark.parametrize(("part", "end"), [(0.3, b""), (0.77, b"\0" * 600)], ids=["here", "the power fails there"])
def test_a_recording_that_is_cut_off_replays_up_to_there(
    part: float, end: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Zeros at the end are what a disk makes of it when the power fails."""
    path, data = tmp_path / "night.rec", _played("nexstar on lx200", 3)
    path.write_bytes(data[: data.rindex(b"\n", 0, int(len(data) * part)) + 9] + end)
    assert main(["replay", str(path)]) == 0
    said = capsys.readouterr().out
    assert said.count("cut off in the middle of a line") == 1
    assert "the same bytes" in said
    assert main(["decode", str(path)]) == 0
    said = capsys.readouterr().out
    assert said.count("cut off in the middle of a line") == 1


def test_turns_out_of_order_are_told_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "night.rec"
    head, *lines = _played("nexstar on lx200", 3).decode("latin-1").split("\n")
    path.write_text("\n".join([head, lines[0], *reversed(lines[1:-1]), ""]), "latin-1")
    assert main(["replay", str(path)]) == 2
    assert "not in their order" in capsys.readouterr().err


def test_one_of_another_python_replays_exactly(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    path.write_bytes(_played("lx200 on nexstar", 4).replace(b'"python": "3.', b'"python": "2.'))
    assert _replayed(path).replies > 10


def test_a_gateway_of_its_own_that_is_recorded_replays(tmp_path: Path, started: list[Running]) -> None:
    """Over real sockets, with threads that read the state, write it and load the almanac."""
    path = tmp_path / "night.rec"
    gateway = Running(
        "run",
        "--mount",
        "nexstar@sim",
        "--surface",
        "lx200@tcp://127.0.0.1:0",
        "--record",
        str(path),
        "--state",
        str(tmp_path),
        "--latency",
        "0.01",
        "--lowest",
        "-90",
        "--sun",
        "0",
    )
    started.append(gateway)
    where = gateway.ready()
    for words in (b":GR#:GD#", b":GVP#", b":Mn#:GR#", b":Qn#:GZ#"):
        with ThreadPoolExecutor(4) as threads:
            for heard in threads.map(lambda _, words=words: ask(where, words), range(4)):
                assert heard.endswith(b"#")
    assert gateway.end() == 0
    assert gateway.said == ""
    outcome = _replayed(path)
    assert (outcome.clients, outcome.replies >= 16) == (16, True)
    assert read(path).settings["elapsed"] >= 0.0
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize("since", [1.0, 3600.0])
def test_one_begun_after_a_gateway_was_killed_in_motion_replays(since: float, tmp_path: Path) -> None:
    left = MarkerContent("nexstar@sim", 9600, {}, EVENING - since, LeftMotion({1: 2.0}, 1))

    async def next_gateway() -> None:
        async with Proven(record=tmp_path / "next.rec", left=left):
            await asyncio.sleep(3.0)

    run_calm(next_gateway())
    outcome = _replayed(tmp_path / "next.rec")
    assert (outcome.differences, outcome.strayed) == ([], [])
    assert outcome.requests > 20


def test_a_recording_that_broke_off_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "night.rec"
    gateway = Running(
        "run",
        "--mount",
        "nexstar@sim",
        "--surface",
        "lx200@tcp://127.0.0.1:0",
        "--record",
        str(path),
        "--state",
        str(tmp_path),
    )
    where = gateway.ready()
    for _ in range(2):
        assert ask(where, b":GR#")
    gateway.end(signal.SIGKILL)
    assert main(["replay", str(path)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line for line in said if "breaks off after" in line]
    assert "the same bytes" in said[-1] and " 0 connections" not in said[-1]
