"""However a gateway ends, the mount stands still afterwards and tracks as its user had it."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.app.config import Config, Endpoint, MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.app.simulated import make_simulator
from gateway.astro.spherical import separation
from gateway.cli import main
from gateway.cli.serve import serving
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS
from gateway.transport.wires import SimulatedTransport
from tests.support.in_process_gateway import Bridge
from tests.support.process import PATIENCE, Running, ask
from tests.support.sampling import as_a_rule

GOTO = b":Sr07:00:00#:Sd+30*00:00#:MS#"


async def still(sim: Any, seconds: float = 1.0) -> bool:
    """Whether the tube stays where it is on the sky, once the motors have run down."""
    await asyncio.sleep(RAMP_SECONDS)
    before = sim.true_position()
    await asyncio.sleep(seconds)
    return separation(*before, *sim.true_position()) < 0.001 * seconds


# --- the end of a gateway ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("mount", ["6-8se", "cge"])
@pytest.mark.parametrize("motion", [b":RS#:Mn#", b":RC#:Ms#", GOTO, b":Mgn9999#", b":RS#:Mn#:Me#:Qn#", b":Mn#:Qn#"])
async def test_shutdown_at_any_instant_leaves_the_mount_still_and_tracking(mount: str, motion: bytes) -> None:
    """Ended at many instants of a motion's first second and a half, between and within exchanges.

    Each mount at every second instant, unless all of it is wanted.
    """
    first, every = as_a_rule(int(mount == "cge"), whole=0), as_a_rule(2, whole=1)
    for moment in (0.0, 0.02, 0.06, 0.12, 0.17, 0.22, 0.28, 0.35, 0.45, 0.7, 1.0, 1.5)[first::every]:
        async with Bridge(mount) as bridge:
            assert bridge.sim.tracking
            bridge.client().send(motion)
            await asyncio.sleep(moment)
        assert await still(bridge.sim), moment
        assert bridge.sim.tracking, moment


def test_shutdown_repeats_tracking_that_the_hand_control_ignored() -> None:
    """A T that comes right after motion may be ignored."""

    async def program() -> None:
        async with Bridge("cge") as bridge:
            bridge.client().send(b":RS#:Mn#")
            await asyncio.sleep(2)
            feed, missed = bridge.sim.feed, []

            def deaf(data: bytes) -> bytes:
                if data == b"T\2" and not missed:
                    missed.append(data)
                    return b"#"
                return bytes(feed(data))

            bridge.controller.line.wire.feed = deaf  # type: ignore[attr-defined]
        assert missed
        assert bridge.sim.mode == 2

    run(program())


async def test_shutdown_leaves_a_drive_off_that_was_off() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        client.send(b":AL#")
        await asyncio.sleep(1)
        client.send(b":RS#:Mn#")
        await asyncio.sleep(2)
    assert (bridge.sim.mode, bridge.sim.tracking) == (0, False)


async def test_shutdown_drops_motions_pending_in_a_connection() -> None:
    async with Bridge("cge") as bridge:
        client = bridge.client()
        client.send(b":RC#:Mn#")
        await asyncio.sleep(2)
        client.send(b":Qn#")
        await asyncio.sleep(0.3)  # the hand control is looked at again in a second: the end waits for that
        client.send(b":GW#:RS#:Mn#")
    begun = [sent for sent in bridge.sent_requests() if sent[:4] == b"P\2\x11$" and sent[4]]
    assert len(begun) == 1
    assert await still(bridge.sim)


async def test_silent_mount_delays_shutdown_by_seconds_only() -> None:
    async with Bridge() as bridge:
        bridge.client().send(b":RS#:Mn#")
        await asyncio.sleep(2)
        heard: list[bytes] = []
        bridge.controller.line.wire.feed = lambda data: heard.append(data) or b""  # type: ignore[attr-defined,func-returns-value]
        began = bridge.controller.now()
    assert bridge.controller.now() - began < 8
    assert set(heard) >= {b"M", b"P\2\x10$\0\0\0\0", b"P\2\x11$\0\0\0\0"}, "the bytes went out all the same"


async def test_shutdown_stops_the_mount_though_the_serial_task_has_died() -> None:
    async with Bridge("cge") as bridge:
        bridge.client().send(b":RS#:Mn#")
        await asyncio.sleep(2)
        assert bridge.controller.line._task is not None
        bridge.controller.line._task.cancel()
    assert await still(bridge.sim)
    assert bridge.sim.tracking


# --- a defect on the way ----------------------------------------------------------------------------------------


def _broken(*_: Any) -> Any:
    raise RuntimeError("a defect")


@pytest.mark.parametrize("where", ["surface", "driver"])
async def test_internal_error_stops_the_mount_and_programs_stay_connected(where: str) -> None:
    async with Bridge("cge") as bridge:
        client, other = bridge.client(), bridge.client("10.0.0.2")
        client.send(b":RS#:Mn#")
        await asyncio.sleep(2)
        assert not await still(bridge.sim)
        if where == "surface":
            face = bridge.acceptor.binding
            face.surface.handlers = {**face.surface.handlers, "accessories.home_state": _broken}
        else:
            bridge.driver.handlers = {**bridge.driver.handlers, "home.home_state": _broken}
        client.send(b":h?#")
        await asyncio.sleep(1)
        assert any("internal error" in entry.note for entry in bridge.entries)
        assert await still(bridge.sim)
        assert bridge.sim.tracking
        for one in (client, other):
            assert (await one.ask(b":GD#")).endswith(b"#")
        other.send(b":RS#:Ms#")
        await asyncio.sleep(2)
        assert not await still(bridge.sim), "and the mount can be moved again"


async def test_shutdown_does_not_retry_a_defective_stop_for_ever() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        client.send(b":RG#:Mn#")
        await asyncio.sleep(1)
        bridge.driver.handlers = {**bridge.driver.handlers, "motion.abort_motion": _broken}
        client.send(b":Q#")
        await asyncio.sleep(10)
        assert sum("a defect" in entry.note for entry in bridge.entries) < 10
        assert (await client.ask(b":GD#")).endswith(b"#")


async def test_unwritable_log_does_not_end_the_gateway() -> None:
    def full(_: Any) -> None:
        raise BrokenPipeError

    async with Bridge() as bridge:
        bridge.wire_log.sinks.append(full)
        assert (await bridge.client().ask(b":GR#")).endswith(b"#")
        assert full not in bridge.wire_log.sinks


# --- signals and worse, in this process -------------------------------------------------------------------------


class Served:
    """``run``, as the command line serves it, onto a simulated mount that can be looked at afterwards."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.sim = make_simulator(Endpoint("nexstar", "-", "cge"), clock=time.time)
        self.opened: list[Gateway] = []
        opening = Gateway.open

        async def open_it(gateway: Gateway) -> None:
            self.opened.append(gateway)
            await opening(gateway)

        monkeypatch.setattr(Gateway, "open", open_it)
        wire = SimulatedTransport("sim", self.sim.connection, 0.005)
        monkeypatch.setattr("gateway.app.gateway.make_transport", lambda *_: wire)

    def run(self, fast: bool, then: Callable[[], object]) -> int:
        """Begin a goto, and a moment later do something to the loop or the process."""

        async def program() -> int:
            mover = asyncio.ensure_future(self._move(then))
            try:
                return await serving.serve_mounts(
                    Config([MountConfig(at="nexstar@socket://-")], [SurfaceConfig(at="lx200@tcp://127.0.0.1:0")])
                )
            finally:
                mover.cancel()

        return serving.run_on_loop(fast, program)

    async def _move(self, then: Callable[[], object]) -> None:
        while not (self.opened and self.opened[0].models_presented.is_set()):
            await asyncio.sleep(0.01)
        controller = self.opened[0].controller
        await controller.perform(op.GotoAxes(10.0, 20.0))
        assert self.sim.slewing
        asyncio.get_running_loop().call_soon(then)

    def stands(self) -> bool:
        return not self.sim.slewing and self.sim.tracking


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
@pytest.mark.safety_line(2)
def test_signal_stops_the_mount(monkeypatch: pytest.MonkeyPatch, fast: bool, name: str) -> None:
    served = Served(monkeypatch)
    inherited = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # these tests may run under nohup
    try:
        assert served.run(fast, lambda: os.kill(os.getpid(), getattr(signal, name))) == 0
    finally:
        signal.signal(signal.SIGHUP, inherited)
    assert served.stands()


