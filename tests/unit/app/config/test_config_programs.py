"""Programs get what they need: by the name in ``client``, or by the first bytes of their own connection."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from gateway.app.bindings import make_surface, profiles_of
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.app.config.describing import find_key
from gateway.app.config.programs import first_bytes, programs, unmet_needs, with_needs
from gateway.clients.profiles import EquinoxConverter
from gateway.core.wire_log import Entry
from gateway.mount.policy import Limits
from tests.support.each import each
from tests.support.fake_gateway import FakeGateway
from tests.support.fake_mount import Mount, Talk
from tests.support.transcript_files import files, read

TCP = "lx200@tcp://127.0.0.1:0"
GENUINE = b" M31 EX GAL MAG 3.5 SZ178.0'#"
CLEAN = b"1M31 EX GAL MAG 3.5 SZ178.0'#"
MOBILE = (b"Ka", b"##", b"#\x06")
DESKTOP = (b"#:GR#", b"#:GD#")


def gateway(**keys: str) -> tuple[FakeGateway, list[Entry]]:
    """A port as ``Gateway`` puts it together, and what is noted down."""
    surface = SurfaceConfig(at=TCP, **keys)  # type: ignore[arg-type]
    built = FakeGateway(Mount())
    j2000 = EquinoxConverter(built.mount.sky, built.controller.clock)
    face = replace(built.acceptor.binding, profiles=tuple(profiles_of("lx200", surface, j2000)))
    built.acceptor.binding = face
    entries: list[Entry] = []
    built.controller.wire_log.sinks.append(entries.append)
    return built, entries


@each(
    ("at", "client", "key", "value"),
    [
        (TCP, "stellarium-mobile", "equinox", "j2000"),
        (TCP, "stellarium", "sync_text", CLEAN[:-1].decode()),
        (TCP, "stellarium", "equinox", None),
        (TCP, "starry-night", "precision", "low"),
        (TCP, "skysafari", "equinox", "jnow"),
        (TCP, "cartes-du-ciel", "precision", None),
        ("nexstar@tcp://:0", "ascom", "equinox", None),
        ("nexstar:cge/4.13@tcp://:0", "ascom", "equinox", "j2000"),
        ("nexstar:cge/4.14@tcp://:0", "ascom", "equinox", None),
        ("nexstar:gt/101.0@tcp://:0", "ascom", "equinox", "j2000"),
        ("nexstar:cge/4.17@tcp://:0", "skysafari", "equinox", "j2000"),
        ("nexstar:avx/starsense-1.19@tcp://:0", "skysafari", "equinox", None),
        ("nexstar@tcp://:0", "starry-night", "precision", None),
        (TCP, "auto", "equinox", None),
        (TCP, "any", "equinox", None),
    ],
)
def test_named_client_program_gets_the_settings_that_it_needs(
    at: str, client: str, key: str, value: str | None
) -> None:
    assert getattr(with_needs(SurfaceConfig(at=at, client=client)), key) == value


def test_client_profile_does_not_override_an_explicit_setting() -> None:
    surface = SurfaceConfig(at=TCP, client="stellarium-mobile", equinox="jnow")
    assert with_needs(surface).equinox == "jnow"
    assert unmet_needs(surface) == []


@pytest.mark.parametrize("protocol", ["lx200", "nexstar"])
def test_every_client_profile_sets_only_valid_keys_and_gives_reasons(protocol: str) -> None:
    """Its key is one of the surface's, its value is allowed there, and it says why."""
    for name, row in programs(protocol).items():
        assert bool(row.first) == bool(row.evidence), name
        for need in row.needs:
            key = find_key("surface", need.key)
            assert key is not None, name
            assert not key.choices or need.value in key.choices, name
            assert need.why, name


def test_stellarium_profile_sets_the_sync_text_of_its_recording() -> None:
    """The whole file, with the profile in the place of its own ``sync_text``."""
    [path] = files("lx200-stellarium.txt")
    conversation = read(path)
    given = with_needs(SurfaceConfig(at=TCP, client="stellarium"))
    assert given.sync_text == conversation.settings["sync_text"]


def test_starry_night_profile_starts_in_low_precision() -> None:
    given = with_needs(SurfaceConfig(at=TCP, client="starry-night"))
    assert Talk(precision=given.precision).send(b":GR#") == b"12:34.9#"


