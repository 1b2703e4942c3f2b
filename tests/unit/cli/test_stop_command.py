"""``mount-gateway stop`` reaches its gateway whatever became of the state folder, or says what it could not know."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from gateway.app.control import exchange, reach, stop_command
from gateway.app.control.exchange import ControlEndpoint
from gateway.app.state.file import MarkerContent
from gateway.cli import main
from gateway.core.requests import Answer
from gateway.system import processes
from gateway.system import runtime_folders as runtime
from gateway.system.processes import GatewayProcess, is_gateway_argv
from gateway.system.runtime_folders import user_id
from tests.integration.stops.test_shutdown import Moving
from tests.support.each import each
from tests.support.process import PATIENCE, Running, ask

Stop = Callable[..., tuple[int, str]]
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="by /proc")
#: A process id that no process has.
GONE = 2**22 + 1
NOTHING = "nothing to stop: no gateway runs, and none ended in motion"


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[GatewayProcess]:
    """The gateways that ``stop`` sees among the processes: other tests' are none of them."""
    found: list[GatewayProcess] = []
    monkeypatch.setattr(processes, "gateways", lambda: found)
    monkeypatch.setattr(stop_command, "SEARCH_PERIOD", 0.01)
    return found


@pytest.fixture
def stop(capsys: pytest.CaptureFixture[str]) -> Stop:
    """``mount-gateway stop`` -> its exit code and what it said."""

    def run_it(*arguments: str) -> tuple[int, str]:
        code = main(["stop", *arguments])
        return code, "".join(capsys.readouterr()).strip()

    return run_it


def test_stop_reaches_a_gateway_whose_folder_was_deleted(
    tmp_path: Path, started: list[Running], stop: Stop, seen: list[GatewayProcess]
) -> None:
    state = tmp_path / "state"
    moving = Moving(started, state)
    seen.append(GatewayProcess(moving.gateway.process.pid, os.getuid()))
    moving.move()
    gone = state.rename(tmp_path / "gone")  # at once: the gateway may be writing a file into it
    shutil.rmtree(gone, ignore_errors=True)
    assert stop("--state", str(state)) == (0, f"{moving.endpoint}: stopped")
    assert not moving.moves()
    assert moving.tracking()


@LINUX
def test_stop_reaches_a_gateway_that_could_write_no_file(
    started: list[Running], stop: Stop, seen: list[GatewayProcess]
) -> None:
    """/proc takes files of nobody, not even of root; a full disk and a read-only one do neither."""
    moving = Moving(started, Path("/proc"))
    seen.append(GatewayProcess(moving.gateway.process.pid, os.getuid()))
    moving.move()
    assert stop("--state", "/proc") == (0, f"{moving.endpoint}: stopped")
    assert not moving.moves()
    code, words = stop("--state", "/proc", "--hold")
    assert code == 1
    assert f"{moving.endpoint}: " in words and "forgets that: /proc/hold" in words
    ask(moving.where, b":RS#:Mn#:GVP#")
    time.sleep(0.5)
    assert not moving.moves()


@LINUX
def test_stop_reaches_a_gateway_without_free_descriptors(tmp_path: Path, started: list[Running], stop: Stop) -> None:
    import resource

    moving = Moving(started, tmp_path)
    moving.move()
    pid = moving.gateway.process.pid
    _, most = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (3, most))
    assert stop("--state", str(tmp_path)) == (0, f"{moving.endpoint}: stopped")
    assert not moving.moves()


def test_stop_reports_a_frozen_gateway(
    tmp_path: Path, started: list[Running], stop: Stop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reach, "RECEIPT_TIMEOUT", 0.3)
    moving = Moving(started, tmp_path)
    moving.gateway.process.send_signal(signal.SIGSTOP)
    began = time.monotonic()
    code, words = stop("--state", str(tmp_path))
    assert code == 1
    assert f"the gateway (process {moving.gateway.process.pid}) does not answer" in words
    assert time.monotonic() - began < 8.0


