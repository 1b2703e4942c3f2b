"""Site and clock through the NexStar surface: UTC for every zone in use, and what was set told again as it was set."""

from __future__ import annotations

import calendar
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.core import operations as op
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.examples import some
from tests.support.fake_mount import Mount, Talk, unix

#: Hours east: every offset that is law somewhere.
OFFSETS = [
    -12, -11, -10, -9.5, -9, -8, -7, -6, -5, -4, -3.5, -3, -2.5, -2, -1, 0, 1, 2, 3, 3.5, 4, 4.5, 5, 5.5, 5.75, 6,
    6.5, 7, 8, 8.75, 9, 9.5, 10, 10.5, 11, 12, 12.75, 13, 13.75, 14,
]  # fmt: skip
MODELS = sorted(load("nexstar").models)
WITH_RTC = ["cge", "cge-pro", "avx", "cgx", "cgx-l"]


def talk_to(model: str = "6-8se", mount: Mount | None = None, version: str | None = None) -> Talk:
    return Talk(mount, protocol="nexstar", model=model, version=version)


def told(reply: bytes, hours_per_unit: float = 1.0) -> float:
    """The UTC that a clock reply means, worked out by hand."""
    assert len(reply) == 9 and reply[8:] == b"#"
    hour, minute, second, month, day, year, zone, dst = reply[:8]
    east = (zone - 256 if zone > 127 else zone) * hours_per_unit + dst
    return calendar.timegm((2000 + year, month, day, hour, minute, second)) - east * 3600


def local(utc: str, hours: float) -> bytes:
    """Six bytes of local time at a UTC."""
    there = datetime.fromtimestamp(unix(utc) + hours * 3600, UTC)
    return bytes((there.hour, there.minute, there.second, there.month, there.day, there.year - 2000))


# --- the clock ------------------------------------------------------------------------------------------------------


@each("offset", OFFSETS)
@each("utc", ["2026-01-01 00:00:35", "2026-12-31 23:59:59", "2028-02-29 12:35:35", "2000-01-02 03:04:05"])
def test_nexstar_surface_reports_utc_exactly_in_every_zone(offset: float, utc: str) -> None:
    talk = talk_to(version="5.31")
    talk.mount.clock = op.Moment(unix(utc), offset)
    assert told(talk.send(b"h")) == unix(utc)
    assert told(talk.send(b"i"), 0.25) == unix(utc)
    assert talk.send(b"i")[6] == round(offset * 4) % 256
    assert abs((talk.send(b"h")[6] + 128) % 256 - 128 - offset) <= 0.5


@each("offset", OFFSETS)
@pytest.mark.parametrize("utc", ["2026-01-01 00:00:35", "2026-12-31 23:59:59", "2028-02-29 12:35:35"])
@pytest.mark.parametrize("dst", [0, 1])
def test_nexstar_surface_sets_utc_exactly_in_every_zone_and_reads_it_back(offset: float, utc: str, dst: int) -> None:
    quarters = talk_to(version="5.31")
    command = b"I" + local(utc, offset) + bytes((round((offset - dst) * 4) % 256, dst))
    assert quarters.send(command) == b"#"
    assert quarters.mount.clock == op.Moment(unix(utc), offset)
    assert quarters.send(b"i") == command[1:] + b"#"
    assert told(quarters.send(b"h")) == unix(utc)
    if offset == int(offset):
        whole = talk_to()
        command = b"H" + local(utc, offset) + bytes((int(offset - dst) % 256, dst))
        assert whole.send(command) == b"#"
        assert whole.mount.clock == op.Moment(unix(utc), offset)
        assert whole.send(b"h") == command[1:] + b"#"


def test_nexstar_zone_and_daylight_saving_are_reported_until_the_mount_changes_them() -> None:
    talk = talk_to()
    talk.send(b"H\x0f\x1a\0\4\6\5\xfb\1")
    talk.wait(3600)
    assert talk.send(b"h") == b"\x10\x1a\0\4\6\5\xfb\1#"
    talk.mount.clock = op.Moment(talk.mount.clock.unix, 5.75)
    assert talk.send(b"h")[6:] == b"\6\0#"
    assert told(talk.send(b"h")) == unix("2005-04-06 20:26:00")


def test_nexstar_clock_example_of_the_manual_gives_its_documented_time() -> None:
    """Time/Location Commands: 3:26:00 PM, April 6 2005, zone -5, daylight saving."""
    talk = talk_to()
    assert talk.send(b"H\x0f\x1a\0\4\6\5\xfb\1") == b"#"
    assert talk.mount.clock == op.Moment(unix("2005-04-06 19:26:00"), -4.0)


