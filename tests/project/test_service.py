"""The systemd unit: it runs this program with this configuration, may write where it must, and systemd accepts it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from gateway.astro.ephemeris import keeper
from gateway.cli import main
from gateway.cli.serve.service import escape_word, unit_text
from tests.support.each import each


def lines(text: str, key: str) -> list[str]:
    """The values of a key."""
    return [line.partition("=")[2] for line in text.splitlines() if line.startswith(f"{key}=")]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A configuration."""
    path = tmp_path / "gateway.toml"
    path.write_text('[mount]\nat = "nexstar@sim"\n[[surface]]\nat = "lx200@pty:/tmp/lx200"\n')
    return path


def test_systemd_unit_runs_and_stops_this_program() -> None:
    text = unit_text(["/opt/a b/python", "-m", "gateway"], "/etc/gate way.toml", "daemon", "uucp", "mount-gateway-east")
    assert lines(text, "ExecStart") == ['"/opt/a b/python" -m gateway run --wait --config "/etc/gate way.toml"']
    assert lines(text, "ExecStopPost") == ['"/opt/a b/python" -m gateway stop']
    assert lines(text, "Type") == ["notify"] and lines(text, "Restart") == ["on-failure"]
    assert int(lines(text, "TimeoutStartSec")[0]) > keeper.TIMEOUT, "a site in minutes is translated first"
    assert lines(text, "User") == ["daemon"] and lines(text, "SupplementaryGroups") == ["uucp"]
    assert lines(text, "StateDirectory") == ["mount-gateway-east"]
    assert lines(text, "CacheDirectory") == ["mount-gateway"], "services share the almanac"
    assert lines(text, "WantedBy") == ["multi-user.target"] and lines(text, "ReadWritePaths") == ["-/tmp"]
    for key in ("PrivateTmp", "PrivateDevices", "ProtectClock", "DevicePolicy", "DynamicUser"):
        assert not lines(text, key), f"{key} would hide the ports"


@each(
    ("text", "written"),
    [("/a/b", "/a/b"), ("/a b", '"/a b"'), ("50%", "50%%"), ("$x", "$$x"), ('a"b', '"a\\"b"'), ("a\\b", '"a\\\\b"')],
)
def test_service_command_quotes_words_as_systemd_reads_them(text: str, written: str) -> None:
    assert escape_word(text) == written


def test_dollar_in_the_programs_path_is_not_expanded_by_systemd() -> None:
    text = unit_text(["/opt/$x/python", "$y"], "/etc/g.toml", "daemon", "dialout", "mount-gateway")
    assert lines(text, "ExecStopPost") == ["/opt/$x/python $$y stop"]


def test_service_command_prints_the_unit(
    path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SUDO_USER", "daemon")
    monkeypatch.chdir(path.parent)
    assert main(["service", "--config", path.name]) == 0
    text = capsys.readouterr().out
    assert lines(text, "User") == ["daemon"] and lines(text, "StateDirectory") == ["mount-gateway"]
    assert lines(text, "ExecStart")[0].endswith(f"run --wait --config {path}")
    if shutil.which("systemd-analyze"):
        saved = path.with_name("mount-gateway.service")
        saved.write_text(text)
        done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(saved)], capture_output=True, text=True,
                              timeout=20, check=False)  # fmt: skip
        if "mount-gateway.service" in done.stderr or done.returncode == 0:  # else it cannot run at all here
            assert (done.returncode, done.stderr) == (0, "")
    assert main(["service", str(path), "--unit", "east"]) == 0
    assert lines(capsys.readouterr().out, "StateDirectory") == ["mount-gateway-east"]


@pytest.mark.parametrize(
    ("mount", "words", "says"),
    [('"\nx = "', [], "x"), ('"\nstate = "/srv/state', [], "take out the key state"),
     ("", ["--unit", "a b"], "write a word of letters"), ("", ["--user", "nobody-of-that-name"], "has no user")],
)  # fmt: skip
def test_configuration_unfit_for_a_service_is_refused(
    mount: str, words: list[str], says: str, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path.write_text(path.read_text().replace("@sim", f"@sim{mount}"))
    assert main(["service", str(path), "--user", "daemon", *words]) == 2
    assert says in capsys.readouterr().err


def test_service_command_names_the_next_step_when_file_or_user_is_missing(
    path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["service", str(path.parent / "other.toml")]) == 2
    assert "mount-gateway detect --network --write gateway.toml" in capsys.readouterr().err
    monkeypatch.delenv("SUDO_USER", raising=False)
    monkeypatch.setattr(os, "getuid", lambda: 0)
    assert main(["service", str(path)]) == 2
    assert "--user NAME" in capsys.readouterr().err
