"""The systemd unit: it runs this program with this configuration, may write where it must, and systemd accepts it."""

from __future__ import annotations

import getpass
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from gateway.app.config import Source, make_config
from gateway.astro.ephemeris import keeper
from gateway.cli import main
from gateway.cli.serve.service import program, unit, word
from tests.support.each import each

TABLES = {
    "mount": [{"at": "nexstar@/dev/ttyUSB0", "record": "/srv/nights/last.rec"}],
    "surface": [{"at": "lx200@pty:/run/scopes/lx200"}, {"at": "lx200@tcp://127.0.0.1:4030"}],
}


def lines(text: str, key: str) -> list[str]:
    """The values of a key."""
    return [line.partition("=")[2] for line in text.splitlines() if line.startswith(f"{key}=")]


def made(run: list[str] | None = None, **mount: str) -> str:
    tables = {**TABLES, "mount": [TABLES["mount"][0] | mount]}
    return unit(make_config(tables, Source("test")), Path("/etc/gate way.toml"), "daemon",
                run or ["/usr/bin/mount-gateway"])  # fmt: skip


def test_it_runs_and_stops_this_program() -> None:
    text = made(["/opt/a b/python", "-m", "gateway"])
    assert lines(text, "ExecStart") == ['"/opt/a b/python" -m gateway run --wait --config "/etc/gate way.toml"']
    assert lines(text, "ExecStopPost") == ['"/opt/a b/python" -m gateway stop']
    assert lines(text, "Type") == ["notify"]
    assert int(lines(text, "TimeoutStartSec")[0]) > keeper.LONGEST, "a site in minutes is translated first"
    assert lines(text, "User") == ["daemon"]
    assert lines(text, "StateDirectory") == lines(text, "CacheDirectory") == ["mount-gateway"]
    assert lines(made(state="/srv/state"), "ExecStopPost") == ["/usr/bin/mount-gateway stop --state /srv/state"]


def test_two_gateways_have_a_unit_each(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text('[mount]\nat = "nexstar@sim"\n[[surface]]\nat = "lx200@tcp://0.0.0.0:4030"\n')
    for words, name in (([], "mount-gateway"), (["--unit", "east"], "mount-gateway-east")):
        assert main(["service", "--config", str(path), "--user", "daemon", *words]) == 0
        text = capsys.readouterr().out
        assert text.startswith(f"# /etc/systemd/system/{name}.service, made by mount-gateway service\n")
        assert lines(text, "StateDirectory") == lines(text, "SyslogIdentifier") == [name]
        assert lines(text, "CacheDirectory") == ["mount-gateway"], "services share the almanac"
        assert lines(text, "Restart") == ["on-failure"] and lines(text, "After") == ["network.target"]
    assert main(["service", "--config", str(path), "--user", "daemon", "--unit", "a b"]) == 2
    assert "write a word of letters" in capsys.readouterr().err


def test_it_may_write_where_it_is_told_to_and_sees_serial_ports() -> None:
    text = made(state="/srv/my state")
    assert lines(text, "ReadWritePaths") == ["-/run/scopes", '"-/srv/my state"', "-/srv/nights", "-/tmp"]
    assert len(lines(text, "SupplementaryGroups")) == 1
    for key in ("PrivateTmp", "PrivateDevices", "ProtectClock", "DevicePolicy", "DynamicUser"):
        assert not lines(text, key), f"{key} would hide the ports"


@each(
    ("text", "written"),
    [("/a/b", "/a/b"), ("/a b", '"/a b"'), ("50%", "50%%"), ("$x", "$$x"), ('a"b', '"a\\"b"'), ("a\\b", '"a\\\\b"')],
)
def test_words_are_written_as_systemd_reads_them(text: str, written: str) -> None:
    assert word(text) == written


def test_the_command_prints_it(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
                               ) -> None:  # fmt: skip
    path = tmp_path / "gateway.toml"
    path.write_text('[mount]\nat = "nexstar@sim"\n[[surface]]\nat = "lx200@pty:/tmp/lx200"\n')
    monkeypatch.setenv("SUDO_USER", "daemon")
    monkeypatch.chdir(tmp_path)
    assert main(["service", "--config", "gateway.toml"]) == 0
    text = capsys.readouterr().out
    assert lines(text, "User") == ["daemon"]
    assert lines(text, "ExecStart")[0].endswith(f"run --wait --config {path}")
    if shutil.which("systemd-analyze"):
        saved = tmp_path / "mount-gateway.service"
        saved.write_text(text)
        done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(saved)], capture_output=True, text=True,
                              timeout=60, check=False)  # fmt: skip
        if "mount-gateway.service" in done.stderr or done.returncode == 0:  # else it cannot run at all here
            assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("surface", "says"),
    [("lx200@pty:lx200", "'lx200': a service needs whole paths"), ("lx201@tcp://:0", "'lx201' is no protocol")],
)
def test_a_configuration_that_cannot_serve_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], surface: str, says: str
) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text(f'[mount]\nat = "nexstar@sim"\n[[surface]]\nat = "{surface}"\n')
    assert main(["service", "--config", str(path), "--user", "daemon"]) == 2
    error = capsys.readouterr().err
    assert says in error and str(path) in error


def test_what_is_missing_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "gateway.toml"
    assert main(["service", "--config", str(path)]) == 2
    assert f"{path}: no such file; mount-gateway detect --network --write gateway.toml" in capsys.readouterr().err
    path.write_text('[mount]\nat = "nexstar@sim"\n[[surface]]\nat = "lx200@tcp://:0"\n')
    monkeypatch.delenv("SUDO_USER", raising=False)
    monkeypatch.setattr(getpass, "getuser", lambda: "root")
    assert main(["service", "--config", str(path)]) == 2
    assert "--user NAME" in capsys.readouterr().err


def test_the_program_is_found_wherever_it_was_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "mount-gateway"
    script.write_text("#!/bin/sh\n")
    script.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["./mount-gateway", "service"])
    assert program() == [str(script)]
    monkeypatch.setattr("sys.argv", ["/x/gateway/__main__.py", "service"])
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    assert program() == [str(script)]
    os.unlink(script)
    assert program() == [str(tmp_path / "python"), "-m", "gateway"]