async def test_only_stellarium_mobile_gets_j2000_coordinates() -> None:
    built, entries = gateway()
    mobile, other = built.connect(), built.connect()
    assert [await mobile.ask(data) for data in MOBILE] == [b"", b"", b"P"]
    of_date, j2000 = await other.ask(b":GR#"), await mobile.ask(b"#:GR#")
    assert of_date == b"12:34:56#"
    assert j2000 == b"12:33:40#"  # 26.2 years of 3.07 + 1.34 sin(ra) tan(dec) = 2.87 s back
    assert [entry.note for entry in entries if "applying its profile" in entry.note] == [
        "recognised client Stellarium Mobile PLUS: applying its profile"
    ]
    assert await mobile.ask(b"#:Sr05:34:32#") == b"1"
    assert await mobile.ask(b"#:Sd+22:00:52#") == b"1"
    assert await mobile.ask(b"#:MS#") == b"0"
    target = built.mount.asked[-1]
    sky = built.mount.sky.from_j2000(15 * (5 + 34 / 60 + 32 / 3600), 22 + 52 / 3600, built.controller.clock())
    assert (target.ra, target.dec) == pytest.approx(sky, abs=1e-6)  # type: ignore[attr-defined]


async def test_clients_that_end_arrows_by_stopping_all_motion_are_known() -> None:
    built, _ = gateway()
    mobile, other = built.connect(), built.connect()
    for data in MOBILE:
        await mobile.ask(data)
    await other.ask(b":GR#")
    by_stop = [one.guest.client.arrow_releases.sends_stop_all for one in (mobile, other)]
    assert by_stop == [True, False]
    for client, stops in (("skysafari", True), ("indi", False)):
        assert (
            make_surface(Endpoint("lx200", "-"), SurfaceConfig(at=TCP, client=client), Limits()).releases_by_stop
            is stops
        )


async def test_stellarium_mobile_is_recognised_byte_by_byte() -> None:
    built, _ = gateway()
    connection = built.connect()
    assert await connection.dribble(b"".join(MOBILE), 0.01) == b"P"
    assert await connection.ask(b"#:GR#") != b"12:34:56#"


async def test_recognised_stellarium_gets_a_sync_reply_that_it_can_read() -> None:
    built, _ = gateway()
    stellarium, other = built.connect(), built.connect()
    for data in DESKTOP:
        assert await stellarium.ask(data)
    for connection, text in ((stellarium, CLEAN), (other, GENUINE)):
        for data in (b":Sr12:34:00#", b":Sd+45*12:00#"):
            assert await connection.ask(data) == b"1"
        assert await connection.ask(b":CM#") == text


async def test_explicit_setting_overrides_the_recognised_client_profile() -> None:
    for keys in ({"equinox": "jnow"}, {"client": "any"}, {"client": "skysafari"}):
        built, _ = gateway(**keys)
        connection = built.connect()
        for data in MOBILE:
            await connection.ask(data)
        assert await connection.ask(b"#:GR#") == b"12:34:56#", keys


@each("path", files("lx200-*.txt"))
async def test_recognition_of_a_client_program_picks_the_right_one(path: Path) -> None:
    """Every conversation that is known, from its first byte on."""
    built, entries = gateway()
    connection = built.connect()
    for line in read(path).lines:
        if line.mark == ">":
            await connection.ask(line.data)
    notes = [entry.note for entry in entries if "applying its profile" in entry.note]
    expected = {"lx200-stellarium": 1, "lx200-stellarium-mobile": 1, "lx200-indi-autostar": 1}
    assert len(notes) == expected.get(path.stem, 0)


def test_programs_are_recognised_only_on_lx200_network_surfaces() -> None:
    assert set(first_bytes(SurfaceConfig(at=TCP))) == {b"Ka###\x06", b"#:GR##:GD#", b"\x06:GR#\x06:Gc#"}
    for at in ("lx200@pty:/tmp/x", "lx200@/dev/ttyS1", "nexstar@tcp://:0"):
        assert first_bytes(SurfaceConfig(at=at)) == {}


async def test_unknown_command_without_a_reply_is_logged_once_per_host() -> None:
    built, entries = gateway()
    for host in ("192.168.4.2", "192.168.4.2", "192.168.4.3"):
        connection = built.connect(host)
        for data in (b":XY12#", b":XY12#", b":Q#", b":GR#"):
            await connection.ask(data)
    notes = [entry for entry in entries if entry.arrow == "!"]
    assert len(notes) == 2 and all(":XY12#" in entry.note for entry in notes)
