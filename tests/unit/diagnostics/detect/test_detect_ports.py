"""Detection on real ports: pseudo-terminals, pyserial's own URLs, a socket, and the command line from end to end."""

from __future__ import annotations

import asyncio
import errno
import json
import os
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import serial
from serial.rfc2217 import PortManager

from gateway.app.config import Endpoint, make_config, read_tables
from gateway.app.simulated import make_simulator, serve_simulator
from gateway.cli import main
from gateway.cli.inspect.detect import write_atomically
from gateway.core.errors import UserError
from gateway.diagnostics.detect import ports
from gateway.diagnostics.detect.ports import SerialPortInfo, local_ports, parse_port, persistent_name, port_holder
from gateway.diagnostics.detect.scan_port import PortFinding, ProbeTimes, scan_port
from gateway.system.processes import GatewayProcess
from gateway.transport.baud import garble
from gateway.transport.pty import baud_rate_of
from tests.support.process import Running

PATIENCE = 20.0
#: For devices that are known to answer, at once on an idle computer; for echoes; and for those that never answer.
EAGER = ProbeTimes(required_silence=0.05, silence_timeout=0.2, query_interval=0.1, answer_timeout=3.5)
HURRY = ProbeTimes(required_silence=0.05, silence_timeout=0.2, query_interval=0.1, answer_timeout=0.4)
GLANCE = ProbeTimes(required_silence=0.02, silence_timeout=0.1, query_interval=0.03, answer_timeout=0.06)
MOUNTS = ("lx200:lx200", "lx200:autostar", "lx200:lx200gps", "nexstar:nexstar-gps/1.2", "nexstar:6-8se/4.21")
GPS = b"$GPGLL,4500.00,N,01000.00,E,220000.00,A*04\r\n"


class Terminal:
    """A pseudo-terminal and somebody behind it, who hears what arrives."""

    def __init__(self, answer: Callable[[bytes], bytes] = lambda data: b"") -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path, self.heard, self._answer = os.ttyname(self._slave), b"", answer
        asyncio.get_running_loop().add_reader(self.master, self._read)

    def _read(self) -> None:
        data = os.read(self.master, 1000)
        self.heard += data
        os.write(self.master, self._answer(data))

    def close(self) -> None:
        if self.master >= 0:
            asyncio.get_running_loop().remove_reader(self.master)
            os.close(self._slave)
            os.close(self.master)
            self.master = -1


def at(path: str) -> SerialPortInfo:
    return SerialPortInfo(path, path)


async def _everybody(folder: Path) -> dict[str, Any]:
    """Everything at the same time: what needs real time is waited for once."""
    ports, jobs = [], {}
    for index, what in enumerate((*MOUNTS, "lx200:lx200-16")):
        protocol, _, model = what.partition(":")
        name, _, version = model.partition("/")
        simulator = make_simulator(Endpoint(protocol, "-", name, version or None), clock=time.time)
        rate = 9600 if what in MOUNTS else 38400
        ports += await serve_simulator(simulator, [f"pty:{folder / str(index)}"], 0.01, rate)
        patience = {MOUNTS[0]: {"first_times": EAGER}, "lx200:lx200-16": {"first_times": HURRY}}.get(what, {})
        jobs[what] = scan_port(at(str(folder / str(index))), **patience)
    silent, echo, gps, vanishing, held = [Terminal(), Terminal(lambda data: data), Terminal(), Terminal(), Terminal()]
    jobs["silent"] = scan_port(at(silent.path), first_times=GLANCE, other_times=GLANCE)
    jobs["echo"] = scan_port(at(echo.path), first_times=HURRY)
    jobs["loop"] = scan_port(at("loop://"), first_times=HURRY)
    jobs["vanishing"] = scan_port(at(vanishing.path))
    jobs["gps"] = scan_port(at(gps.path))
    with serial.Serial(held.path, exclusive=True):
        jobs["held"] = scan_port(at(held.path))
        loop = asyncio.get_running_loop()
        timers = [loop.call_later(0.1 + 0.3 * turn, os.write, gps.master, GPS) for turn in range(3)]
        timers.append(loop.call_later(0.4, vanishing.close))
        found = dict(zip(jobs, await asyncio.gather(*jobs.values()), strict=True))
    found["heard"] = {"silent": silent.heard, "gps": gps.heard, "held": held.heard}
    for timer in timers:
        timer.cancel()
    for terminal in (silent, echo, gps, vanishing, held):
        terminal.close()
    for port in ports:
        await port.close()
    return found


