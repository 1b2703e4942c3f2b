"""A bundle tells neither where its mount stands nor whose it is, and replays as a recorded mount."""

from __future__ import annotations

import asyncio
import functools
import json
import tempfile
from datetime import datetime
from pathlib import Path
from random import Random
from typing import Any, NamedTuple
from unittest.mock import patch

import pytest

from gateway.app.recording.format import read
from gateway.app.state.file import SavedState
from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import separation, wrap180
from gateway.core.errors import UserError
from gateway.diagnostics.prove import bundle, small_motions
from gateway.diagnostics.prove.elsewhere import elsewhere, site_of
from gateway.diagnostics.prove.findings import Findings
from gateway.mount.site.program_settings import SiteOfProgram
from gateway.transport.handler import Connected
from tests.support.proven import EVENING, Onlooker, Proven, run_calm
from tests.support.recovered import recovered
from tests.support.sampling import as_a_rule

SITE = (47.3, 11.6)
#: Names that are planted wherever a person can write one.
PLANTED = ("obs-pier", "meier", "10.11.12.13", "usb-Prolific", "serial-77341", "hilltop", "192.168.1.77", "secret")
MOUNTS = as_a_rule(
    ["nexstar:6-8se", "alpaca:german"],
    whole=[
        "nexstar:6-8se",
        "lx200:lx200",
        "lx200:onstep",
        "lx200:teenastro",
        "nexstar:cgem",
        "alpaca:german",
        "alpaca:altaz",
    ],
)


class Made(NamedTuple):
    findings: Findings
    original: bytes
    files: dict[str, bytes]


def plant(proven: Proven) -> None:
    """Let a server tell names, and a Meade that of its site."""
    if hasattr(proven.sim, "names"):
        proven.sim.names[0] = "hilltop"
    if hasattr(proven.sim, "tells"):
        names = {"name": "meier's mount", "description": "on obs-pier", "driverversion": "1 serial-77341"}
        proven.sim.tells |= names | {"driverinfo": "secret", "siteelevation": 1234.5}


async def another_program(proven: Proven) -> None:
    """Let a program ask for the name of the mount's site, and say one of its own."""
    acceptors = zip(proven.gateway.endpoints, proven.gateway.acceptors, strict=True)
    [acceptor] = [acceptor for endpoint, acceptor in acceptors if endpoint.protocol == "lx200"]
    heard = list[bytes]()
    handler = proven.gateway.entrance.accept(acceptor)(Connected("192.168.1.77:4711", "192.168.1.77", heard.append))
    handler.feed(b":GM#:Xsecret#")
    await asyncio.sleep(5.0)
    assert heard
    handler.close()