def test_stop_hold_lasts_over_a_restart_until_released(tmp_path: Path, started: list[Running], stop: Stop) -> None:
    here = ("--state", str(tmp_path))
    moving = Moving(started, tmp_path)
    moving.move()
    held = f"held: no gateway moves a mount of {tmp_path} until mount-gateway stop --release"
    assert stop(*here, "--hold") == (0, f"{moving.endpoint}: stopped and held\n{held}")
    assert not moving.moves()
    goto = b":Sr07:00:00#:Sd+30*00:00#:MS#"
    refused = b"112The mount is held: type mount-gateway stop --release.#"
    assert ask(moving.where, goto, refused) == refused
    moving.gateway.end(signal.SIGKILL)
    moving.begin()
    assert ask(moving.where, goto, refused) == refused
    moving.gateway.end()
    assert moving.gateway.said.startswith(f"mount-gateway: {moving.endpoint}: the mount is held: ")
    code, words = stop(*here, "--release")
    assert code == 0 and words.startswith("released: ")
    code, words = stop(*here, "--release")
    assert code == 0 and words.startswith("nothing to release")
    moving.begin()
    moving.move()
    assert stop(*here)[0] == 0


def test_stop_hold_cannot_be_limited_to_one_mount(stop: Stop, seen: list[GatewayProcess], tmp_path: Path) -> None:
    assert stop("--hold", "--mount", "x")[0] == 2
    assert stop("--hold", "--release")[0] == 2
    (tmp_path / "file").write_text("")
    code, words = stop("--hold", "--state", str(tmp_path / "file"))
    assert code == 1 and f"{tmp_path}/file/hold: " in words