@pytest.fixture(scope="module")
def cli(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, list[str]]]:
    """A simulated mount as a process, on a virtual serial port that understands 9600 baud only."""
    folder = tmp_path_factory.mktemp("cli")
    simulator = Running("sim", "nexstar:cpc/4.10", "--at", f"pty:{folder / 'mount'}", "--baud", "9600")
    simulator.ready()
    arguments = ["detect", "--json", str(folder / "mount"), str(folder / "none"), "--write", str(folder / "g.toml")]
    yield folder, arguments
    simulator.end()


@pytest.fixture(scope="module")
def found(cli: tuple[Path, list[str]], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """All findings; the command line looks while the others are looked at."""
    command = Running(*cli[1])
    everybody = asyncio.run(_everybody(tmp_path_factory.mktemp("ports")))
    told = command.finish()
    return {**everybody, "cli": (told.returncode, told.stdout, told.stderr)}


@pytest.mark.parametrize("what", MOUNTS)
def test_detect_finds_a_mount_on_a_pseudo_terminal(found: dict[str, Any], what: str) -> None:
    finding: PortFinding = found[what]
    assert finding.mount is not None, finding
    assert (finding.mount.protocol, finding.baud) == (what.partition(":")[0], 9600)
    assert finding.seconds < PATIENCE


def test_detect_finds_a_mount_at_another_rate_on_a_real_port(found: dict[str, Any]) -> None:
    finding = found["lx200:lx200-16"]
    assert finding.mount is not None, finding
    assert (finding.mount.model, finding.baud) == ("lx200-16", 38400)


def test_detect_sends_a_silent_real_port_only_harmless_requests(found: dict[str, Any]) -> None:
    assert found["silent"].state == "silent"
    assert found["heard"]["silent"] == b"Kx#\x06" * 11


@pytest.mark.parametrize(("what", "state"), [
    ("echo", "echo"), ("loop", "echo"), ("gps", "gps"), ("vanishing", "vanished"), ("held", "busy"),
])  # fmt: skip
def test_detect_reports_a_device_that_is_no_mount(found: dict[str, Any], what: str, state: str) -> None:
    assert (found[what].state, found[what].mount) == (state, None)


def test_detect_sends_nothing_to_a_talking_port_or_a_port_in_use(found: dict[str, Any]) -> None:
    assert (found["heard"]["gps"], found["heard"]["held"]) == (b"", b"")


def test_detect_command_writes_a_file_that_run_reads(found: dict[str, Any], cli: tuple[Path, list[str]]) -> None:
    code, out, error = found["cli"]
    folder = cli[0]
    mount, none = json.loads(out)
    assert (code, mount["state"], none["state"]) == (0, "mount", "unopened"), error
    assert "no such port" in none["words"]
    assert (mount["mount"]["model"], mount["mount"]["version"], mount["baud"]) == ("cpc", "4.10", 9600)
    assert mount["mount"]["run"] == (
        f"mount-gateway run --mount nexstar@{folder / 'mount'} --surface lx200@tcp://127.0.0.1:4030"
    )
    config = make_config(*read_tables(folder / "g.toml"))
    assert (config.mount[0].at, config.mount[0].baud) == (f"nexstar@{folder / 'mount'}", 9600)
    assert config.surface[0].at == "lx200@tcp://127.0.0.1:4030"
    assert sorted(path.name for path in folder.iterdir()) == ["g.toml", "mount"]


def test_detect_ends_with_code_1_without_a_mount_and_2_after_a_mistake(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = tmp_path / "gateway.toml"
    there.write_text("mine")
    none = str(tmp_path / "none")
    assert main(["detect", none]) == 1
    assert capsys.readouterr().out == f"{none}\n  cannot be opened: no such port\n"
    assert main(["detect", "--write", str(there), none]) == 2
    assert f"{there} exists already; --force" in capsys.readouterr().err
    assert there.read_text() == "mine"


def test_detect_writes_its_file_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "gateway.toml"
    write_atomically(path, "new", force=False)
    with pytest.raises(UserError, match="--force"):
        write_atomically(path, "newer", force=False)
    assert path.read_text() == "new"
    write_atomically(path, "newer", force=True)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["newer"]
    with pytest.raises(UserError, match="there is no folder"):
        write_atomically(tmp_path / "no" / "gateway.toml", "new", force=False)
    (tmp_path / "folder").mkdir()
    with pytest.raises(UserError):
        write_atomically(tmp_path / "folder", "new", force=True)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["folder", "gateway.toml"]


def test_detect_reports_a_folder_that_it_may_not_write_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path, mode: str) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(UserError, match=r"gateway\.toml: Permission denied"):
        write_atomically(tmp_path / "gateway.toml", "new", force=False)


def test_detect_reports_a_port_that_it_may_not_open(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port /dev/x: [Errno 13] Permission denied: '/dev/x'")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    finding = asyncio.run(scan_port(at("/dev/x")))
    assert finding.state == "unopened"
    assert "dialout" in finding.reason


def test_detect_names_the_program_that_has_a_port_open_without_a_lock(tmp_path: Path) -> None:
    port, link = tmp_path / "ttyUSB0", tmp_path / "by-id"
    port.write_bytes(b"")
    link.symlink_to(port)
    assert port_holder(str(port)) == ""
    with port.open("rb"):
        assert f"(process {os.getpid()})" in port_holder(str(link))
        finding = asyncio.run(scan_port(at(str(link))))
    assert (finding.state, finding.seconds) == ("busy", 0.0)
    assert "in use by" in finding.reason


@pytest.mark.parametrize("theirs", [True, False])
def test_detect_says_that_another_users_gateway_may_have_the_port(
    theirs: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("gateway.app.control.reach.user_id", lambda: 1000)
    monkeypatch.setattr(ports, "gateways", lambda: [GatewayProcess(4711, 0 if theirs else 1000)])
    master, slave = os.openpty()
    try:
        with serial.Serial(port := os.ttyname(slave), exclusive=True):
            assert main(["detect", port]) == 1
            told = capsys.readouterr()
            assert main(["run", "--mount", f"nexstar@{port}", "--surface", "lx200@tcp://127.0.0.1:0"]) == 2
            run = capsys.readouterr().err
    finally:
        os.close(master)
        os.close(slave)
    if theirs:
        assert "the user root (process 4711)" in told.out
        assert f"{port}: sudo mount-gateway status" in told.err
        assert "the user root (process 4711): sudo" in run
    else:
        assert "in use by another program" in told.out
        assert "close that program" in told.err and "end it first" in run


def test_detect_writes_the_persistent_name_of_a_port(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device, folder = tmp_path / "ttyUSB0", tmp_path / "by-id"
    device.write_bytes(b"")
    folder.mkdir()
    (folder / "usb-Prolific-if00").symlink_to(device)
    assert persistent_name(str(device), folder) == str(folder / "usb-Prolific-if00")
    assert persistent_name("/dev/ttyS0", folder) == "/dev/ttyS0"
    assert persistent_name("COM3", tmp_path / "none") == "COM3"

    class Port:
        device, description = "/dev/ttyUSB7", "USB-Serial Controller"

    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [Port])
    assert local_ports() == [SerialPortInfo("/dev/ttyUSB7", "/dev/ttyUSB7", "USB-Serial Controller")]


def test_detect_accepts_an_endpoint_as_a_port() -> None:
    assert parse_port("lx200@/dev/ttyS0").typed_endpoint == Endpoint("lx200", "/dev/ttyS0")
    assert parse_port("/dev/serial/by-path/pci-0000:00:1d.0@1").typed_endpoint is None
    with pytest.raises(UserError, match="no model"):
        parse_port("nexstar:cpx@/dev/ttyS0")


# --- over the network ---------------------------------------------------------------------------------------------


class FarPort:
    """What an RFC 2217 server needs of its serial port; the server sets whatever it likes, and bytes go to a device."""

    cts = dsr = ri = cd = False
    baudrate, bytesize, parity, stopbits = 9600, 8, "N", 1
    rtscts = xonxoff = False
    dtr = rts = break_condition = False

    def reset_input_buffer(self) -> None: ...

    reset_output_buffer = reset_input_buffer


def serve_rfc2217(listener: socket.socket, device: Callable[[bytes], bytes]) -> None:
    """One client of a serial port elsewhere."""
    link, _ = listener.accept()

    class Connection:
        write = staticmethod(link.sendall)

    with link:
        manager = PortManager(FarPort(), Connection())
        while data := link.recv(1000):
            answer = device(b"".join(manager.filter(data)))
            link.sendall(b"".join(manager.escape(answer)))


@pytest.mark.filterwarnings("ignore::DeprecationWarning:serial.*")  # its client names its thread as of old
def test_detect_finds_a_mount_behind_rfc2217() -> None:
    sim = make_simulator(Endpoint("nexstar", "-", "cge", "3.02"), clock=time.time)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        server = threading.Thread(target=serve_rfc2217, args=(listener, sim.feed), daemon=True)
        listener.settimeout(5.0)
        server.start()
        finding = asyncio.run(scan_port(at(f"rfc2217://127.0.0.1:{listener.getsockname()[1]}")))
        server.join(5.0)
    assert finding.mount is not None, finding
    assert (finding.mount.model, finding.baud) == ("cge", None)


def test_detect_finds_a_mount_behind_a_socket() -> None:
    async def program() -> PortFinding:
        simulator = make_simulator(Endpoint("lx200", "-", "lx200gps"), clock=time.time)
        [port] = await serve_simulator(simulator, ["tcp://127.0.0.1:0"], 0.0)
        finding = await scan_port(at(port.address.replace("tcp:", "socket:")), first_times=EAGER)
        await port.close()
        return finding

    finding = asyncio.run(program())
    assert finding.mount is not None, finding
    assert (finding.mount.model, finding.baud) == ("lx200gps", None)


# --- the simulated UART -------------------------------------------------------------------------------------------


def test_simulated_line_garbles_bytes_received_at_another_baud_rate() -> None:
    everything = bytes(range(256))
    assert garble(everything, 9600, 9600) == everything
    assert garble(everything, 56700, 57600) == everything
    assert garble(b"\x06", 4800, 9600) == b"x"  # 0 0110 0000 1, each bit twice: 0 0001 1110, and no stop bit
    assert garble(b"\x00", 9600, 19200)[:1] == b"\x00"
    for rate in (1200, 4800, 19200, 38400):
        assert garble(b"Kx#\x06:GR#", rate, 9600) not in (b"Kx#\x06:GR#", b"")


def test_baud_rate_of_a_terminal_is_read_even_if_it_has_no_constant() -> None:
    master, slave = os.openpty()
    try:
        for rate in (9600, 14400, 57600):
            with serial.Serial(os.ttyname(slave), rate):
                assert baud_rate_of(slave) == rate
    finally:
        os.close(slave)
        os.close(master)


@pytest.mark.parametrize("rate", ["0", "-9600"])
def test_baud_rate_of_zero_or_less_is_refused(rate: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "nexstar:cpc", f"--baud={rate}", "--at", "pty:/tmp/never"]) == 2
    assert "--baud is a rate like 9600" in capsys.readouterr().err


@pytest.mark.parametrize(("text", "words"), [
    ("stellarium@/dev/ttyS0", "programs speak stellarium, and no mount does; write /dev/ttyS0 or lx200@/dev/ttyS0"),
    ("any@/dev/ttyS0", "write any@tcp://HOST:PORT, or one protocol"),
])  # fmt: skip
def test_client_only_protocol_is_refused_for_a_mount(text: str, words: str) -> None:
    with pytest.raises(UserError) as raised:
        parse_port(text)
    assert words in str(raised.value)
