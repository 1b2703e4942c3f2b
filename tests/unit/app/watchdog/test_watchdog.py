"""The mount does not outlive its gateway: whatever becomes of it, the watchdog process stops what it has set moving."""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import runpy
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.app.config import MountConfig
from gateway.app.gateway import Gateway
from gateway.app.watchdog.client import MIN_LIFETIME, PROCESS_SCRIPT, Watchdog, WatchedMount, is_available
from gateway.app.watchdog.process import GatewayWatch, GuardedMount, ServedMount, cpu_wait
from gateway.mount.shutdown import stop_commands
from gateway.transport.wires import bytes_on_wire
from tests.support.in_process_gateway import Bridge
from tests.support.process import PATIENCE, Running
from tests.support.watchdog import Watched

pytestmark = pytest.mark.skipif(not is_available(), reason="this system cannot hand a line to another process")

#: Seconds from the gateway's end to the mount's rest, on a computer that has much else to do.
AT_REST = 20.0
#: Seconds without a word of the gateway after which the watchdog stops its mounts.
SILENCE = 1.2


@pytest.fixture
def watch(tmp_path: Path, started: list[Running]) -> Iterator[Callable[[str, str], Watched]]:
    """Makes a mount of that protocol behind a gateway on that kind of port. At the end nobody waits for watchdogs."""
    made: list[Watched] = []

    def make(kind: str, port: str) -> Watched:
        made.append(Watched(started, tmp_path, kind, port))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.parametrize(
    ("failure", "kind", "port"),
    [("frozen", "lx200", "pty"), ("blocked", "nexstar", "pty"), ("quit", "lx200", "tcp"), ("frozen", "alpaca", "tcp")],
)
@pytest.mark.safety_line(7)
def test_watchdog_stops_the_mount_of_a_dead_or_hung_gateway(
    watch: Callable[[str, str], Watched], failure: str, kind: str, port: str
) -> None:
    watched = watch(kind, port)
    watched.move()
    assert watched.inflict(failure) < AT_REST
    if failure in ("frozen", "blocked"):
        if failure == "frozen":
            watched.gateway.process.send_signal(signal.SIGCONT)
        watched.move()  # it goes on, and its motions are watched again
        assert watched.inflict("killed") < AT_REST
    assert watched.gateway.process.stderr is not None
    told = iter(watched.gateway.process.stderr.readline, "")  # before it, on a slow computer: a mount is there
    silence = threading.Timer(PATIENCE, watched.close)
    silence.start()
    assert any(line.startswith("mount-gateway watchdog: ") for line in told)
    silence.cancel()
    deadline = time.monotonic() + PATIENCE
    while not watched.tracks():
        assert time.monotonic() < deadline


def await_end(number: int) -> None:
    """Until that process has ended, or is left for its parent to take note of."""
    deadline = time.monotonic() + PATIENCE
    while (state := Path(f"/proc/{number}/stat")).exists() and ") Z " not in state.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_watchdog_leaves_the_port_to_the_next_gateway(watch: Callable[[str, str], Watched]) -> None:
    """The watchdog shares the port's lock with the gateway that is dead, and ends when another one has the mount."""
    watched = watch("nexstar", "pty")
    watched.move()
    old = watched.watchdog()
    killed = watched.gateway.process
    killed.send_signal(signal.SIGKILL)
    assert killed.stderr is not None
    assert any("watchdog" in line for line in killed.stderr)  # a loaded computer may have made the gateway say more
    watched.begin()
    deadline = time.monotonic() + PATIENCE
    while watched.speed() > 0.05:
        assert time.monotonic() < deadline
    await_end(old)


def test_gateway_replaces_a_killed_watchdog(watch: Callable[[str, str], Watched]) -> None:
    watched = watch("nexstar", "tcp")
    first = watched.watchdog()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(first, number)  # what ends a gateway from outside reaches the watchdog, too
    time.sleep(MIN_LIFETIME + 0.1)  # one that does not live so long is not started again
    assert watched.watchdog() == first
    os.kill(first, signal.SIGKILL)
    assert watched.watchdog(other=first) != first
    watched.move()
    assert watched.inflict("killed") < AT_REST