@pytest.mark.parametrize("fast", [True, False])
def test_exception_that_escapes_the_event_loop_stops_the_mount(monkeypatch: pytest.MonkeyPatch, fast: bool) -> None:
    def escape() -> None:
        raise SystemExit(7)

    served = Served(monkeypatch)
    with pytest.raises(SystemExit):
        served.run(fast, escape)
    assert served.stands()


def test_exception_while_serving_stops_the_mount(monkeypatch: pytest.MonkeyPatch) -> None:
    served = Served(monkeypatch)
    monkeypatch.setattr(Gateway, "names", _broken)
    with pytest.raises(RuntimeError, match="a defect"):
        served.run(False, lambda: None)
    assert not served.sim.slewing


def test_gateway_under_nohup_outlives_its_terminal() -> None:
    async def program() -> bool:
        done = serving.end_signal_event()
        os.kill(os.getpid(), signal.SIGHUP)
        await asyncio.sleep(0.01)
        return done.is_set()

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert not asyncio.run(program())
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # ``before`` may ignore it: the tests run under nohup, too
        assert asyncio.run(program())
    finally:
        signal.signal(signal.SIGHUP, before)


# --- processes --------------------------------------------------------------------------------------------------


@pytest.fixture
def stop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str]]:
    """``mount-gateway stop`` -> its exit code and what it said."""

    def run_it(*arguments: str) -> tuple[int, str]:
        code = main(["stop", "--state", str(tmp_path), *arguments])
        return code, "".join(capsys.readouterr()).strip()

    return run_it


