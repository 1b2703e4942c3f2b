"""Locks and the folders they lie in: nobody else's, whose they are is told, and no mount has two gateways."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.app.config import parse_endpoint
from gateway.app.state.mount_claim import claim_mount, lock_name
from gateway.core.errors import UserError
from gateway.system import runtime_folders as runtime
from gateway.system.locks import LockHeld, NameClaim, PidLock, read_pid
from gateway.system.runtime_folders import find_folders, user_id
from gateway.transport.device_link import DeviceLink
from tests.support.each import each
from tests.support.process import PATIENCE

ROOT = pytest.mark.skipif(user_id() != 0, reason="only root can make another user's file")
POSIX = pytest.mark.skipif(os.name != "posix", reason="owners and modes")


@pytest.fixture
def base(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A temporary folder of this test's own, and no session."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    return tmp_path


def _mine(base: Path) -> Path:
    return base / f"mount-gateway-{user_id()}"


# --- folders ----------------------------------------------------------------------------------------------------


@POSIX
def test_lock_folders_are_private(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert find_folders() == ([_mine(base)], [])
    assert _mine(base).stat().st_mode & 0o777 == 0o700
    session = base / "session"
    session.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(session))
    assert find_folders() == ([session / "mount-gateway", _mine(base)], [])


@POSIX
@pytest.mark.parametrize(("make", "reason"), [
    (lambda path: path.write_text(""), "is not a directory"),
    (lambda path: path.symlink_to("/tmp"), "is not a directory"),
    (lambda path: (path.mkdir(), path.chmod(0o777)), "is open to other users; chmod 700 closes it"),
    pytest.param(lambda path: (path.mkdir(0o700), os.chown(path, 1, 1)), "belongs to the user daemon, not to you",
                 marks=ROOT),
])  # fmt: skip
def test_lock_folder_of_another_user_is_not_used_and_reported(
    base: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[[Path], Any], reason: str
) -> None:
    make(_mine(base))
    mine = base / "state" / "run"
    monkeypatch.setenv("STATE_DIRECTORY", str(mine.parent))
    assert find_folders() == ([mine], [f"{_mine(base)}: {reason}"]), "a place that nobody can take beforehand"
    DeviceLink(str(base / "lx200")).close()
    monkeypatch.setenv("STATE_DIRECTORY", "/proc/nowhere")
    assert find_folders()[0] == []
    with pytest.raises(UserError, match=f"cannot make {base}/lx200: no folder for its lock: .*{reason}"):
        DeviceLink(str(base / "lx200"))
    warned: list[str] = []
    assert claim_mount(parse_endpoint("nexstar@socket://10.0.0.5:4030"), warned.append) is None
    assert len(warned) == 1 and reason in warned[0]


@ROOT
def test_session_folder_of_another_user_is_ignored(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """``sudo -E`` brings one along."""
    session = base / "session"
    session.mkdir()
    os.chown(session, 1, 1)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(session))
    assert find_folders() == ([_mine(base)], [])
    assert list(session.iterdir()) == []


# --- locks ------------------------------------------------------------------------------------------------------

#: Takes a lock and says so, then waits for its end.
HOLDER = """
import sys
from pathlib import Path
from gateway.system.locks import PidLock
PidLock(Path(sys.argv[1])).acquire()
print("held", flush=True)
sys.stdin.read()
"""


def test_lock_names_its_holder_and_ends_with_the_process(tmp_path: Path) -> None:
    path = tmp_path / "x.lock"
    path.write_text("an older one, longer than any number\n")
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert holder.stdout is not None and holder.stdout.readline() == b"held\n"
    for _ in range(2):  # who only tries changes nothing
        with pytest.raises(LockHeld, match=f"process {holder.pid}"):
            PidLock(path).acquire()
        assert path.read_text() == f"{holder.pid}\n"
    holder.kill()
    holder.communicate(timeout=PATIENCE)
    lock = PidLock(path)
    lock.acquire()
    assert read_pid(path) == os.getpid()
    lock.release()
    PidLock(path).acquire()


@POSIX
def test_lock_that_is_a_link_pipe_or_folder_is_refused(tmp_path: Path) -> None:
    target = tmp_path / "target"
    (tmp_path / "a.lock").symlink_to(target)
    os.mkfifo(tmp_path / "b.lock")
    (tmp_path / "c.lock").mkdir()
    for name in "abc":
        with pytest.raises(OSError, match=r".+"):
            PidLock(tmp_path / f"{name}.lock").acquire()
        assert read_pid(tmp_path / f"{name}.lock") is None
    assert not target.exists()


def test_lock_is_exclusive_across_session_and_system_folders(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a system service, which has no session, and of the user himself."""
    service = NameClaim("x")
    (base / "session").mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base / "session"))
    with pytest.raises(LockHeld, match=f"process {os.getpid()}"):
        NameClaim("x")
    service.release()
    mine = NameClaim("x")
    paths = [folder / "x.lock" for folder in find_folders()[0]]
    assert [read_pid(path) for path in paths] == [os.getpid()] * 2
    mine.release()
    assert [path.exists() for path in paths] == [False, False]


# --- mounts behind a network address ----------------------------------------------------------------------------


@each(("where", "name"), [
    ("socket://10.0.0.5:4030", "mount_10.0.0.5_4030"),
    ("rfc2217://10.0.0.5:4030?ign_set_control", "mount_10.0.0.5_4030"),
    ("socket://Localhost:4030", "mount_127.0.0.1_4030"), ("socket://[::1]:4030", "mount_127.0.0.1_4030"),
    ("socket://[fe80::1]:1", "mount_fe80_1_1"), ("socket://../../x:1", None), ("socket://host", None),
    ("socket://host:x", None), ("socket://[", None), ("/dev/ttyUSB0", None), ("COM3", None), ("sim", None),
    ("hwgrep://0403:6001", None),
])  # fmt: skip
def test_lock_of_an_address_ignores_its_spelling(where: str, name: str | None) -> None:
    assert lock_name(where) == name


# --- links of virtual serial ports ------------------------------------------------------------------------------


@POSIX
def test_virtual_port_link_is_made_though_predictable_names_are_taken(base: Path) -> None:
    path = base / "lx200"
    for taken in (path.with_name(f"lx200.{os.getpid()}"), *base.glob("mount-gateway-*.lock")):
        taken.mkdir()
    link = DeviceLink(str(path))
    link.create("/dev/pts/99999")
    with pytest.raises(UserError, match=rf"another gateway holds it \(process {os.getpid()}\)"):
        DeviceLink(str(path))
    assert {entry.name for entry in base.iterdir()} == {"lx200", f"lx200.{os.getpid()}", _mine(base).name}
    link.close()
    assert list(_mine(base).iterdir()) == [] and not path.is_symlink()


@ROOT
def test_live_port_link_of_another_user_is_not_replaced(base: Path) -> None:
    master, slave = os.openpty()
    path = base / "lx200"
    path.symlink_to(os.ttyname(slave))
    os.lchown(path, 1, 1)
    link = DeviceLink(str(path))
    with pytest.raises(UserError, match=f"cannot make {path}: the user daemon"):
        link.create("/dev/pts/99999")
    os.close(master)
    os.close(slave)
    link.create("/dev/pts/99999")
    link.close()
    assert runtime.user_id() == 0
