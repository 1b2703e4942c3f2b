"""The demo beside other programs: it takes what is free and says so, and what is theirs stays theirs."""

from __future__ import annotations

import errno
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.cli.serve import demo
from gateway.core.errors import UserError
from gateway.system.own_commands import own_command
from gateway.transport.device_link import DeviceLink, is_path_free
from tests.support.process import Running
from tests.unit.cli.test_command_line import refused

pytestmark = pytest.mark.skipif(os.name != "posix", reason="there are no pseudo-terminals")


@pytest.fixture
def terminal() -> Iterator[str]:
    """A pseudo-terminal that another program holds."""
    master, slave = os.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_demo_refuses_to_replace_a_serial_port_link_in_use(tmp_path: Path, terminal: str) -> None:
    path = tmp_path / "lx200"
    path.symlink_to(terminal)
    assert f"link of that name to {terminal}" in refused("demo", "--port", "0", "--pty", str(path))
    assert os.readlink(path) == terminal
    assert not is_path_free(str(path)) and os.readlink(path) == terminal


def test_demo_replaces_the_symbolic_link_of_a_killed_gateway(
    tmp_path: Path, terminal: str, started: list[Running]
) -> None:
    """Though its pseudo-terminal's number is another program's by now."""
    path = tmp_path / "lx200"
    killed = Running("demo", "--port", "0", "--pty", str(path))
    started.append(killed)
    assert [killed.ready(), killed.ready(), killed.ready()][2] == f"pty:{path}"
    killed.end(signal.SIGKILL)
    path.unlink()
    path.symlink_to(terminal)
    link = DeviceLink(str(path))
    link.create("/dev/pts/99999")
    link.close()
    assert not path.is_symlink()


def test_demo_reports_a_folder_that_it_may_not_write_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(target: str, path: str) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "symlink", refuse)
    link = DeviceLink(str(tmp_path / "lx200"))
    with pytest.raises(UserError, match="choose a folder"):
        link.create("/dev/pts/0")
    link.close()


def test_demo_takes_the_next_free_link_name(tmp_path: Path, terminal: str) -> None:
    path = tmp_path / "lx200"
    assert demo.find_free_pty_path(str(path)) == str(path)
    path.symlink_to(terminal)
    (tmp_path / "lx200-2").write_text("mine")
    (tmp_path / "lx200-3").symlink_to("/dev/pts/99999")  # nobody's
    assert demo.find_free_pty_path(str(path)) == f"{path}-3"
    assert (os.readlink(path), (tmp_path / "lx200-2").read_text()) == (terminal, "mine")
    with pytest.raises(UserError, match="is in use"):
        DeviceLink(str(path)).check_path()


def test_demo_takes_the_next_free_port(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        number = taken.getsockname()[1]
        assert number < demo.find_free_port(number) < number + demo.MAX_TRIES


def test_demo_prints_the_free_port_and_link_it_takes_instead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    monkeypatch.setattr(demo, "find_free_port", lambda first: first + 1)
    monkeypatch.setattr(demo, "find_free_pty_path", lambda path: str(tmp_path / "lx200-2"))
    monkeypatch.setattr(
        demo, "serve_mounts", lambda config, banner: told.extend([banner, *(surface.at for surface in config.surface)])
    )
    monkeypatch.setattr(demo, "run_on_loop", lambda fast, serve: serve() or 0)
    from gateway.cli import main

    assert main(["demo"]) == 0
    for word in ("port 4031", f"takes {tmp_path / 'lx200-2'}", "Ctrl-C", f"{own_command()} goto Polaris"):
        assert word in told[0]
    assert told[1:] == ["any@tcp://127.0.0.1:4042", "lx200@tcp://127.0.0.1:4031", f"lx200@pty:{tmp_path / 'lx200-2'}"]


def test_demo_fails_if_the_explicitly_chosen_port_is_in_use() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        assert "the port is in use by another program" in refused("demo", "--port", str(taken.getsockname()[1]))