def test_ctrl_z_stops_the_mount_before_suspending(watch: Callable[[str, str], Watched]) -> None:
    watched = watch("lx200", "tcp")
    watched.move()
    watched.gateway.process.send_signal(signal.SIGTSTP)
    state = Path(f"/proc/{watched.gateway.process.pid}/stat")
    deadline = time.monotonic() + PATIENCE
    while ") T " not in state.read_text():
        assert time.monotonic() < deadline
    while watched.speed() > 0.05:
        assert time.monotonic() < deadline, "it still moves, and nothing supervises it"
    watched.gateway.process.send_signal(signal.SIGCONT)
    watched.gateway.end()
    assert "suspended: the mount was stopped" in watched.gateway.said
    assert "watchdog" not in watched.gateway.said, "nothing was left for it to do"


def test_no_watchdog_flag_starts_no_watchdog(tmp_path: Path, started: list[Running]) -> None:
    gateway = Running(
        "run",
        "--no-console",
        "--mount",
        "nexstar@socket://127.0.0.1:9",
        "--surface",
        "lx200@tcp://127.0.0.1:0",
        "--state",
        str(tmp_path),
        "--wait",
        "--no-watchdog",
    )
    started.append(gateway)
    gateway.ready()
    children = Path(f"/proc/{gateway.process.pid}/task/{gateway.process.pid}/children").read_text().split()
    assert not children


# --- the process by itself --------------------------------------------------------------------------------------


class Process:
    """The watchdog process with a gateway and a line that are this test's own."""

    def __init__(self) -> None:
        self.gateway, there = socket.socketpair()
        self.line, self.handed = socket.socketpair()
        self.line.settimeout(PATIENCE)
        self.gateway.settimeout(PATIENCE)
        self.process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(PROCESS_SCRIPT), str(there.fileno()), "1"],
            pass_fds=[there.fileno()],
            stderr=subprocess.PIPE,
        )
        there.close()

    def register(self, lock: Path) -> None:
        words = b"line 0 " + b"pier".hex().encode() + b" " + str(lock).encode().hex().encode()
        socket.send_fds(self.gateway, [words + b"\n"], [self.handed.fileno()])

    def take(self, length: int) -> bytes:
        """The next bytes on the line."""
        heard = b""
        while len(heard) < length:
            heard += self.line.recv(length - len(heard))
        return heard

    def heard(self) -> bytes:
        """What is on the line at this moment."""
        self.line.setblocking(False)
        try:
            return self.line.recv(1000)
        except BlockingIOError:
            return b""
        finally:
            self.line.settimeout(PATIENCE)


@pytest.mark.real_time
async def test_watchdog_survives_signals_from_its_first_moment() -> None:
    """Ctrl-C reaches a whole group of processes: one that is not ready for it yet would leave the mount alone."""
    watchdog = Watchdog()
    watchdog.start()
    assert watchdog.pid is not None
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
        os.kill(watchdog.pid, number)
    time.sleep(0.3)
    assert os.waitpid(watchdog.pid, os.WNOHANG) == (0, 0)
    watchdog.close()
    with contextlib.suppress(ChildProcessError):  # it ends with its gateway all the same, perhaps at once
        os.waitpid(watchdog.pid, 0)


