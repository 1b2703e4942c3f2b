"""What a person reads of detect: what to start, for this computer and for a phone, and what to try when there is no
mount; and of the service that is made of the same file."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
import serial

from gateway.app.config import make_config, read_tables
from gateway.cli import main
from gateway.diagnostics.detect.identify import FoundMount
from gateway.diagnostics.detect.ports import SerialPortInfo
from gateway.diagnostics.detect.report import as_toml, describe_port, next_steps, port_values
from gateway.diagnostics.detect.scan_port import PortFinding
from gateway.transport.wires import group_of
from tests.support.each import each
from tests.support.process import Running

PORT = "/dev/ttyUSB0"


def mount(protocol: str = "nexstar") -> PortFinding:
    made = FoundMount(protocol, "Celestron NexStar", "cpc", "4.21", (), 0.1, "jnow", True, False, True, True, {})
    return PortFinding(SerialPortInfo(PORT, PORT), protocol, 9600, mount=made)


@pytest.mark.parametrize(("protocol", "programs"), [("nexstar", "lx200"), ("lx200", "nexstar")])
def test_detect_prints_run_commands_for_this_computer_and_for_phones(protocol: str, programs: str) -> None:
    lines = [line.strip() for line in describe_port(mount(protocol)).splitlines()]
    start = f"mount-gateway run --mount {protocol}@{PORT} --surface {programs}@tcp://"
    here, there = lines.index(f"{start}127.0.0.1:4030"), lines.index(f"{start}0.0.0.0:4030")
    assert lines[here - 1].startswith("start")
    assert "phones" in lines[there - 1] and "anyone" in lines[there - 1]
    told = port_values(mount(protocol))["mount"]
    assert told["run_network"].endswith("@tcp://0.0.0.0:4030") and told["run"].endswith("@tcp://127.0.0.1:4030")


@pytest.mark.parametrize("network", [False, True])
def test_detect_writes_the_file_for_the_requested_user(network: bool, tmp_path: Path) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text(as_toml(mount(), network))
    [surface] = make_config(*read_tables(path)).surface
    assert surface.at == f"lx200@tcp://{'0.0.0.0' if network else '127.0.0.1'}:4030"
    assert "anyone on your network" in path.read_text()
    assert ('# at = "lx200@tcp://0.0.0.0:4030"' in path.read_text()) is not network
    for program in ("pty:/tmp/lx200", "rfc2217://0.0.0.0:4032"):
        path.write_text(
            as_toml(mount(), network).replace(f'# at = "lx200@{program}"', f'[[surface]]\nat = "lx200@{program}"')
        )
        assert make_config(*read_tables(path)).surface[1].at == f"lx200@{program}"
    assert ("# allow = " in path.read_text()) is network


@each(
    ("finding", "says"),
    [
        (
            PortFinding(SerialPortInfo(PORT, PORT), "silent"),
            ["switch the mount on", "base of the hand control", "lx200@/dev/ttyUSB0"],
        ),
        (PortFinding(SerialPortInfo(PORT, PORT), "busy"), ["/dev/ttyUSB0 is in use: close that program"]),
        (PortFinding(SerialPortInfo(PORT, PORT), "served"), ["mount-gateway status shows this mount"]),
        (
            PortFinding(SerialPortInfo("socket://192.168.1.9:2000", PORT), "silent"),
            ["AUX protocol: that is not supported"],
        ),
        (PortFinding(SerialPortInfo("socket://1.2.3.4:4030", PORT), "silent"), ["AUX protocol: that is not supported"]),
        (PortFinding(SerialPortInfo(PORT, PORT), "unopened"), ["mount-gateway detect without a port"]),
        (PortFinding(SerialPortInfo("/dev/ttyS0", PORT), "silent"), ["built into this computer", "plug that in"]),
        (PortFinding(SerialPortInfo(PORT, PORT), "echo"), ["loopback plug"]),
        (PortFinding(SerialPortInfo(PORT, PORT), "garbled"), ["another cable"]),
    ],
)
def test_detect_without_a_mount_says_what_to_try(finding: PortFinding, says: list[str]) -> None:
    steps = "\n".join(next_steps([finding]))
    assert all(part in steps for part in says)
    assert next_steps([finding, mount()]) == []


def test_detect_without_a_port_says_what_to_try(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.diagnostics.detect.ports.local_ports", list)
    asked = []

    async def nobody(urls: list[str] | None) -> list[PortFinding]:
        asked.append(urls)
        return []

    monkeypatch.setattr("gateway.diagnostics.detect.scan_port.ask_servers", nobody)
    assert main(["detect"]) == 1
    told = capsys.readouterr()
    assert told.out == "no mount was found\n" and asked == [None]
    assert "plug in the USB adapter" in told.err and "socket://192.168.1.50:4030" in told.err
    assert main(["detect", "--json"]) == 1
    assert capsys.readouterr() == ("[]\n", "")


def test_detect_leaves_a_mount_used_by_a_gateway_alone(
    started: list[Running], capsys: pytest.CaptureFixture[str]
) -> None:
    sim = Running("sim", "nexstar:cpc", "--at", "tcp://127.0.0.1:0")
    started.append(sim)
    port = sim.ready().replace("tcp://", "socket://")
    serving = Running("run", "--mount", f"nexstar@{port}", "--surface", "lx200@tcp://127.0.0.1:0")
    started.append(serving)
    serving.ready()
    assert main(["detect", port]) == 1
    told = capsys.readouterr()
    assert f"mount-gateway, process {serving.process.pid}" in told.out
    assert f"  - {port}: mount-gateway status shows this mount" in told.err and "close that program" not in told.err


def test_detect_says_what_to_type_for_a_port_without_permission(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port /dev/x: [Errno 13] Permission denied: '/dev/x'")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    assert main(["detect", "/dev/x"]) == 1
    told = capsys.readouterr()
    assert "permission denied" in told.out
    assert "try next" not in told.err
    assert main(["run", "--mount", "nexstar@/dev/x", "--surface", "lx200@tcp://:0"]) == 2
    assert "sudo usermod -aG dialout $USER" in capsys.readouterr().err


def test_detect_suggests_no_group_for_a_port_that_no_group_may_use(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "Permission denied")

    port = tmp_path / "ttyS0"
    port.touch(0o600)
    monkeypatch.setattr(serial, "serial_for_url", refuse)
    assert main(["detect", str(port)]) == 1
    told = capsys.readouterr().out
    assert f"permission denied; no group may use {port}" in told and "plug in a USB adapter" in told
    assert "usermod" not in told


def test_detect_names_the_group_of_the_port(tmp_path: Path) -> None:
    import grp

    path = tmp_path / "port"
    path.touch()
    name = grp.getgrgid(os.stat(path).st_gid).gr_name
    assert group_of(str(path)) == ("dialout" if name in ("root", "wheel") else name)
    assert group_of(str(tmp_path / "none")) == "dialout"
