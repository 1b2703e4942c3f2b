"""Mistakes of newcomers: each message says what happened, where, and what to do about it."""

from __future__ import annotations

import os
import shlex
import signal
import socket
import time
from pathlib import Path

import pytest

from gateway.app.control.reach import explain_no_answer
from gateway.cli import main
from gateway.cli.serve.finding import port_advice
from gateway.system import processes
from gateway.transport.wires import open_port
from tests.support.each import each
from tests.support.process import GATEWAY, PATIENCE, Running, run_to_end
from tests.unit.cli.test_command_line import refused

PLAIN = ("--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0")


@each(
    ("typed", "says"),
    [
        ("", "mount-gateway demo needs no mount"),
        ("rum", "did you mean mount-gateway run?"),
        ("Detect", "did you mean mount-gateway detect?"),
        ("start", "did you mean mount-gateway run?"),
        ("record", "mount-gateway run --record FILE"),
        ("gateway.toml", "mount-gateway run gateway.toml"),
        ("nexstar@sim", "mount-gateway run --mount nexstar@sim"),
        ("--mount x", "mount-gateway run --mount"),
        ("run --mont x", "did you mean --mount?"),
        ("run --write x", "mount-gateway detect has it"),
        ("run --name pier", "mount-gateway config --example"),
        ("run nexstar@sim lx200@tcp://:0", "write --mount before the mount"),
        ("run nexstar@sim", "write --mount before the mount"),
        ("run PLAIN --site 48.1 11.6", "--site 48.1,11.6"),
        ("run --mount nexstar@sim --surface 4030", "for example lx200@tcp://"),
        ("run a.toml --config b.toml", "write one file"),
        ("explain :GR#", "missing: mount, command; for example: mount-gateway explain lx200 nexstar :MS#"),
        ("decode", "missing: FILE; for example: mount-gateway decode night.rec"),
        ("completion", "missing: shell; for example: mount-gateway completion bash"),
        ("completion tcsh", "shell 'tcsh': write one of bash, zsh, fish"),
        ("demo --speed fast", "--speed 'fast': write a number"),
        ("demo --port x", "--port 'x': write a whole number"),
        ("sim nexstar --latency slow", "--latency 'slow': write a number"),
        ("run --mount", "--mount: write its value after it"),
        ("stop --hold --release", "write --hold or --release, not both"),
        ("run --mount nexstar /dev/ttyUSB0", "write --mount nexstar@/dev/ttyUSB0"),
        ("run --surface lx200 tcp://127.0.0.1:4030", "write --surface lx200@tcp://127.0.0.1:4030"),
        ("run PLAIN --surface nexstar@tcp://:0 --allow 10.0.0.1", "write allow in gateway.toml"),
        ("run PLAIN --surface lx200@pty:/tmp/x --read-only", "write read-only in gateway.toml"),
        (
            "run --mount nexstar@sim --surface lx200@pty:/tmp/x --surface lx200@pty:/tmp/y --allow 10.0.0.1",
            "none of these surfaces is on a network",
        ),
        ("run --mount nexstar@sim --surface lx200@pty:/tmp/x --allow 10.0.0.1", "write it on a surface at tcp"),
        ("run PLAIN --names pier", "only programs that speak HTTP need this"),
        ("run PLAIN --surface nexstar@tcp://:0 --names pier", "none of these surfaces is for HTTP"),
        ("run PLAIN --names http://pier/", "write a list"),
        ("run PLAIN --allow 10.0.0.1/8", "--allow '10.0.0.1/8': write 10.0.0.0/8"),
        ("run lost.toml", "--write lost.toml"),
        ("run none/lost.toml", "there is no folder none"),
        ("run --mount foo@sim --surface lx200@tcp://127.0.0.1:0", "write nexstar for a Celestron"),
        ("run --mount nexstar@sim --surface foo@tcp://127.0.0.1:0", "write nexstar for"),
        ("run --mount alpac@sim", "did you mean 'alpaca'?"),
        ("--json", "mount-gateway detect --json"),
        ("--run", "did you mean mount-gateway run?"),
        ("--foo", "a command comes first"),
        ("run --no-night=1", "--night/--no-night takes no value: leave '1' out"),
        ("run .", "write the name of a file in it"),
        ("decode lost.rec", "--record lost.rec"),
        ("detect /dev/null --write none/g.toml", "there is no folder none"),
        ("run PLAIN --state {} --record none/night.rec", "there is no folder none"),
        ("sim nexstar --truth none/t.jsonl", "there is no folder none"),
        ("config PLAIN --mount lx200@sim", "--mount is given twice"),
        ("config --config a.toml --config b.toml", "--config is given twice: write one file"),
        ("config PLAIN --allow 192.168.1.0/24", "no program could connect"),
        ("config PLAIN --site 45", "--site '45': write LAT,LON, north and east positive: 45.5,-122.7 or"),
        ("config PLAIN --site 148,11", "--site '148,11': latitude is -90 to 90"),
        ("sim nexstar --site Rome", "--site 'Rome': write LAT,LON"),
        ("sim nexstar --time yesterday", "--time 'yesterday': write it like 2026-01-15T22:00:00Z"),
        ("explain lx200 nexstar :Zz#", "':Zz#'"),
        ("explain nexstar lx200 '\\xfe'", "; mappings/README.md lists them all"),
        ("move up", "write one of north"),
        ("move north --rate 12", "--rate 12: write one of 1, 2, 3, 4, 5, 6, 7, 8, 9 ("),
        (
            "run --mount nexstar@sim --surface lx200@tcp://192.0.2.7:4030 --state {}",
            "this computer has no such address",
        ),
        (
            "run --mount nexstar@/dev/does-not-exist --surface lx200@tcp://127.0.0.1:0",
            "no such port; mount-gateway detect",
        ),
        ("run --mount nexstar:gpe@sim --surface lx200@tcp://127.0.0.1:0", "did you mean"),
        ("run --mount nexstr@sim --surface lx200@tcp://127.0.0.1:0", "neither a protocol"),
        ("run --mount nexstar:cge/new@sim --surface lx200@tcp://127.0.0.1:0", "not a version"),
        ("run --mount nexstar --surface lx200@tcp://127.0.0.1:0", "PROTOCOL"),
        ("run --mount nexstar@sim", "command line: at least one surface"),
        ("run --surface lx200@tcp://127.0.0.1:0", "which mount"),
        ("run --mount nexstar@sim --surface lx200@tcp://nowhere", "tcp://HOST:PORT"),
        ("run PLAIN --lowest 95", "lowest"),
        ("run PLAIN --sun near", "0 to 90"),
        ("run PLAIN --sun=-5", "0 to 90"),
        ("run PLAIN --hour-angle-limit 13", "up to 12"),
        ("run --mount nexstar@foo://bar --surface lx200@tcp://127.0.0.1:0", "foo://bar"),
        ("run --config /does/not/exist.toml", "/does/not/exist.toml"),
        ("sim nexstar:cge --site 91,0", "latitude"),
        ("sim nexstar:cge --speed 0", "--speed"),
        ("sim nexstar:cge --at pty:/does/not/exist/x", "/does/not/exist/x"),
        ("explain lx200 nexstar :XY#", "no command"),
        ("explain lx200 telescope :GR#", "'telescope' is neither a protocol (lx200, nexstar, alpaca) nor a model"),
        (
            "run --mount nexstar@sim --surface lx200@127.0.0.1:4030",
            "--surface: lx200@127.0.0.1:4030: write lx200@tcp://127.0.0.1:4030",
        ),
        ("run --mount nexstar@sim --surface lx200@tcp:127.0.0.1:4030", "write lx200@tcp://127.0.0.1:4030"),
        ("run --mount nexstar@sim --surface lx200@tcp:/[::1]:4030", "write lx200@tcp://[::1]:4030"),
        ("run --mount nexstar@sim --surface lx200@4030", "write lx200@tcp://127.0.0.1:4030"),
        ("run --mount nexstar@sim --surface lx200@socket://0.0.0.0:4030", "write lx200@tcp://0.0.0.0:4030"),
        (
            "run --mount 6se@192.168.1.5:4030 --surface lx200@tcp://127.0.0.1:0",
            "--mount 6se@192.168.1.5:4030: write 6se@socket://192.168.1.5:4030",
        ),
        (
            "run --mount lx200@tcp://10.0.0.1:4030 --surface lx200@tcp://127.0.0.1:0",
            "write lx200@socket://10.0.0.1:4030",
        ),
        ("run --mount lx200@pty:/tmp/meade --surface lx200@tcp://127.0.0.1:0", "write lx200@/tmp/meade"),
        ("run --mount nexstar@sim --surface lx200@tcp://no-computer.invalid:4030", "write 0.0.0.0 for every computer"),
        ("explain nexstar lx200 r34AB,12CE", "goto right ascension and declination"),
        ("explain lx200 nexstar GR", "did you mean ':GR#'? Its : is missing"),
        ("explain lx200 nexstar :GR", "did you mean ':GR#'? Its # is missing"),
        ("explain lx200 nexstar e", "write explain nexstar lx200"),
        ("sim nexstar --at 5000", "write --at tcp://127.0.0.1:5000"),
        ("demo --speed 0", "--speed 0.0: write a number more than 0"),
        ("demo --port 70000", "--port: tcp://127.0.0.1:70000: a port is a number"),
        ("demo --port 0 --pty /does/not/exist/x", "/does/not/exist/x"),
        ("run --site 151.2,-33.9", "the latitude comes first: -33.9,151.2?"),
        ("sim nexstar:cpc --site -33.9,500", "longitude -180 to 180"),
        ("config", "which mount?"),
        ("run PLAIN --baud fast", "--baud 'fast': write a whole number"),
        ("run PLAIN --lowest 20 --highest 10", "--lowest 20: write less than highest"),
        ("run PLAIN --mode altaz", "--mode 'altaz': write one of alt-az"),
        ("run PLAIN --park=1,x", "--park '1,x'"),
        ("run --mount nexstar@sim --surface lx200@tcp://:99999", "--surface: tcp://:99999: a port is"),
        (
            "run --mount nexstar@sim --surface lx200@tcp://:4055 --surface nexstar@tcp://:4055",
            "tcp://:4055 is already in use by another",
        ),
    ],
)
def test_command_line_mistake_gets_one_line_that_says_what_to_write(
    typed: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In an empty folder; PLAIN are a mount and a surface without a mistake, {} is a folder that there is not."""
    monkeypatch.chdir(tmp_path)
    words = shlex.split(typed.replace("PLAIN", " ".join(PLAIN)).replace("{}", str(tmp_path / "state")))
    assert says in refused(*words)


def test_port_used_by_another_gateway_is_reported_with_its_process(tmp_path: Path) -> None:
    first = Running("run", *PLAIN, "--state", str(tmp_path / "first"), by=GATEWAY)
    where = first.ready()
    said = refused("run", *PLAIN[:3], f"lx200@{where}", "--state", str(tmp_path))
    first.end()
    assert f"another mount-gateway (process {first.process.pid})" in said and "write another port" in said


def test_failed_run_does_not_warn_of_ports_that_it_does_not_serve(tmp_path: Path) -> None:
    at = ("--mount", f"nexstar@{tmp_path / 'none'}", "--surface", "lx200@tcp://0.0.0.0:0", "--no-console")
    failed = run_to_end("run", *at, "--no-discovery", "--state", str(tmp_path))
    assert failed.returncode == 2
    assert failed.stderr.startswith(f"mount-gateway: nexstar@{tmp_path / 'none'}: cannot open ")


def test_unknown_host_name_is_named_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*_: object, **__: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr("socket.create_connection", unknown)
    for url in ("socket://scope.invalid:4030", "rfc2217://scope.invalid:4030"):
        with pytest.raises(OSError, match="no address is known for the name scope"):
            open_port(url, 9600)


def test_advice_for_a_silent_network_port_asks_whether_it_is_switched_on() -> None:
    for where in ("socket://127.0.0.1:9", "rfc2217://pier:4000"):
        assert "is it switched on" in port_advice(where)
    assert "mount-gateway detect" in port_advice("/dev/ttyUSB9")


def test_decode_refuses_a_file_that_is_no_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    noise = tmp_path / "noise.bin"
    noise.write_bytes(b"\x7fELF" + bytes(range(256)) * 64)
    assert main(["decode", "--protocol", "nexstar", str(noise)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "noise.bin: this is no recording" in err


def test_suspended_gateway_is_reported_as_suspended(started: list[Running], tmp_path: Path) -> None:
    gateway = Running("run", *PLAIN, "--state", str(tmp_path))
    started.append(gateway)
    gateway.ready()
    number = gateway.process.pid
    assert not processes.is_suspended(number)
    assert f"kill -9 {number}" in (words := explain_no_answer(number)) and "stop" in words and "-CONT" not in words
    os.kill(number, signal.SIGSTOP)
    try:
        until = time.monotonic() + PATIENCE
        while not processes.is_suspended(number):  # the signal takes a moment
            assert time.monotonic() < until
        assert f"kill -CONT {number}" in (words := explain_no_answer(number)) and f"kill -9 {number}" in words
    finally:
        os.kill(number, signal.SIGCONT)
    assert gateway.end() == 0


def test_run_reports_a_state_folder_that_is_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        where = f"lx200@tcp://127.0.0.1:{taken.getsockname()[1]}"
        assert main(["run", "--mount", "nexstar@sim", "--surface", where, "--state", str(tmp_path / "file")]) == 2
    told = capsys.readouterr().err.splitlines()
    assert f"{tmp_path / 'file'} cannot be written to" in told[0] and "folder" in told[0]