@functools.cache
def made(mount: str, latitude: float = SITE[0], seed: int = 1) -> Made:
    """A check of a simulated mount with names planted in it, and its bundle."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "secret-meier.rec"

        async def check() -> Findings:
            config = {"name": "obs-pier", "site": (latitude, SITE[1]), "state": "/home/meier/secret"}
            where = (latitude, SITE[1])
            async with Proven(mount, record=path, site=where, config=config, every=9.0, change=plant) as proven:
                proven.gateway.wire_log.note("mount", "usb-Prolific_secret was lost at 10.11.12.13")
                with patch.object(small_motions, "KEYS", (9, 5)):
                    found = await proven.check(Onlooker("ss"))
                await another_program(proven)
                return found

        findings: Findings = run_calm(check())
        original = path.read_bytes()
        return Made(findings, original, bundle.make(findings, [path], random=Random(seed)))


def _recording(made: Made, folder: Path, original: bool = False) -> Path:
    (path := folder / "1.rec").write_bytes(made.original if original else made.files["1.rec"])
    return path


@pytest.mark.parametrize("mount", MOUNTS)
def test_nobody_recovers_the_site_from_a_bundle(mount: str, tmp_path: Path) -> None:
    one = made(mount)
    true = recovered(_recording(one, tmp_path, original=True))
    assert min(separation(lon, lat, SITE[1], SITE[0]) for lat, lon in true) < 0.1  # the reader is no fool
    guessed = recovered(_recording(one, tmp_path))
    assert guessed
    assert min(separation(lon, lat, SITE[1], SITE[0]) for lat, lon in guessed) >= 2.0
    told, zone = site_of(read(_recording(one, tmp_path)))
    assert told is not None and told[0] == 45.0
    before = site_of(read(_recording(one, tmp_path, original=True)))[1]
    assert zone == before or abs((zone - before) - wrap180(told[1] - SITE[1]) / 15.0) < 0.5  # a server has no zone


@pytest.mark.parametrize("mount", MOUNTS)
def test_no_reply_tells_the_true_latitude_or_time(mount: str, tmp_path: Path) -> None:
    one = made(mount)
    latitude, minutes = f"{int(SITE[0]):02d}", f"{round(SITE[0] % 1 * 60):02d}"
    text = one.files["1.rec"].decode("latin-1")
    assert f"+{latitude}\\xdf{minutes}" not in text and f"+{latitude}*{minutes}" not in text
    before = read(_recording(one, tmp_path, original=True)).settings["began"]
    after = read(_recording(one, tmp_path)).settings["began"]
    assert abs(after - before) > 3500.0
    # the sky over the mount is the same
    told, _ = site_of(read(_recording(one, tmp_path)))
    assert told is not None
    assert abs(wrap180(sidereal_time(after, told[1]) - sidereal_time(before, SITE[1]))) < 0.02


@pytest.mark.parametrize("mount", sorted({*MOUNTS, "lx200:lx200"}))
def test_planted_names_are_gone(mount: str) -> None:
    one = made(mount)
    assert all(name.encode() in one.original for name in (*PLANTED[:4], "192.168.1.77", "secret"))
    assert (b"hilltop" in one.original) == (mount == "lx200:lx200")
    for name, data in one.files.items():
        assert not [word for word in PLANTED if word.lower() in data.decode("latin-1").lower()], name
    verdicts = json.loads(one.files[bundle.VERDICTS])
    assert all(not finding["measured"] for finding in verdicts["findings"]["stages"].get("sky", []))


@pytest.mark.parametrize("mount", MOUNTS)
def test_a_bundle_replays_as_a_recorded_mount(mount: str, tmp_path: Path) -> None:
    one = made(mount)
    bundle.save(tmp_path / bundle.name_of(one.findings), one.files)
    loaded = bundle.load(tmp_path / bundle.name_of(one.findings), tmp_path)
    assert loaded.played["1.rec"] == bundle.played(tmp_path / "1.rec")
    assert loaded.played["1.rec"].requests > 300
    assert (loaded.played["1.rec"].differences, loaded.played["1.rec"].strayed) == (0, 0)


def test_no_shift_is_small_and_none_is_of_whole_hours() -> None:
    for seed in range(200):
        there = elsewhere((-33.9, 151.2), 10.0, EVENING, Random(seed))
        assert there.zone != 0 and there.latitude == -35.0 and -180.0 <= there.longitude < 180.0
        assert -12 <= 10.0 + there.zone <= 12
        away = separation(there.longitude, there.latitude, 151.2, -33.9)
        assert away > 6.0
    shifts = {elsewhere((50.0, 10.0), 1.0, EVENING, Random(seed)).east % 1.0 for seed in range(200)}
    assert len(shifts) > 150  # whoever learns when it was does not learn where


def test_a_site_that_a_program_has_set_in_an_earlier_run_is_hidden_too(tmp_path: Path) -> None:
    """An old hand control tells none; without the site its altitudes could not be hidden."""

    async def check() -> Findings:
        path = tmp_path / "original.rec"
        kept = SavedState(1, site_of_program=SiteOfProgram(*SITE))
        async with Proven("nexstar:i-series/2.2", record=path, site=SITE, every=9.0, kept=kept) as proven:
            return await proven.check(Onlooker("sssysss"))

    findings: Findings = run_calm(check())
    files = bundle.make(findings, [tmp_path / "original.rec"], random=Random(1))
    (tmp_path / "1.rec").write_bytes(files["1.rec"])
    assert b"47.3" not in files["1.rec"]
    assert site_of(read(tmp_path / "1.rec"))[0] == (45.0, pytest.approx(SITE[1], abs=180.0))
    assert bundle.played(tmp_path / "1.rec").strayed == 0


def test_what_cannot_be_hidden_makes_no_bundle(tmp_path: Path) -> None:
    one = made(MOUNTS[0])
    path = _recording(one, tmp_path, original=True)
    lines = one.original.split(b"\n")
    lines.insert(40, b'0.000040 mount c {"type":"site","latitude":47.3,"longitude":11.6,"number":"1","who":""}')
    path.write_bytes(b"\n".join(lines))
    with pytest.raises(Exception, match="somebody has set the mount's site"):
        bundle.make(one.findings, [path], random=Random(1))


def test_the_name_of_a_bundle_is_a_file_name() -> None:
    assert bundle.name_of(Findings("x", "6-8se", "4.21")) == "prove-6-8se-4.21.zip"
    assert bundle.name_of(Findings("x", "a/../b", "?")) == "prove-a_.._b-_.zip"


def test_an_earlier_bundle_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for expected in ("prove-onstep-10.28g.zip", "prove-onstep-10.28g-2.zip", "prove-onstep-10.28g-3.zip"):
        path = bundle.unused("prove-onstep-10.28g.zip")
        assert str(path) == expected
        path.touch()


#: By protocol: how requests begin whose replies tell the site, the time or where it points, typed from the manuals; of
#: a Celestron its axes (z, Z) tell nothing if it is equatorial.
PRIVATE = {
    "lx200": (b":Gt", b":Gg", b":GL", b":Ga", b":GG", b":GXT2", b":GA", b":GZ"),
    "nexstar": (b"w", b"h", b"i"),
    "alpaca": (b"get sitel", b"get utcdate", b"get altitude", b"get devicestate"),
}


def _lost(mount: str, path: Path, nth: int, config: dict[str, Any] | None = None, **more: Any) -> Findings:
    """Check a mount that does not get the nth request, without any stage but what every check asks."""

    def lose(proven: Proven) -> None:
        write, count = proven.wire.write, iter(range(1, 10**6))
        proven.wire.write = lambda data: None if next(count) == nth else write(data)  # type: ignore[method-assign]

    async def check() -> Findings:
        settings = {"site": SITE, "every": 9.0, "change": lose} | more
        async with Proven(mount, record=path, config=config, **settings) as proven:
            return await proven.check(Onlooker("ssssssss"))

    findings: Findings = run_calm(check())
    return findings


def _told(path: Path, private: tuple[bytes, ...]) -> list[tuple[float, bytes, bytes]]:
    """Return the replies to these requests, with their times and requests: each to the last request before it."""
    asked, found = b"", list[tuple[float, bytes, bytes]]()
    for event in read(path):
        if event.side == "mount" and event.arrow == ">":
            asked = event.data
        elif event.side == "mount" and event.arrow == "<" and len(event.data) > 2:
            found += [(event.at, asked, event.data)] * asked.startswith(private)
    return found


@pytest.mark.parametrize(
    "mount",
    as_a_rule(
        ["lx200:onstep", "nexstar:cgem"],
        whole=["lx200:autostar", "lx200:lx200", "lx200:lx200gps", "lx200:onstep", "lx200:other", "lx200:teenastro",
               "nexstar:6-8se", "nexstar:cgem", "nexstar:nexstar-gps", "alpaca:german"],
    ),
)  # fmt: skip
def test_nothing_true_is_told_after_a_request_was_lost(mount: str, tmp_path: Path) -> None:
    """A reply that fails to come must not shift the others: each belongs to the request before it."""
    private = PRIVATE[mount.partition(":")[0]]
    for nth in as_a_rule((9, 18, 19, 20, 21), whole=range(1, 60)):
        for before in tmp_path.iterdir():
            before.unlink()
        findings = _lost(mount, tmp_path / "original.rec", nth)
        if mount == "alpaca:german" and site_of(read(tmp_path / "original.rec"))[0] is None:
            with pytest.raises(UserError, match="the site is not known"):  # it was asked only once yet
                bundle.make(findings, [tmp_path / "original.rec"])
            continue
        files = bundle.make(findings, [tmp_path / "original.rec"], random=Random(1))
        (tmp_path / "1.rec").write_bytes(files["1.rec"])
        before_and_after = [set(_told(tmp_path / name, private)) for name in ("original.rec", "1.rec")]
        assert before_and_after[0]
        assert not before_and_after[0] & before_and_after[1], (mount, nth)
        loaded = json.loads(files[bundle.VERDICTS])["played"]["1.rec"]
        asked = sum(event.side == "mount" and event.arrow == ">" for event in read(tmp_path / "original.rec"))
        assert loaded["requests"] > 0.9 * asked and loaded["strayed"] == 0, (mount, nth)


def test_a_reply_that_cannot_be_understood_is_not_told(tmp_path: Path) -> None:
    findings = _lost("lx200:lx200", path := tmp_path / "original.rec", 0)
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b"+47\\xdf18#", b"+47\\xdf1x8#"))
    assert path.read_bytes() != whole
    assert b"+47" not in bundle.make(findings, [path], random=Random(1))["1.rec"]


def test_a_private_reply_that_stays_makes_no_bundle(tmp_path: Path) -> None:
    """Whatever way it takes through the code that hides it."""
    findings = _lost("lx200:lx200", path := tmp_path / "original.rec", 0)
    with (
        patch("gateway.protocols.wireformat.command.FrameTemplate.encode", lambda *_: b"+47\xdf18#"),
        pytest.raises(UserError, match="was not hidden"),
    ):
        bundle.make(findings, [path], random=Random(1))


@pytest.mark.parametrize(
    "surface",
    ["any@tcp://127.0.0.1:4040", "lx200@tcp://127.0.0.1:4030", "nexstar:synscan@tcp://127.0.0.1:4030",
     "alpaca@tcp://127.0.0.1:11111", "stellarium@tcp://127.0.0.1:10001", "lx200@COM5",
     "lx200@rfc2217://0.0.0.0:4032"],
)  # fmt: skip
def test_whatever_surface_the_owner_has_a_bundle_is_made(surface: str, tmp_path: Path) -> None:
    findings = _lost("nexstar:6-8se", path := tmp_path / "original.rec", 0)
    lines = path.read_bytes().split(b"\n", 2)
    settings = json.loads(lines[1][2:])
    settings["config"]["surface"].insert(0, settings["config"]["surface"][0] | {"at": surface})
    path.write_bytes(b"\n".join([lines[0], b"# " + json.dumps(settings).encode(), lines[2]]))
    files = bundle.make(findings, [path], random=Random(1))
    assert json.loads(files[bundle.VERDICTS])["played"]["1.rec"]["requests"] > 20
    assert surface.partition("@")[2].encode() not in files["1.rec"]


def test_a_site_that_is_known_only_later_is_hidden_in_all_recordings(tmp_path: Path) -> None:
    """The shift of the clocks and that of the longitude must be one, or the sky of the gotos tells the true one."""
    for name, known in (("a.rec", False), ("b.rec", True)):
        config = {"at": "nexstar:i-series/2.2@sim", "mode": "eq-north"} | ({"site": SITE} if known else {})
        path = tmp_path / name
        findings = _lost("nexstar:i-series/2.2", path, 0, config, wedge=True, start=EVENING + 600.0 * known)
    files = bundle.make(findings, [tmp_path / "a.rec", tmp_path / "b.rec"], random=Random(1))
    (tmp_path / "2.rec").write_bytes(files["2.rec"])
    site, _ = site_of(hidden := read(tmp_path / "2.rec"))
    assert site is not None
    before, after = sidereal_time(EVENING + 600.0, SITE[1]), sidereal_time(hidden.settings["began"], site[1])
    assert abs(wrap180(before - after)) < 0.02


@pytest.mark.parametrize("places", [((47.3, 11.6), (47.3, 40.0)), ((47.3, 11.6), (52.0, 11.6))])
def test_recordings_of_two_sites_make_no_bundle(places: tuple[tuple[float, float], ...], tmp_path: Path) -> None:
    paths = [tmp_path / "a.rec", tmp_path / "b.rec"]
    for path, site in zip(paths, places, strict=True):
        findings = _lost("nexstar:6-8se", path, 0, site=site)
    with pytest.raises(UserError, match="several sites"):
        bundle.make(findings, paths, random=Random(1))


def test_settings_with_another_site_than_the_mount_tells_make_no_bundle(tmp_path: Path) -> None:
    findings = _lost("nexstar:6-8se", path := tmp_path / "original.rec", 0, {"site": (40.0, -75.0)})
    with pytest.raises(UserError, match="another site than the settings"):
        bundle.make(findings, [path], random=Random(1))


@pytest.mark.parametrize(
    ("mount", "zone"),
    [("lx200:onstep", 5.75), ("nexstar:cgem", 5.75), ("lx200:lx200gps", -3.5), ("nexstar:synscan", 5.5)],
)
def test_a_zone_that_names_a_country_becomes_one_of_whole_hours(mount: str, zone: float, tmp_path: Path) -> None:
    site = (27.7, 15.0 * zone)
    findings = _lost(mount, path := tmp_path / "original.rec", 0, utc_offset=zone, site=site)
    assert site_of(read(path), findings.model)[1] in (zone, int(zone))  # an older Celestron counts whole hours
    files = bundle.make(findings, [path], random=Random(1))
    (tmp_path / "1.rec").write_bytes(files["1.rec"])
    hidden = read(tmp_path / "1.rec")
    told, there = site_of(hidden, findings.model)
    assert there % 1.0 == 0.0 and told is not None
    before, after = sidereal_time(EVENING, site[1]), sidereal_time(hidden.settings["began"], told[1])
    assert abs(wrap180(before - after)) < 0.02


@pytest.mark.parametrize("minutes", [-11.0, -1.0, 3.0, 9.0])
def test_a_date_changes_at_the_midnight_that_is_told(minutes: float, tmp_path: Path) -> None:
    """Date, local time and zone of a Meade give the clock of the recording, so many minutes from its midnight."""
    midnight = EVENING + 2.0 * 3600.0  # in UTC, which is the local time here
    for seed in range(6):
        path = tmp_path / f"original{seed}.rec"
        findings = _lost("lx200:lx200gps", path, 0, start=midnight + 60.0 * minutes)
        files = bundle.make(findings, [path], random=Random(seed))
        (tmp_path / "1.rec").write_bytes(files["1.rec"])
        told = _told(tmp_path / "1.rec", (b":GC", b":GL", b":GG"))
        clock = {asked: reply.decode("latin-1").rstrip("#") for _, asked, reply in reversed(told)}
        at = next(at for at, asked, _ in told if asked == b":GL#")
        local = datetime.strptime(f"{clock[b':GC#']} {clock[b':GL#']}+0000", "%m/%d/%y %H:%M:%S%z").timestamp()
        unix = local + 3600.0 * float(clock[b":GG#"].split(":")[0])
        assert abs(unix - read(tmp_path / "1.rec").settings["began"] - at) < 5.0, (seed, clock)
