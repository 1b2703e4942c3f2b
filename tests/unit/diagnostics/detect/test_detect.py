"""Detection, in virtual time: every mount, every kind of stranger, and exactly the bytes that each of them is sent."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from gateway.app.config import Endpoint
from gateway.app.simulated import make_simulator
from gateway.diagnostics.detect.ports import SerialPortInfo, parse_port
from gateway.diagnostics.detect.report import as_toml, describe_port, start_command
from gateway.diagnostics.detect.scan_port import OTHER_BAUD_RATES, PortFinding, has_nmea_sentence, scan_port
from gateway.diagnostics.virtual_time import run
from tests.support.each import each
from tests.support.uart import Device, UartWire

EVENING = 1768514400.0
AT_9600, ELSEWHERE = 6.5, 20.0
#: What a line may be asked before it has said what it is.
HARMLESS = [b"Kx", b"#\x06"]
GPS = b"$GPRMC,220000.00,A,4500.0,N,01000.0,E,0.0,0.0,150126,,,A*5F\r\n"

MEADES = ("autostar", "lx200", "lx200-16", "lx200gps")
HAND_CONTROLS = {
    "nexstar-gps/1.2": "1.2", "nexstar-gps/1.6": "1.6", "i-series-se/2.2": "2.2", "cge/2.3": "2.3", "cge/3.01": "3.01",
    "4-5se/4.10": "4.10", "6-8se/4.21": "4.21", "cgx/5.31": "5.31", "6-8se/starsense-1.20": "1.20", "gt/101.0": "101.0",
    "gt/104.0": "104.0",
}  # fmt: skip


def mount(what: str) -> Any:
    """A simulated mount on the running loop's clock."""
    protocol, _, model = what.partition(":")
    name, _, version = model.partition("/")
    began = asyncio.get_running_loop().time()
    clock = asyncio.get_running_loop().time
    return make_simulator(Endpoint(protocol, "-", name, version or None), clock=lambda: EVENING + clock() - began)


def seen(
    make: Callable[[], Device],
    rate: int = 9600,
    place: SerialPortInfo = SerialPortInfo("-", "-"),
    *,
    talk: bytes = b"",
    latency: float = 0.1,
) -> tuple[PortFinding, UartWire]:
    """Look at a device in virtual time; one that talks does so every second."""

    async def program() -> tuple[PortFinding, UartWire]:
        wire = UartWire(make(), rate, latency)

        async def talking() -> None:
            while True:
                await asyncio.sleep(1.0)
                wire.say(talk)

        talker = asyncio.ensure_future(talking()) if talk else None
        finding = await scan_port(place, wire)
        if talker is not None:
            talker.cancel()
        assert not wire.is_open
        return finding, wire

    result: tuple[PortFinding, UartWire] = run(program())
    return result


def silent(data: bytes) -> bytes:
    return b""


# --- mounts -------------------------------------------------------------------------------------------------------


@each("what", [*(f"lx200:{name}" for name in MEADES), *(f"nexstar:{n}" for n in HAND_CONTROLS)])
def test_detect_finds_every_mount_at_9600_baud(what: str) -> None:
    finding, wire = seen(lambda: mount(what).feed)
    protocol, _, model = what.partition(":")
    assert finding.mount is not None, finding
    assert (finding.mount.protocol, finding.baud) == (protocol, 9600)
    assert finding.seconds < AT_9600
    assert finding.mount.latency == pytest.approx(0.1, abs=0.02)
    assert finding.mount.aligned
    if protocol == "lx200":
        assert finding.mount.model == model
        assert wire.sent()[:2] == HARMLESS
        assert all(data[:1] == b":" or data in (b"\x06", b"#\x06") for data in wire.sent()[2:])
    else:
        assert finding.mount.version == HAND_CONTROLS[model]
        assert wire.sent()[0] == b"Kx"
        assert b":" not in b"".join(wire.sent())


@pytest.mark.parametrize(("what", "rate"), [
    ("lx200:autostar", 19200), ("lx200:lx200", 1200), ("lx200:lx200gps", 57600), ("lx200:lx200-16", 28800),
    ("lx200:autostar", 115200), ("nexstar:4-5se/4.10", 19200),
])  # fmt: skip
def test_detect_finds_a_mount_at_another_baud_rate(what: str, rate: int) -> None:
    finding, wire = seen(lambda: mount(what).feed, rate)
    assert finding.mount is not None, finding
    assert finding.baud == rate
    assert finding.seconds < AT_9600 + ELSEWHERE
    assert all(data in HARMLESS for baud, data in wire.log if baud != rate)
    assert f" --baud {rate} " in start_command(finding)