def test_stop_names_a_mount_left_moving_by_a_killed_gateway(
    stop: Stop, seen: list[GatewayProcess], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def directly(mark: MarkerContent, where: Path) -> Answer:
        return Answer("done", f"stopped {mark.mount}")

    monkeypatch.setattr(stop_command, "_stop_directly", directly)
    here = ("--state", str(tmp_path))
    (tmp_path / "m.moving").write_bytes(msgspec.json.encode(MarkerContent("nexstar@sim", 9600)))
    code, words = stop(*here, "--mount", "peer")
    assert code == 1 and "no gateway runs here for peer" in words and "Nothing was stopped" in words
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as freed:
        freed.bind(("127.0.0.1", 0))
        port = freed.getsockname()[1]
    gone = ControlEndpoint("nexstar@sim", GONE, port, "s", str(tmp_path), "pier")
    (tmp_path / "m.control").write_bytes(msgspec.json.encode(gone))
    assert stop(*here, "--mount", "pier") == (0, "pier: stopped nexstar@sim")


def test_stop_stops_a_mount_left_moving_in_another_state_folder(
    stop: Stop, seen: list[GatewayProcess], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("XDG_RUNTIME_DIR", "TMPDIR", "XDG_STATE_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.delenv("STATE_DIRECTORY")
    (east := tmp_path / "east").mkdir()
    marker, answers = east / "m.moving", [Answer("failed", "no answer"), Answer("done", "stopped")]

    async def directly(mark: MarkerContent, where: Path) -> Answer:
        assert (mark.mount, where) == ("nexstar@/dev/ttyS9", east)
        if (answer := answers.pop(0)).is_ok:
            marker.unlink()
        return answer

    monkeypatch.setattr(stop_command, "_stop_directly", directly)
    marker.write_bytes(msgspec.json.encode(MarkerContent("nexstar@/dev/ttyS9", 9600)))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as freed:
        freed.bind(("127.0.0.1", 0))
        gone = ControlEndpoint("nexstar@/dev/ttyS9", GONE, freed.getsockname()[1], "s", str(east), "east")
    for folder in (folders := runtime.find_folders()[0]):
        (folder / "m.control").write_bytes(msgspec.json.encode(gone))
    assert len(folders) == 2
    exchange.remove_stale_files(folders[0])  # as a gateway does that starts for another mount
    assert stop("--state", str(tmp_path / "west")) == (0, NOTHING)
    assert stop() == (1, "east: not stopped: no answer")
    assert stop() == (0, "east: stopped")
    assert stop() == (0, NOTHING)
    assert not [*folders[0].iterdir(), *folders[1].iterdir()]


# --- what could not be known ------------------------------------------------------------------------------------


def test_stop_reports_nothing_to_stop_where_no_gateway_ran(
    stop: Stop, seen: list[GatewayProcess], tmp_path: Path
) -> None:
    assert stop() == (0, NOTHING)
    assert stop("--state", str(tmp_path)) == (0, NOTHING)


def test_stop_reports_a_folder_that_it_cannot_read(stop: Stop, seen: list[GatewayProcess], tmp_path: Path) -> None:
    place = tmp_path / "state"
    place.write_text("")
    code, words = stop("--state", str(place))
    assert code == 1
    assert words.startswith(f"{place}: Not a directory") and "cannot tell" in words


def test_stop_names_a_gateway_of_another_user(
    stop: Stop, seen: list[GatewayProcess], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reach, "user_id", lambda: os.getuid() + 1000)
    seen.append(GatewayProcess(4711, 1))  # Debian's daemon
    code, words = stop()  # a folder that is not there says nothing of who runs
    assert code == 1
    assert words.startswith("a gateway of ") and " runs as process 4711: stop it as " in words
    assert words.endswith(", or as root")
    monkeypatch.delenv("STATE_DIRECTORY")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    (tmp_path / "mount-gateway").mkdir()
    assert stop()[0] == 1, "whose folder is asked for was not said"
    assert stop("--state", str(tmp_path))[0] == 1, "whoever owns that folder may have a gateway"
    monkeypatch.setattr(reach, "user_id", os.getuid)
    assert stop("--state", str(tmp_path)) == (0, NOTHING), "a folder of one's own is no other user's"


def test_stop_names_a_gateway_of_the_user_that_does_not_answer(stop: Stop, seen: list[GatewayProcess]) -> None:
    seen.append(GatewayProcess(4711, os.getuid()))
    code, words = stop()
    assert code == 1
    assert "process 4711 is a gateway" in words and "kill 4711" in words


@each(("seconds", "looks"), [(5.0, stop_command.TRIES), (3600.0, 2)])
def test_stop_waits_for_a_silent_gateway_only_while_it_may_be_starting(
    seconds: float, looks: int, stop: Stop, seen: list[GatewayProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    looked, slept = list[int](), list[float]()

    async def sleep(seconds: float) -> None:
        slept.append(seconds)

    monkeypatch.setattr(stop_command.asyncio, "sleep", sleep)
    monkeypatch.setattr(stop_command, "age", lambda pid: seconds)
    monkeypatch.setattr(processes, "gateways", lambda: looked.append(1) or [GatewayProcess(4711, os.getuid())])
    assert stop()[0] == 1
    assert len(looked) == looks == len(slept) + 1, "nobody waits after the last look"


def test_stop_does_not_wait_for_another_users_gateway(
    stop: Stop, seen: list[GatewayProcess], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    async def sleep(seconds: float) -> None:
        raise AssertionError("somebody waits")

    seen.append(GatewayProcess(4711, os.getuid() + 1))
    monkeypatch.setattr(reach, "user_id", os.getuid)
    monkeypatch.setattr(reach, "may_reach", lambda process: False)
    monkeypatch.setattr(stop_command, "may_reach", lambda process: False)
    monkeypatch.setattr(stop_command.asyncio, "sleep", sleep)
    code, words = stop()
    assert code == 1 and "runs as process 4711: stop it as" in words
    assert main(["status"]) == 1
    assert "process 4711 is a gateway of" in capsys.readouterr().err


@LINUX
def test_age_of_a_process_is_read_from_the_system() -> None:
    assert processes.age(1) > processes.age(os.getpid()) > 0.0 == processes.age(GONE)


@pytest.mark.safety_line(2)
def test_stop_without_a_folder_stops_every_gateway_of_the_user(
    tmp_path: Path, started: list[Running], stop: Stop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In folders of its own for what lives as long as a session, so that no other test's gateway is stopped."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(processes, "gateways", list)
    moving = Moving(started, tmp_path / "state")
    monkeypatch.delenv("STATE_DIRECTORY")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "elsewhere"))
    moving.move()
    assert stop() == (0, f"{moving.endpoint}: stopped")
    assert not moving.moves()
    assert stop("--state", str(tmp_path / "other")) == (0, NOTHING)


@pytest.mark.skipif(user_id() != 0, reason="only root looks into folders of others")
def test_stop_as_root_reaches_gateways_of_other_users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    monkeypatch.setattr(runtime, "SESSIONS_FOLDER", tmp_path / "run")
    theirs, fake = tmp_path / "mount-gateway-1", tmp_path / "mount-gateway-2"
    theirs.mkdir()
    endpoint = '{"mount": "m", "pid": 4711, "port": 9, "secret": "s", "state": "/x"}'
    (theirs / "a.control").write_text(endpoint)
    (theirs / "b.control").write_text(endpoint)
    os.chown(theirs, 1, 1)
    os.chown(theirs / "a.control", 1, 1)
    fake.symlink_to(theirs)
    found = reach.search(reach.Scope(tmp_path / "none"))
    assert [path for path, _ in found.gateways] == [theirs / "a.control"], "b is not of the folder's owner"
    assert reach.search(reach.Scope(Path("/x"), folder_only=True)).gateways
    assert not reach.search(reach.Scope(tmp_path, folder_only=True)).gateways


@each(("words", "is_one"), [
    (["/usr/bin/python3", "/usr/local/bin/mount-gateway", "run", "--mount", "x"], True),
    (["/v/bin/python", "-bb", "-m", "gateway", "demo"], True),
    (["python3.11", "/src/gateway/__main__.py", "run"], True),
    (["mount-gateway", "run"], True),
    (["/usr/bin/python3", "/usr/local/bin/mount-gateway", "stop"], False),
    (["/usr/bin/python3", "/usr/local/bin/mount-gateway", "sim", "nexstar"], False),
    (["sudo", "mount-gateway", "run"], False), (["vi", "mount-gateway", "run"], False),
    (["python", "-m", "pytest", "gateway"], False), ([""], False), ([], False), (["mount-gateway"], False),
])  # fmt: skip
def test_gateway_process_is_recognised_by_its_command_line(words: list[str], is_one: bool) -> None:
    assert is_gateway_argv([*words, ""]) is is_one


@LINUX
def test_gateway_is_found_among_the_running_processes(started: list[Running]) -> None:
    gateway = Running("run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0")
    started.append(gateway)
    gateway.ready()
    pid = gateway.process.pid
    assert GatewayProcess(pid, os.getuid()) in processes.gateways()
    assert processes.is_gateway(pid)
    gateway.end()
    assert not processes.is_gateway(pid) and not processes.exists(pid)


@LINUX
def test_process_with_an_unfamiliar_name_is_not_taken_for_dead(
    tmp_path: Path, stop: Stop, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Started by another program, for one: it has the port, and it does not answer."""
    monkeypatch.setattr(reach, "RECEIPT_TIMEOUT", 0.2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as frozen:
        frozen.bind(("127.0.0.1", 0))
        other = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
        endpoint = ControlEndpoint("m", other.pid, frozen.getsockname()[1], "s", str(tmp_path))
        (tmp_path / "m.control").write_bytes(msgspec.json.encode(endpoint))
        code, words = stop("--state", str(tmp_path))
        assert code == 1 and f"the gateway (process {other.pid}) does not answer" in words
        other.communicate(b"\n", PATIENCE)
        assert stop("--state", str(tmp_path)) == (0, NOTHING)
    assert list(tmp_path.iterdir()) == []