class Moving:
    """A simulated mount, a gateway in front of it, without a watchdog process, that says where each listens."""

    def __init__(self, started: list[Running], state: Path) -> None:
        self._started, self.state = started, state
        self.sim = Running("sim", "nexstar:cge", "--at", "tcp://127.0.0.1:0")
        started.append(self.sim)
        self.mount = self.sim.ready()
        self.endpoint = f"nexstar@{self.mount.replace('tcp', 'socket')}"
        self.begin()

    def begin(self) -> None:
        self.gateway = Running(
            "run",
            "--no-console",
            "--mount",
            self.endpoint,
            "--surface",
            "lx200@tcp://127.0.0.1:0",
            "--state",
            str(self.state),
            "--no-watchdog",
            "--sun",
            "0",
        )
        self._started.append(self.gateway)
        self.where = self.gateway.ready()

    def move(self) -> None:
        """By hand, at four degrees a second."""
        ask(self.where, b":RS#:Mn#:GVP#")
        deadline = time.monotonic() + PATIENCE
        while not self.moves():
            assert time.monotonic() < deadline

    def moves(self) -> bool:
        before = self._declination()
        time.sleep(0.1)
        return abs(self._declination() - before) > 100

    def rests(self) -> bool:
        """Whether it comes to stand still."""
        deadline = time.monotonic() + PATIENCE
        while self.moves() and time.monotonic() < deadline:
            pass
        return not self.moves()

    def _declination(self) -> int:
        """By the mount's own word, in 2^-32 turns over 256."""
        return int(ask(self.mount, b"e")[9:15], 16)

    def tracking(self) -> bool:
        return ask(self.mount, b"t") == b"\x02#"


def test_stop_command_stops_the_mount_with_or_without_a_gateway(
    tmp_path: Path, started: list[Running], stop: Callable[..., tuple[int, str]]
) -> None:
    """A running one is asked; after a kill a new one stops the mount before all else, and so does ``stop`` itself."""
    moving = Moving(started, tmp_path)
    moving.move()
    other = f"no gateway runs here for nexstar@elsewhere; write --mount {moving.endpoint}. Nothing was stopped"
    assert stop("--mount", "nexstar@elsewhere") == (1, other)
    assert moving.moves()
    assert stop("--mount", moving.endpoint) == (0, f"{moving.endpoint}: stopped")
    assert moving.rests()
    assert moving.tracking()
    moving.move()
    moving.gateway.end(signal.SIGKILL)
    assert moving.moves()
    moving.begin()
    assert moving.rests()
    assert moving.tracking()
    moving.move()
    moving.gateway.end(signal.SIGKILL)
    told = "the last run ended while the mount was moving: the mount is stopped first"
    assert moving.gateway.said == f"mount-gateway: {moving.endpoint}: {told}"
    assert moving.moves()
    assert stop() == (0, f"{moving.endpoint}: stopped")
    assert moving.rests()
    assert moving.tracking()
    assert stop() == (0, "nothing to stop: no gateway runs, and none ended in motion")
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".lock"]


def test_failed_stop_is_reported_and_a_second_ctrl_c_ends_at_once(
    tmp_path: Path, started: list[Running], stop: Callable[..., tuple[int, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    moving = Moving(started, tmp_path)
    moving.move()
    moving.sim.process.send_signal(signal.SIGSTOP)  # the mount hangs
    moving.gateway.process.send_signal(signal.SIGINT)
    time.sleep(0.5)
    assert moving.gateway.process.poll() is None, "it waits for the mount"
    began = time.monotonic()
    moving.gateway.process.send_signal(signal.SIGINT)
    assert moving.gateway.process.wait(PATIENCE) == 130
    assert time.monotonic() - began < 3.0  # the mount alone would be waited for longer
    moving.sim.end(signal.SIGKILL)
    monkeypatch.setattr("gateway.app.control.stop_command.STOP_ACK_TIMEOUT", 0.5)
    code, words = stop()
    assert code == 1
    assert words.startswith(f"{moving.endpoint}: not stopped: ")
    assert "connection refused" in words
    assert list(tmp_path.glob("*.moving")), "it is still owed"