def test_detect_tries_57600_baud_for_the_manuals_56700() -> None:
    finding, _ = seen(lambda: mount("lx200:autostar").feed, 56700)
    assert (finding.mount is not None, finding.baud) == (True, 57600)


MEADES_OWN = {"coordinates": ":GR# :GD#", "site": ":Gt# :Gg#", "clock": ":GG# :GC# :GL#"}


@each(("what", "equinox", "answers"), [
    ("nexstar:nexstar-gps/1.2", "j2000", {"coordinates": "E", "alignment and tracking": "J", "site": "", "clock": ""}),
    ("nexstar:cge/3.01", "j2000", {"coordinates": "e", "site": "w", "clock": "h"}),
    ("nexstar:6-8se/4.21", "jnow", {"coordinates": "e", "alignment and tracking": "J t", "site": "w", "clock": "h"}),
    ("nexstar:gt/101.0", "j2000", {"coordinates": "E", "site": "", "clock": ""}),
    ("nexstar:synscan/4.39.05", "j2000", {"coordinates": "e", "alignment and tracking": "J t", "site": "w"}),
    ("lx200:lx200", "jnow", {**MEADES_OWN, "alignment and tracking": "ACK"}),
    ("lx200:lx200gps", "jnow", {**MEADES_OWN, "alignment and tracking": ":GW#"}),
])  # fmt: skip
def test_detect_shows_what_the_mount_answered(what: str, equinox: str, answers: dict[str, str]) -> None:
    finding, _ = seen(lambda: mount(what).feed)
    assert finding.mount is not None
    assert finding.mount.equinox == equinox
    assert answers.items() <= finding.mount.answered_commands.items()
    assert "j2000" in describe_port(finding) or equinox == "jnow"
    assert ("(j2000), as its maker says" in describe_port(finding)) is ("synscan" in what)
    assert ('equinox = "auto"' in as_toml(finding)) is (equinox == "j2000" and "synscan" not in what)
    assert ("no reply: site, clock" in describe_port(finding)) is (answers.get("site") == "")


def test_detect_lists_only_values_that_the_mount_reported() -> None:
    """An LX200-type device whose model would have a site and a clock, but which only tells where it points."""

    def device() -> Device:
        sim = mount("lx200:lx200gps")
        return lambda data: b"" if data[:2] == b":G" and data[2:3] not in (b"R", b"D", b"V") else bytes(sim.feed(data))

    finding, _ = seen(device)
    assert finding.mount is not None
    assert {name for name, words in finding.mount.answered_commands.items() if words} == {
        "coordinates",
        "alignment and tracking",
    }
    assert "no reply: site, clock" in describe_port(finding)


def test_detect_finds_a_controller_that_reads_the_probe_k_as_a_command() -> None:
    """It reads from any letter to the next ``#``, and answers ACK only between two commands."""

    def device() -> Device:
        sim, command = mount("lx200:lx200gps"), bytearray()

        def feed(data: bytes) -> bytes:
            told = b""
            for byte in data:
                if byte == 6 and not command:
                    told += b"P"
                elif byte == ord("#"):
                    told += bytes(sim.feed(bytes(command) + b"#")) if command[:1] == b":" else b""
                    command.clear()
                else:
                    command.append(byte)
            return told

        return feed

    for place in (SerialPortInfo("-", "-"), parse_port("lx200@/dev/ttyUSB0")):
        finding, _ = seen(device, place=place)
        assert finding.mount is not None, finding


@each("model, rate, status", [("onstep", 9600, ":GU#"), ("teenastro", 57600, ":GW#")])
def test_detect_finds_onstep_and_teenastro_and_lists_their_answers(model: str, rate: int, status: str) -> None:
    """An OnStep refuses the K as a command (0) before it answers ACK."""
    finding, wire = seen(lambda: mount(f"lx200:{model}").feed, rate)
    assert finding.mount is not None and (finding.mount.model, finding.baud) == (model, rate)
    assert finding.mount.answered_commands["alignment and tracking"] == status
    assert not [data for data in wire.sent() if data[:3] in (b":U#", b":AP", b":hF", b":AA")]
    assert f"model {model}" in describe_port(finding)