def test_first_motion_starts_the_watchdog(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the first answer it would only be in the way. It learns of the line first, and once."""
    processes: list[socket.socket] = []

    def spawn(*_: Any, file_actions: list[tuple[Any, ...]], setsigmask: object) -> int:
        processes.append(socket.socket(fileno=os.dup(file_actions[-1][1])))
        return os.getpid()

    async def gateway() -> None:
        watchdog = Watchdog()
        mount = watchdog.watch("pier", None, lambda: [b"M"], lambda: False, lambda: None)
        mount.opened(0)
        assert not processes
        mount.report_motion_start()
        watchdog.start()
        watchdog.close()

    monkeypatch.setattr(os, "posix_spawn", spawn)
    asyncio.run(gateway())
    [process] = processes
    with process, process.makefile("rb") as told:
        assert told.readlines()[:2] == [b"line 0 70696572 00\n", b"moving 0 4d\n"]


@pytest.fixture
def process() -> Iterator[Process]:
    one = Process()
    yield one
    one.process.kill()
    one.process.communicate()
    for link in (one.gateway, one.line, one.handed):
        link.close()


def test_watchdog_repeats_the_stop_until_another_gateway_has_the_mount(process: Process, tmp_path: Path) -> None:
    lock = tmp_path / "mount.lock"
    lock.write_text("1")
    process.register(lock)
    process.gateway.sendall(b"moving 0 4d 500210\nbeat\nrest 0\n")
    process.gateway.sendall(b"moving 0 4d 500210\n")
    assert process.take(1) == b"M", "it was silent for too long"
    assert process.gateway.recv(100) == b"stopped 0\n"
    assert process.take(3) == b"P\x02\x10"
    process.gateway.close()
    assert process.take(4) == b"MP\x02\x10", "once more, now that the gateway has ended"
    lock.write_text("2")
    process.process.wait(PATIENCE)
    assert process.heard() in (b"", b"MP\x02\x10"), "the mount is another gateway's"


def test_watchdog_needs_no_heartbeat_while_mount_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    here, there = socket.socketpair()
    waits = []

    def wait(*arguments: Any) -> None:
        waits.append(arguments[3])
        raise InterruptedError

    monkeypatch.setattr("gateway.app.watchdog.process.select.select", wait)
    watch = GatewayWatch(there, "1")
    watch.mounts["0"] = GuardedMount("pier", "", -1)
    watch.handle(["moving", "0", "4d"], [])
    watch.handle(["rest", "0"], [])
    with here, there, pytest.raises(InterruptedError):
        watch.run()
    assert waits == [None]


@pytest.mark.parametrize(("stood_still", "stopped"), [(0.0, 1), (10.0, 0)])
def test_watchdog_that_was_paused_does_not_call_the_gateway_silent(
    monkeypatch: pytest.MonkeyPatch, stood_still: float, stopped: int
) -> None:
    """A virtual machine that was paused with something in motion: the gateway has its time to be heard, too."""
    here, there = socket.socketpair()
    clock, waits, stops = [100.0], [], []

    def wait(*arguments: Any) -> tuple[list[Any], list[Any], list[Any]]:
        seconds = arguments[3]
        waits.append(seconds)
        clock[0] += seconds + stood_still
        if len(waits) == 2:
            raise InterruptedError
        return [], [], []

    monkeypatch.setattr("gateway.app.watchdog.process.time.monotonic", lambda: clock[0])
    monkeypatch.setattr("gateway.app.watchdog.process.select.select", wait)
    watch = GatewayWatch(there, "1")
    monkeypatch.setattr(watch, "stop_for_silent_gateway", lambda mounts: stops.append(mounts))
    watch.mounts["0"] = GuardedMount("pier", "", -1)
    watch.mounts["0"].stop_commands, watch.last_heard = [b"M"], clock[0]
    with here, there, pytest.raises(InterruptedError):
        watch.run()
    assert len(stops) == stopped
    assert waits == pytest.approx([SILENCE, 0.0 if stopped else SILENCE])


@pytest.mark.parametrize(
    ("clear", "share", "until"),
    [
        ((True,), 1.0, 5.0),
        ((True,), 0.81, 5.0),
        ((True,), 0.79, SILENCE),
        ((True,), 0.0, SILENCE),  # frozen, hung, asleep on a lock
        ((True,), float("nan"), SILENCE),  # a system that does not say
        ((False,), 1.0, SILENCE),
        ((True, False), 1.0, SILENCE),
        ((True, True), 1.0, 5.0),
    ],
)
def test_watchdog_gives_a_cpu_starved_gateway_more_time_on_a_safe_path(
    monkeypatch: pytest.MonkeyPatch, clear: tuple[bool, ...], share: float, until: float
) -> None:
    here, there = socket.socketpair()
    clock, stopped = [100.0], list[float]()

    def wait(*arguments: Any) -> tuple[list[Any], list[Any], list[Any]]:
        clock[0] += arguments[3]
        return [], [], []

    def stop(mounts: list[GuardedMount]) -> None:
        stopped.append(clock[0])
        raise InterruptedError

    monkeypatch.setattr("gateway.app.watchdog.process.time.monotonic", lambda: clock[0])
    monkeypatch.setattr("gateway.app.watchdog.process.cpu_wait", lambda process: 7.0 + share * (clock[0] - 100.0))
    monkeypatch.setattr("gateway.app.watchdog.process.select.select", wait)
    watch = GatewayWatch(there, "1")
    monkeypatch.setattr(watch, "stop_for_silent_gateway", stop)
    for number, one in enumerate(clear):
        watch.mounts[str(number)] = GuardedMount("pier", "", -1)
        watch.handle([f"{'clear' if one else 'moving'}", str(number), "4d"], [])
    watch.reset_silence()
    with here, there, pytest.raises(InterruptedError):
        watch.run()
    assert stopped == pytest.approx([100.0 + until])


def test_watchdog_stops_the_mount_of_a_starved_gateway_that_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    here, there = socket.socketpair()
    clock = [100.0]

    def wait(*arguments: Any) -> tuple[list[Any], list[Any], list[Any]]:
        clock[0] += arguments[3]
        return [], [], []

    def stop(mounts: list[GuardedMount]) -> None:
        raise InterruptedError

    monkeypatch.setattr("gateway.app.watchdog.process.time.monotonic", lambda: clock[0])
    monkeypatch.setattr("gateway.app.watchdog.process.cpu_wait", lambda process: min(clock[0] - 100.0, 1.5))
    monkeypatch.setattr("gateway.app.watchdog.process.select.select", wait)
    watch = GatewayWatch(there, "1")
    monkeypatch.setattr(watch, "stop_for_silent_gateway", stop)
    watch.mounts["0"] = GuardedMount("pier", "", -1)
    watch.handle(["clear", "0", "4d"], [])
    watch.reset_silence()
    with here, there, pytest.raises(InterruptedError):
        watch.run()
    assert clock[0] < 102.3


def test_watchdog_reads_the_cpu_wait_of_a_process_from_linux() -> None:
    told = cpu_wait(str(os.getpid()))
    assert told >= 0.0 or not Path("/proc/self/schedstat").exists()
    assert math.isnan(cpu_wait("0"))


@pytest.mark.safety_line(7)
def test_watchdog_survives_a_gateway_that_ends_while_its_cpu_wait_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its file in /proc can be opened still, and reading it fails: the mount is stopped all the same."""
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    descriptor = os.open(f"/proc/{child.pid}/schedstat", os.O_RDONLY)
    child.kill()
    child.communicate()
    monkeypatch.setattr("gateway.app.watchdog.process.os.open", lambda *arguments: descriptor)
    assert math.isnan(cpu_wait(str(child.pid)))


# --- what it is told --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("moving", [b":RS#:Mn#", b":Sr07:00:00#:Sd+30*00:00#:MS#"])
async def test_making_watchdog_stop_commands_leaves_the_driver_unchanged(moving: bytes) -> None:
    """Celestron's manual: both motors at rate 0, M for a goto, and tracking as it was (T 2 on a CGE)."""
    async with Bridge("cge") as bridge:
        client = bridge.client()
        client.send(moving)
        await client.ask(b":GVP#")
        driver = bridge.controller.driver
        before = repr(sorted(vars(driver).items(), key=lambda item: item[0]))
        commands = stop_commands(driver, bridge.controller.line.reply_rules)
        assert repr(sorted(vars(driver).items(), key=lambda item: item[0])) == before
        assert {b"M", b"P\2\x10$\0\0\0\0", b"P\2\x11$\0\0\0\0"} <= set(commands)
        for command in commands:
            bridge.sim.feed(command)
        assert bridge.sim.tracking
        assert not bridge.sim.slewing


def test_watchdog_doubles_telnet_bytes_on_an_rfc_2217_line() -> None:
    assert bytes_on_wire("rfc2217://pier:4000", b"P\xff\0") == b"P\xff\xff\0"
    assert bytes_on_wire("/dev/ttyUSB0", b"P\xff\0") == b"P\xff\0"


def test_simulated_mount_has_no_watchdog() -> None:
    gateway = Gateway(MountConfig(at="nexstar@sim"), [])
    gateway._connect_watchdog()
    assert gateway.watchdog_mount is None


def test_watchdog_client_loads_without_unix_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SIGHUP", "SIGQUIT", "SIGTSTP"):
        monkeypatch.delattr(signal, name)
    loaded = runpy.run_path(str(PROCESS_SCRIPT.with_name("client.py")))
    assert loaded["BLOCKED_SIGNALS"] == [signal.SIGINT, signal.SIGTERM]


GOTO = b":Sr07:00:00#:Sd+30*00:00#:MS#"


@pytest.mark.parametrize(
    ("said", "told", "config"),
    [
        (GOTO, True, {}),
        (b":hP#", True, {}),
        (b":RS#:Mn#", False, {}),
        (GOTO + b":RS#:Mn#", False, {}),
        (GOTO + b":Q#", False, {}),
        (GOTO, False, {"hour_angle_limit": 0.5}),  # the way to the goal is not examined for this one
    ],
)
async def test_watchdog_treats_only_a_checked_goto_as_a_safe_path(
    said: bytes, told: bool, config: dict[str, float]
) -> None:
    async with Bridge("cpc", site=(45.0, 10.0), config=config) as bridge:
        client = bridge.client()
        await client.ask(b":GR#")
        assert not bridge.controller.watch.on_clear_path
        client.send(said)
        await asyncio.sleep(0.5)
        assert bridge.controller.watch.on_clear_path is told


async def test_watchdog_does_not_treat_a_goto_beyond_a_limit_as_safe() -> None:
    async with Bridge("cge", site=(45.0, 10.0), config={"lowest": 20.0}) as bridge:
        client, seen = bridge.client(), set[bool]()
        for hour in (1, 3, 5, 7, 9, 11):
            client.received = b""
            client.send(b":Sr%02d:00:00#:Sd+10*00:00#:MS#" % hour)
            await asyncio.sleep(2.0)
            watch = bridge.controller.watch
            if client.received == b"110":
                seen.add(watch.on_clear_path)
        assert seen == {True, False}


def test_gateway_tells_the_watchdog_when_a_motion_path_is_safe() -> None:
    told, clear = list[str](), [False]
    watchdog: Any = SimpleNamespace(
        start=lambda: None, send=lambda text, descriptors=(): told.append(text), start_heartbeats=lambda: None
    )
    watched = WatchedMount(watchdog, 0, "pier", None, lambda: [b"M"], lambda: True, lambda: None, lambda: clear[0])
    watched.report_motion_start()
    clear[0] = True
    watched.report_changes()
    watched.report_changes()
    clear[0] = False
    watched.report_changes()
    assert told == ["moving 0 4d", "clear 0 4d", "moving 0 4d"]


def test_watchdog_sends_every_request_to_a_server_that_closes_connections() -> None:
    heard: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            for _ in range(3):
                with listening.accept()[0] as connection:
                    heard.append(connection.recv(1000))
                    connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        mount = ServedMount("pier", "", "127.0.0.1", str(listening.getsockname()[1]), "beside")
        mount.stop_commands = [b"one", b"two", b"three"]
        mount.prepare_stop()
        for word in mount.stop_commands:
            mount.send(word)
            deadline = time.monotonic() + PATIENCE
            while word not in heard:
                assert time.monotonic() < deadline
                time.sleep(0.01)
        thread.join(PATIENCE)
    mount.unlock()
    mount.send(b"four")  # nobody listens any more: it is tried again a second later
    mount.close()
    assert heard == mount.stop_commands