@some
@given(st.binary(min_size=8, max_size=8))
def test_no_eight_bytes_break_the_nexstar_clock(data: bytes) -> None:
    for command, version in ((b"H", "4.21"), (b"I", "5.31")):
        talk = talk_to(version=version)
        assert talk.send(command + data) == b"#"
        for clock in talk.mount.of(op.SetClock):
            assert abs(clock.offset) <= 15
            assert datetime.fromtimestamp(clock.unix, UTC).year in range(1999, 2101)
        assert talk.send(command.lower() + b"Kz").endswith(b"#z#")


def test_setting_nexstar_site_and_time_keeps_the_alignment() -> None:
    assert talk_to().send(b"JW\x21\x32\x29\0\x76\x14\x11\1H\x0f\x1a\0\4\6\5\xfb\1J") == b"\1###\1#"


# --- the site -------------------------------------------------------------------------------------------------------

PLACES = [(degrees, minute, second) for degrees in (0, 1, 35, 89) for minute in (0, 35, 59) for second in (0, 35, 59)]


@pytest.mark.parametrize("south", [0, 1])
@pytest.mark.parametrize("west", [0, 1])
def test_nexstar_site_is_read_back_as_set(south: int, west: int) -> None:
    talk = talk_to()
    for latitude in PLACES:
        for degrees in (0, 35, 100, 179):
            longitude = (degrees, *latitude[1:])
            data = bytes((*latitude, south if any(latitude) else 0, *longitude, west if any(longitude) else 0))
            assert talk.send(b"W" + data + b"w") == b"#" + data + b"#"
            there = talk.mount.site
            size = latitude[0] + latitude[1] / 60 + latitude[2] / 3600
            assert there.latitude == pytest.approx(-size if south else size, abs=1e-9)
            assert (there.longitude < 0) == bool(west and any(longitude))


@some
@given(st.binary(min_size=8, max_size=8))
def test_no_eight_bytes_break_the_nexstar_site(data: bytes) -> None:
    talk = talk_to()
    assert talk.send(b"W" + data) == b"#"
    assert abs(talk.mount.site.latitude) <= 90
    assert abs(talk.mount.site.longitude) <= 180
    assert len(talk.send(b"w")) == 9


# --- GPS unit and clock ---------------------------------------------------------------------------------------------


def read(device: int, command: int, count: int) -> bytes:
    return bytes((80, 1, device, command, 0, 0, 0, count))


def test_missing_gps_unit_is_reported_as_not_linked() -> None:
    """The site and the clock are told all the same, as a unit does before its first fix."""
    talk = talk_to("cpc")
    assert talk.send(read(176, 55, 1) + read(176, 54, 1)) == b"\0#\0#"
    assert talk.send(read(176, 4, 2)) == b"\x07\xea#"


@each("model", MODELS)
def test_nexstar_real_time_clock_is_set_and_read_in_parts(model: str) -> None:
    talk = talk_to(model)
    talk.mount.clock = op.Moment(unix("2026-03-31 23:30:35"), -8.0)
    setting = b"P\3\xb2\x83\x02\x1c\0\0" + b"P\3\xb2\x84\x07\xec\0\0" + b"P\4\xb2\xb3\x0f\x1a\x23\0"
    reading = read(178, 3, 2) + read(178, 4, 2) + read(178, 51, 3)
    if model in WITH_RTC:
        assert talk.send(reading) == b"\x03\x1f#\x07\xea#\x17\x1e\x23#"
        assert talk.send(setting + reading) == b"###\x02\x1c#\x07\xec#\x0f\x1a\x23#"
        assert talk.mount.clock == op.Moment(unix("2028-02-28 15:26:35"), -8.0), "UT; the zone stays"
    else:
        assert talk.send(reading) == b"\0\0\0#\0\0\0#\0\0\0\0#"
        assert talk.send(setting) == b"\0#" * 3
        assert talk.mount.of(op.SetClock) == []


@each(
    "setting",
    [
        b"P\3\xb2\x83\x02\x1e\0\0", b"P\3\xb2\x83\0\1\0\0", b"P\3\xb2\x83\x0d\1\0\0", b"P\3\xb2\x84\0\0\0\0",
        b"P\3\xb2\x84\0\x1a\0\0", b"P\3\xb2\x84\xff\xff\0\0", b"P\4\xb2\xb3\x18\0\0\0", b"P\4\xb2\xb3\0\x3c\0\0",
    ],
)  # fmt: skip
def test_impossible_part_of_the_nexstar_clock_changes_nothing(setting: bytes) -> None:
    talk = talk_to("cge")
    assert talk.send(setting) == b"\0#", "the form for no: no byte was asked for, and one comes"
    assert talk.mount.of(op.SetClock) == []
