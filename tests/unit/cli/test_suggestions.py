"""What a person types that is none of the commands, flags and mounts: it is said what was meant, and done where that is
beyond doubt."""

from __future__ import annotations

import asyncio
import errno
import os
import sys
from pathlib import Path

import pytest

from gateway.app.config import endpoints, parse_device, parse_endpoint, parse_site
from gateway.app.config.endpoints import suggest_address
from gateway.app.control.stop_command import StopReport
from gateway.cli import main
from gateway.core.errors import UserError
from gateway.diagnostics.detect.ports import parse_port
from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.process import Running
from tests.unit.cli.test_command_line import refused

FILE = '[mount]\nat = "nexstar:cpc@sim"\n[[surface]]\nat = "lx200@tcp://127.0.0.1:0"\n'
PLAIN = ("--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder that one is in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("typed", "page"),
    [
        (["help"], "usage: mount-gateway COMMAND"),
        (["help", "all"], "usage: mount-gateway COMMAND"),
        (["help", "goto"], "usage: mount-gateway goto "),
        (["version"], "mount-gateway "),
        (["-V"], "mount-gateway "),
    ],
)
def test_help_and_version_are_shown_for_other_usual_spellings(
    typed: list[str], page: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(typed)
    assert end.value.code == 0
    assert capsys.readouterr().out.startswith(page)


@pytest.mark.parametrize(("where", "says"), [("", "this is a folder, not a serial port"), ("x", "this is not a ser")])
def test_detect_says_that_a_folder_is_no_serial_port(
    where: str, says: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "x").touch()
    assert main(["detect", str(here / where)]) == 1
    assert f"  cannot be opened: {says}" in capsys.readouterr().out


def test_run_reads_the_config_file_of_the_current_folder(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "gateway.toml").write_text(FILE)
    assert main(["config"]) == 0
    told = capsys.readouterr()
    assert 'at = "nexstar:cpc@sim"  # gateway.toml:2' in told.out
    assert "using gateway.toml from this folder" in told.err
    assert main(["config", "--lowest", "7"]) == 0
    assert "lowest = 7.0  # --lowest" in capsys.readouterr().out
    assert main(["config", "--mount", "nexstar@sim"]) == 2
    assert "(gateway.toml of this folder is not" in capsys.readouterr().err


def test_mount_flags_leave_the_config_file_of_the_folder_unread(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "gateway.toml").write_text("not even TOML")
    assert main(["config", *PLAIN]) == 0
    assert capsys.readouterr().err == ""
    assert "gateway.toml:1" in refused("config")  # a mistake in it stands alone on stderr


def test_surface_settings_can_be_given_as_flags(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--client", "stellarium", "--allow", "10.0.0.0/8,127.0.0.1", "--max-clients", "3", "--precision=low"]
    assert main(["config", *PLAIN, *words, "--read-only"]) == 0
    told = capsys.readouterr().out
    for line in (
        'client = "stellarium"  # --client',
        'allow = ["10.0.0.0/8", "127.0.0.1"]  # --allow',
        "max-clients = 3  # --max-clients",
        'precision = "low"  # --precision',
        "read-only = true  # --read-only",
    ):
        assert f"{line}\n" in told
    assert main(["config", *PLAIN, "--read-only=10.0.0.0/8"]) == 0
    assert 'read-only = ["10.0.0.0/8"]  # --read-only\n' in capsys.readouterr().out


def test_names_flag_applies_only_to_the_http_surface(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["config", *PLAIN, "--surface", "any@tcp://:0", "--names", "pier,[2001:db8::7]"]) == 0
    first, second = capsys.readouterr().out.split("[[surface]]")[1:]
    assert "names = []\n" in first and 'names = ["pier", "[2001:db8::7]"]  # --names\n' in second


def test_allow_flag_applies_only_to_the_network_surface(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["config", "--surface", "lx200@pty:/tmp/x", *PLAIN, "--allow", "127.0.0.1"]) == 0
    first, second = capsys.readouterr().out.split("[[surface]]")[1:]
    assert "# allow: not set" in first and 'allow = ["127.0.0.1"]  # --allow\n' in second


def test_flag_overrides_the_only_surface_of_a_config_file(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "gateway.toml").write_text(FILE)
    assert main(["config", "--client", "stellarium"]) == 0
    told = capsys.readouterr().out
    assert 'client = "stellarium"  # --client\n' in told
    assert 'at = "lx200@tcp://127.0.0.1:0"  # gateway.toml:4\n' in told


# --- mounts by the words on them -----------------------------------------------------------------------------------


@each(
    ("word", "device"),
    [
        ("6se", "nexstar:6-8se"),
        ("8se", "nexstar:6-8se"),
        ("5se", "nexstar:4-5se"),
        ("cpc800", "nexstar:cpc"),
        ("CPC 1100", "nexstar:cpc"),
        ("lx90", "lx200:autostar"),
        ("etx", "lx200:autostar"),
        ("etx90", "lx200:autostar"),
        ("ETX-125", "lx200:autostar"),
        ("avx", "nexstar:avx"),
        ("celestron", "nexstar"),
        ("Meade", "lx200"),
        ("Celestron NexStar 8 SE", "nexstar:6-8se"),
        ("celestron:6se/4.10", "nexstar:6-8se/4.10"),
        ("nexstar:6se", "nexstar:6-8se"),
        ("lx200:etx", "lx200:autostar"),
        ("Meade LX200-ACF", "lx200:lx200gps"),
        ("NexStar", "nexstar"),
        ("lx200", "lx200"),
        ("nexstar:cge/3.02", "nexstar:cge/3.02"),
        ("starsense/1.19", "nexstar:starsense/1.19"),
        ("NexStar 8SE", "nexstar:6-8se"),
        ("CPC/4.10", "nexstar:cpc/4.10"),
        ("Celestron AVX", "nexstar:avx"),
        ("LX200 Classic", "lx200:lx200"),
        ("nexstar-gps", "nexstar:nexstar-gps"),
        ("evo", "nexstar:evolution"),
        ("lx200gps", "lx200:lx200gps"),
    ],
)
def test_mount_may_be_given_by_its_popular_name(word: str, device: str) -> None:
    assert str(parse_device(word)) == f"{device}@"
    assert parse_endpoint(f"{word}@sim") == parse_endpoint(f"{device}@sim")


@each(
    ("word", "says"),
    [
        ("celestrn", "did you mean 'celestron'?"),
        ("cpc1200", "did you mean 'cpc1100'?"),
        ("nexstr", "'nexstar'?"),
        ("cgx9", "did you mean 'cgx'?"),
        ("nexstar:lx90", "write lx200"),
        ("telescope", "write nexstar for a Celestron"),
    ],
)
def test_unknown_word_is_refused_with_a_suggestion(word: str, says: str) -> None:
    with pytest.raises(UserError) as refusal:
        parse_device(word)
    assert says in str(refusal.value)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_every_popular_name_stands_for_one_existing_mount(protocol: str) -> None:
    names = {*load(protocol).models, endpoints.ANY_MODEL, *(["starsense"] if protocol == "nexstar" else [])}
    rows = endpoints.names_by_model(protocol)
    assert set(rows) <= names
    words = [word for side in PROTOCOLS for row in endpoints.names_by_model(side).values() for word in row]
    assert len(words) == len(set(words))
    for model, row in rows.items():
        for word in row:
            assert parse_device(word).protocol == protocol and (
                model == endpoints.ANY_MODEL or parse_device(word).where == ""
            )


@pytest.mark.parametrize(
    "subcommand", [("config", "--surface", "lx200@tcp://:0", "--mount", "6se@sim"), ("explain", "etx", "6se", ":GR#")]
)
def test_popular_names_are_accepted_in_every_subcommand(
    subcommand: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(list(subcommand)) == 0
    assert capsys.readouterr().out


@pytest.mark.parametrize(
    ("half", "says"),
    [
        ("/dev/ttyACM0", "nexstar@/dev/ttyACM0 (Celestron) or lx200@/dev/ttyACM0 (Meade)"),
        ("6se", "6se@/dev/ttyUSB0"),
        ("nexstar@", "nexstar@/dev/ttyUSB0"),
    ],
)
def test_incomplete_mount_address_is_refused_with_an_example(half: str, says: str) -> None:
    with pytest.raises(UserError) as refusal:
        parse_endpoint(half)
    assert str(refusal.value).endswith(f"for example {says}")


# --- ports for detect ------------------------------------------------------------------------------------------------


def test_detect_names_a_port_as_run_expects_it() -> None:
    named_as = {
        text: parse_port(text).url for text in ("null", "COM3", "/dev/ttyS0", "socket://1.2.3.4:5", "tcp://pi:4030")
    }
    assert named_as == {
        "null": "/dev/null", "COM3": "COM3", "/dev/ttyS0": "/dev/ttyS0", "socket://1.2.3.4:5": "socket://1.2.3.4:5",
        "tcp://pi:4030": "socket://pi:4030",
    }  # fmt: skip


def test_network_address_without_a_scheme_is_taken_for_a_socket() -> None:
    assert parse_port("192.168.1.50:4030").url == "socket://192.168.1.50:4030"
    assert parse_port("meade@pi.local:4030").typed_endpoint == parse_endpoint("lx200@socket://pi.local:4030")
    assert parse_port("8se@/dev/ttyUSB0").typed_endpoint == parse_endpoint("nexstar:6-8se@/dev/ttyUSB0")


# --- places as people write them -------------------------------------------------------------------------------------


def test_serial_device_typed_without_its_folder_gets_a_suggestion(tmp_path: Path) -> None:
    (tmp_path / "ttyUSB7").touch()
    assert suggest_address("ttyUSB7", False, tmp_path) == str(tmp_path / "ttyUSB7")
    for where, listening in [
        ("COM3", False),
        ("/dev/ttyS0", False),
        ("sim", False),
        ("pty:/tmp/x", True),
        ("tcp://:4030", True),
        ("socket://a:1", False),
        ("rfc2217://a:1", True),
        ("hwgrep://x", False),
    ]:
        assert suggest_address(where, listening, tmp_path) == "", where
    assert suggest_address("rfc2217:a:1", False, tmp_path) == "rfc2217://a:1"


def test_privileged_port_is_refused_with_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    async def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "error while attempting to bind on address ('127.0.0.1', 80)")

    monkeypatch.setattr(asyncio.base_events.BaseEventLoop, "create_server", refuse)
    monkeypatch.setitem(sys.modules, "uvloop", None)
    assert "take a higher one" in refused("run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:80")


@pytest.mark.parametrize("quotes", ["“”", "„“", "‘’", "«»"])
def test_typographic_quotes_in_config_are_named(quotes: str, here: Path) -> None:
    (here / "gateway.toml").write_text(f"[mount]\nat = {quotes[0]}nexstar@sim{quotes[1]}\n", "utf-8")
    assert "gateway.toml:2: column 6: " in (line := refused("run"))
    assert "write plain ones" in line


# --- sites ------------------------------------------------------------------------------------------------------------


@each(
    ("text", "place"),
    [
        ("48.1,11.6", (48.1, 11.6)),
        ("-33.9,151.2", (-33.9, 151.2)),
        ("48°08'N,11°36'E", (48.1333333, 11.6)),
        ("45.5N, 122.7W", (45.5, -122.7)),
        ("33 51 31 S,151d12m32sE", (-33.8586111, 151.2088889)),
        ("11°36'E,48°08'N", (48.1333333, 11.6)),
        ("48:08:00,-11:36:00", (48.1333333, -11.6)),
        ("45.5,240.5", (45.5, 240.5)),
    ],
)
def test_site_is_accepted_in_usual_map_notations(text: str, place: tuple[float, float]) -> None:
    assert parse_site(text) == pytest.approx(place, abs=1e-6)


@each(
    "text",
    [
        "north",
        "48.1",
        "48.1,11.6,5",
        "48h,11h",
        "48°08'N,x",
        "95°N,11°E",
        "48°08'W,11°36'W",
        "33.5s,70.5w",
        "33 51 31 s,11",  # seconds, or south?
        "33.5s,70.5",
        "48°75'N,11°36'E",
        "-33°51'S,151°12'E",  # either of them could be meant
    ],
)
def test_text_that_is_no_site_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="write LAT,LON"):
        parse_site(text)


def test_stop_accepts_a_mounts_popular_name(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[object] = []

    async def order_all(scope: object, mount: str | None, word: str) -> StopReport:
        asked.append(mount)
        return StopReport([], [])

    monkeypatch.setattr("gateway.app.control.stop_command.request_all", order_all)
    for name in ("6se@/dev/ttyUSB0", "/dev/ttyUSB0", "x@y"):
        assert main(["stop", "--state", str(tmp_path), "--mount", name]) == 0
    assert asked == ["nexstar:6-8se@/dev/ttyUSB0", "/dev/ttyUSB0", "x@y"]


@pytest.mark.skipif(os.name != "posix", reason="there are no pseudo-terminals")
def test_second_gateway_on_a_mount_port_names_the_first_ones_process(tmp_path: Path, started: list[Running]) -> None:
    mount = Running("sim", "nexstar:cpc", "--at", f"pty:{tmp_path / 'mount'}")
    started.append(mount)
    mount.ready()
    words = ("--mount", f"6se@{tmp_path / 'mount'}", "--surface", "lx200@tcp://127.0.0.1:0", "--state", str(tmp_path))
    first = Running("run", *words)
    started.append(first)
    first.ready()
    second = Running("run", *words)
    started.append(second)
    assert second.end(0) == 2
    assert (
        f"another mount-gateway (process {first.process.pid}) already drives this mount: connect programs to"
        in second.said
    )
    assert "saves its state" not in second.said, "only the true reason"