def test_detect_waits_for_a_slow_hand_control() -> None:
    finding, wire = seen(lambda: mount("nexstar:gt/101.0").feed, latency=2.5)
    assert finding.mount is not None
    assert wire.sent()[:2] == HARMLESS


def test_detect_does_not_hibernate_a_hand_control_that_wakes_late() -> None:
    """What is said at 4800 and 2400 baud holds an ``x`` for a hand control, which is hibernation."""

    def device() -> Device:
        sim, now = mount("nexstar:6-8se/4.21"), asyncio.get_running_loop().time
        began = now()
        return lambda data: bytes(sim.feed(data)) if now() > began + 8.0 else b""

    finding, wire = seen(device)
    assert finding.mount is not None
    assert finding.baud == 9600
    assert not {4800, 2400} & {baud for baud, _ in wire.log}


async def test_detect_does_not_complete_an_unfinished_slew_command() -> None:
    """Six of the eight bytes of a slew at the highest rate: two more, and the mount would run away."""
    sim = mount("nexstar:6-8se/4.21")
    before = sim.true_position()
    sim.feed(b"P\x02\x10\x24\x09\x00")
    finding = await scan_port(SerialPortInfo("-", "-"), UartWire(sim.feed))
    assert finding.mount is not None
    await asyncio.sleep(5.0)
    assert sim.true_position() == pytest.approx(before, abs=0.01)


# --- everything else ----------------------------------------------------------------------------------------------


def test_detect_sends_a_silent_port_only_two_harmless_requests_per_baud_rate() -> None:
    finding, wire = seen(lambda: silent)
    assert finding.state == "silent"
    assert wire.sent() == [b"Kx", b"#\x06"] * 11
    assert [baud for baud, _ in wire.log[::2]] == [
        9600, 19200, 38400, 57600, 115200, 1200, 14400, 28800, 9600, 4800, 2400,
    ]  # fmt: skip
    assert finding.seconds < AT_9600 + ELSEWHERE
    assert "nothing here" in describe_port(finding)


def test_detect_tries_no_baud_rates_at_a_network_address() -> None:
    finding, wire = seen(lambda: silent, place=SerialPortInfo("socket://127.0.0.1:4030", "-"))
    assert (finding.state, finding.baud) == ("silent", None)
    assert wire.sent() == [b"Kx", b"#\x06"]
    assert finding.seconds < AT_9600


def test_detect_does_not_take_an_echo_for_a_mount() -> None:
    finding, wire = seen(lambda: lambda data: data)
    assert finding.state == "echo"
    assert wire.sent() == [b"Kx"]


@each(("answer", "state"), [
    (b"ERROR\r\n", "stranger"), (b"Ready#", "stranger"), (b"A1\r\n", "stranger"), (b"P1", "stranger"),
    (b"D", "downloader"),
])  # fmt: skip
def test_detect_sends_nothing_more_to_an_unknown_device_that_answers(answer: bytes, state: str) -> None:
    finding, wire = seen(lambda: lambda data: answer if data in (b"\x06", b"#\x06") else b"")
    assert finding.state == state
    assert wire.sent() == HARMLESS
    assert finding.mount is None


async def test_detect_does_not_take_the_first_letter_of_a_word_for_an_ack_reply() -> None:
    def prompt(data: bytes) -> bytes:
        if data != b"#\x06":
            return b""
        asyncio.get_running_loop().call_later(0.15, wire.say, b"assword:")
        return b"P"

    wire = UartWire(prompt)
    assert (await scan_port(SerialPortInfo("-", "-"), wire)).state == "stranger"
    assert wire.sent() == HARMLESS


def test_detect_tries_other_baud_rates_after_an_unintelligible_answer() -> None:
    finding, wire = seen(lambda: lambda data: b"\x15" if data in (b"\x06", b"#\x06") else b"")
    assert finding.state == "garbled"
    assert set(wire.sent()) == set(HARMLESS)
    assert {baud for baud, _ in wire.log} == {9600, *OTHER_BAUD_RATES}


def test_detect_sends_nothing_to_a_gps_receiver() -> None:
    finding, wire = seen(lambda: silent, talk=GPS)
    assert (finding.state, finding.baud) == ("gps", 9600)
    assert wire.log == []
    assert "a GPS receiver, not a mount" in describe_port(finding)


def test_detect_sends_nothing_to_a_gps_receiver_at_another_baud_rate() -> None:
    finding, wire = seen(lambda: silent, 4800, talk=GPS)
    assert (finding.state, finding.baud) == ("gps", 4800)
    assert wire.log == []


