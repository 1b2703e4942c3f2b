"""The gateway for programs without an event loop: the same methods, on a thread that ends with block or program."""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from gateway import (
    BlockingMount,
    Entry,
    Fault,
    Mount,
    NoAnswer,
    Stopped,
    UserError,
    connect,
    connect_blocking,
    op,
    open_blocking_gateway,
    open_gateway,
)
from tests.support.process import PATIENCE, Running

SIM: dict[str, Any] = {"site": (48.1, 11.6), "lowest": -90, "sun": 0}
SCRIPT = """
import signal
from gateway import open_blocking_gateway

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it for background jobs

def watch(entry):
    if entry.side == "mount" and entry.data[:1] in (b"r", b"M"):
        print("the mount got", entry.data[:1].decode(), flush=True)

opened = open_blocking_gateway("nexstar@sim", site=(48.1, 11.6), lowest=-90, sun=0, watch=watch)
gateway = opened.__enter__()
gateway.ready()
gateway.goto(20.0, 80.0)
print("ready on@its way", flush=True)
"""


def threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name == "mount-gateway"]


def test_blocking_api_has_the_methods_and_arguments_of_the_asynchronous_one() -> None:
    for name, offered in vars(Mount).items():
        if not name.startswith("_"):
            waits = vars(BlockingMount)[name]
            assert waits.__doc__ and not inspect.iscoroutinefunction(waits)
            assert inspect.signature(waits) == inspect.signature(offered)
    for waits, other in ((open_blocking_gateway, open_gateway), (connect_blocking, connect)):
        assert inspect.signature(waits).parameters == inspect.signature(other).parameters
        assert "without an event loop" in (waits.__doc__ or "")


def test_script_without_surfaces_points_a_mount() -> None:
    seen: list[Entry] = []
    with open_blocking_gateway("nexstar@sim", watch=seen.append, speed=20, **SIM) as gateway:
        gateway.ready()
        assert gateway.addresses() == []
        gateway.goto(20.0, 80.0)
        assert gateway.arrived(30) == pytest.approx((20.0, 80.0), abs=0.1)
        assert gateway.site() == op.Place(48.1, 11.6)
        assert connect_blocking().perform(op.GetStatus()) == gateway.perform(op.GetStatus())
        deadline = time.monotonic() + PATIENCE
        while gateway.moving():  # on a busy computer two positions that agree come a moment later
            assert time.monotonic() < deadline
        assert threads()
    assert any(entry.side == "mount" and entry.data[:1] == b"r" for entry in seen)
    assert not threads()
    with pytest.raises(NoAnswer, match="closed"):
        gateway.position()


def test_waiting_thread_is_told_of_a_stop_from_another_thread() -> None:
    with open_blocking_gateway("nexstar@sim", **SIM) as gateway:
        gateway.ready()
        gateway.goto(20.0, 80.0)
        stopping = threading.Timer(0.5, gateway.stop)  # the goto takes many times as long
        stopping.start()
        with pytest.raises(Stopped):
            gateway.arrived(30)
        stopping.join(10)


def test_blocking_call_on_the_gateways_thread_is_refused() -> None:
    opened: list[BlockingMount] = []
    said: list[str] = []

    def watch(_: Entry) -> None:
        for gateway in opened:
            try:
                gateway.position()
            except RuntimeError as error:
                said.append(str(error))

    with open_blocking_gateway("nexstar@sim", watch=watch, **SIM) as gateway:
        opened.append(gateway)
        gateway.ready()
        gateway.stop()  # whatever came before, this asks the mount once more
    assert "on its own thread" in said[0]


def test_blocking_api_raises_errors_in_the_caller_and_leaves_no_thread() -> None:
    with (
        pytest.raises(UserError, match=r"^open_gateway: \[mount\] lowset: there is no such key"),
        open_blocking_gateway("nexstar@sim", lowset=3),
    ):
        pass
    with pytest.raises(UserError, match="no such port"), open_blocking_gateway("nexstar@/dev/ttyNONE") as gateway:
        gateway.ready()
    with pytest.raises(Fault, match="must be a number"), open_blocking_gateway("nexstar@sim", **SIM) as gateway:
        gateway.goto(float("nan"), 80.0)
    assert not threads()


def test_last_sync_of_a_script_is_saved_when_it_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    script = tmp_path / "script.py"
    again = "ra, dec = gateway.position()\nfor away in 1, 2:\n    gateway.sync(ra + away, dec)\n"
    script.write_text(SCRIPT.partition("gateway.goto")[0] + again)
    said = Running(str(script), by=[sys.executable, "-bb", "-W", "error"]).finish()
    assert (said.returncode, said.stderr) == (0, "")
    (state,) = tmp_path.glob("*.json")
    assert json.loads(state.read_text())["synced"]["east"] == pytest.approx(2.0, abs=0.1)


@pytest.mark.skipif(os.name != "posix", reason="there are no pseudo-terminals")
def test_end_of_a_script_stops_a_mount_on_a_serial_port_and_leaves_no_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, port, script = tmp_path / "state", tmp_path / "mount", tmp_path / "script.py"
    monkeypatch.setenv("STATE_DIRECTORY", str(state))
    script.write_text(SCRIPT.replace("nexstar@sim", f"nexstar@{port}"))
    sim = Running("sim", "nexstar", "--at", f"pty:{port}")
    try:
        sim.ready()
        said = Running(str(script), by=[sys.executable, "-bb", "-W", "error"]).finish()
    finally:
        assert sim.end() == 0
    assert (said.returncode, said.stderr) == (0, "")
    assert said.stdout.endswith("the mount got M\n")
    assert [path.suffix for path in state.iterdir()] == [".lock"]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no signals at a chosen moment")
def test_interrupt_at_any_moment_leaves_the_blocking_gateway_working() -> None:
    class Struck(Exception):
        pass

    armed, places = [False], list[object]()

    def strike(_: int, frame: FrameType | None) -> None:
        callback = frame is not None and frame.f_code.co_name == "_remove"  # of a weak set: Python drops what it raises
        if armed[0] and not callback:
            raise Struck

    with open_blocking_gateway("nexstar@sim", **SIM) as gateway:
        gateway.ready()
        before = signal.signal(signal.SIGALRM, strike)
        try:
            for number in range(600):
                with contextlib.suppress(Struck):
                    armed[0] = True
                    signal.setitimer(signal.ITIMER_REAL, 2e-5 * (number % 60 + 1))
                    gateway.position()
                    armed[0] = False
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
        asking = threading.Thread(target=lambda: places.append(gateway.position()), daemon=True)
        asking.start()
        asking.join(PATIENCE)
        assert places


@pytest.mark.parametrize("ends", ["", "gateway.arrived(60)"])
def test_end_of_a_script_stops_the_mount(ends: str, tmp_path: Path) -> None:
    """One that forgets to leave the block, and one that Ctrl-C ends while it waits."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT + ends)
    running = Running(str(script), by=[sys.executable, "-bb", "-W", "error"])
    assert running.ready() == "its way"
    said = running.finish(signal.SIGINT if ends else None)
    assert "the mount got M" in said.stdout
    assert (said.returncode != 0, said.stderr.count("Traceback")) == ((True, 1) if ends else (False, 0)), said