def test_detect_sends_nothing_to_an_unintelligible_talker() -> None:
    finding, wire = seen(lambda: silent, talk=b"\xa5\x5a\x00frame\xff")
    assert finding.state == "talker"
    assert wire.log == []
    assert finding.seconds < AT_9600 + ELSEWHERE


def test_detect_recognises_a_gps_sentence_by_its_checksum() -> None:
    assert has_nmea_sentence(b"junk" + GPS + b"$GPG")
    assert not has_nmea_sentence(GPS.replace(b"A*", b"V*"))
    assert not has_nmea_sentence(b"$GPRMC,220000.00")


async def test_detect_ignores_a_stray_byte_when_the_port_opens() -> None:
    wire = UartWire(mount("nexstar:cpc").feed)
    asyncio.get_running_loop().call_later(0.01, wire.say, b"\x00")
    assert (await scan_port(SerialPortInfo("-", "-"), wire)).mount is not None


# --- with the protocol named --------------------------------------------------------------------------------------


def test_detect_finds_a_declared_classic_lx200_that_does_not_answer_ack() -> None:
    def device() -> Device:
        sim = mount("lx200:lx200")
        return lambda data: b"" if data in (b"\x06", b"#\x06") else bytes(sim.feed(data))

    assert seen(device)[0].state == "silent"
    finding, wire = seen(device, place=parse_port("lx200:lx200@/dev/ttyUSB0"))
    assert finding.mount is not None
    assert wire.sent()[:3] == [b"Kx", b"#\x06", b"#:GR#"]
    assert start_command(finding) == (
        "mount-gateway run --mount lx200:lx200@/dev/ttyUSB0 --surface nexstar@tcp://127.0.0.1:4030"
    )


def test_detect_sends_only_nexstar_requests_to_a_port_declared_nexstar() -> None:
    finding, wire = seen(lambda: silent, place=parse_port("nexstar@socket://127.0.0.1:1"))
    assert finding.state == "silent"
    assert wire.sent() == [b"Kx"]


def test_detect_sends_no_lx200_command_to_a_nexstar_wrongly_declared_as_lx200() -> None:
    finding, wire = seen(lambda: mount("nexstar:cpc").feed, place=parse_port("lx200:autostar@/dev/ttyUSB0"))
    assert finding.mount is not None
    assert b":" not in b"".join(wire.sent())
    assert (
        start_command(finding) == "mount-gateway run --mount nexstar@/dev/ttyUSB0 --surface lx200@tcp://127.0.0.1:4030"
    )


# --- trouble ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("device", "when"), [
    ("silent", 0.5), ("silent", 1.3), ("silent", 3.0), ("silent", 6.0), ("says who it is", 1.3),
])  # fmt: skip
async def test_detect_reports_a_port_that_vanished(device: str, when: float) -> None:
    wire = UartWire(silent if device == "silent" else mount("nexstar:cpc").feed)

    def vanish() -> None:
        assert wire.on_lost is not None
        wire.on_lost("unplugged")

    asyncio.get_running_loop().call_later(when, vanish)
    assert (await scan_port(SerialPortInfo("-", "-"), wire)).state == "vanished"


def test_detect_reports_a_mount_that_answers_only_once() -> None:
    finding, _ = seen(lambda: lambda data: data[1:2] + b"#" if data == b"Kx" else b"")
    assert finding.state == "mute"
    assert "did not say who it is" in describe_port(finding)


def test_detect_continues_with_other_ports_after_a_driver_defect(monkeypatch: pytest.MonkeyPatch) -> None:
    async def broken(*_: object) -> None:
        raise KeyError("defect")

    monkeypatch.setattr("gateway.diagnostics.detect.scan_port.identify", broken)
    finding, _ = seen(lambda: mount("nexstar:cpc").feed)
    assert finding.state == "mute"
    assert "please report it: KeyError('defect')" in describe_port(finding)


async def test_detect_skips_a_baud_rate_that_the_port_lacks() -> None:
    class Poor(UartWire):
        def set_baud(self, baud: int) -> None:
            if baud in (14400, 28800):
                raise OSError(22, "no such rate")
            super().set_baud(baud)

    finding = await scan_port(SerialPortInfo("-", "-"), Poor(silent))
    assert (finding.state, finding.rates_tried) == ("silent", len(OTHER_BAUD_RATES) - 2)
