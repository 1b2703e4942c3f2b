"""Local time, date and UTC offset: whatever a client sends and in whatever order, UTC is what must be right."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.core import operations as op
from tests.support.each import each
from tests.support.examples import some
from tests.support.fake_mount import Mount, Talk, unix
from tests.support.sampling import as_a_rule

#: Every offset in civil use, local minus UTC in hours.
OFFSETS = [*range(-12, 15), -9.5, -3.5, -2.5, 3.5, 4.5, 5.5, 5.75, 6.5, 8.75, 9.5, 10.5, 12.75, 13.75]
#: Both sides of midnight, of the new year, and of a leap day.
LOCAL = [
    "2026-12-31 23:59:59",
    "2027-01-01 00:00:00",
    "2026-07-01 00:00:01",
    "2026-06-30 12:00:00",
    "2028-02-29 23:30:00",
    "2028-03-01 00:15:00",
]
DATED = b"1Updating        planetary data. #" + b" " * 32 + b"#"


def _some(rows: Iterable[tuple[Any, ...]], offset: float) -> Iterable[tuple[Any, ...]]:
    """As a rule every second one, the others with the next offset."""
    every = as_a_rule(2, whole=1)
    return itertools.islice(rows, round(offset) % every, None, every)


def spellings(offset: float) -> list[bytes]:
    """How programs write an offset for :SG: hours to add to local time."""
    meade = -offset
    sign, size = ("-" if meade < 0 else "+"), abs(meade)
    whole, part = int(size), size % 1
    forms = [f"{sign}{whole:02d}:{int(part * 60):02d}"]
    if part == 0.75:
        forms += [f"{sign}{whole:02d}.7", f"{sign}{whole:02d}.8", f"{sign}{whole:02d}.75"]
    elif part:
        forms += [f"{sign}{whole:02d}.5", f"{sign}{whole}.5"]
    else:
        forms += [f"{sign}{whole:02d}", f"{sign}{whole}", f"{sign}{whole}.0", f"{sign}{whole:02d}.0"]
        forms += ["-00", "+00"] if whole == 0 else []
    return [form.encode() for form in forms]


def pieces(local: datetime, offset: bytes) -> dict[str, bytes]:
    return {
        "SG": b":SG%s#" % offset,
        "SL": local.strftime(":SL%H:%M:%S#").encode(),
        "SC": local.strftime(":SC%m/%d/%y#").encode(),
    }


def told(talk: Talk) -> float:
    """UTC as a client makes it from :GC#, :GL# and :GG#, Unix seconds."""
    date, time, offset = (talk.send(command).decode().rstrip("#") for command in (b":GC#", b":GL#", b":GG#"))
    local = datetime.strptime(f"{date} {time}", "%m/%d/%y %H:%M:%S").replace(tzinfo=UTC)
    return local.timestamp() + float(offset) * 3600


def instants(mount: Mount) -> list[float]:
    return [clock.unix for clock in mount.of(op.SetClock)]


# --- setting ------------------------------------------------------------------------------------------------------


@each("order", itertools.permutations(("SG", "SL", "SC")))
@each("pause", [0.0, 0.05, 0.7, 1.5])
@each("each_its_connection", [False, True])
def test_lx200_date_time_and_offset_in_any_order_make_one_instant(
    order: tuple[str, ...], pause: float, each_its_connection: bool
) -> None:
    talk, since_time = Talk(), 0.0
    for index, name in enumerate(order):
        if index:
            talk.wait(pause)
            since_time += pause if "SL" in order[:index] else 0.0
        if each_its_connection:
            talk.reconnect()
        assert talk.mount.of(op.SetClock) == []
        assert talk.send(pieces(datetime(2026, 7, 4, 21, 30, 0), b"+05")[name]) == (DATED if name == "SC" else b"1")
    talk.wait(10)
    (clock,) = talk.mount.of(op.SetClock)
    assert clock.unix == pytest.approx(unix("2026-07-05 02:30:00") + since_time, abs=1e-3)
    assert clock.offset == -5.0


@each("offset", OFFSETS)
def test_lx200_utc_is_exact_for_every_offset_and_spelling(offset: float) -> None:
    for spelling, text in _some(itertools.product(spellings(offset), LOCAL), offset):
        local = datetime.fromisoformat(text)
        talk = Talk()
        for command in pieces(local, spelling).values():
            assert talk.send(command) in (b"1", DATED), spelling
        assert instants(talk.mount) == [unix(text) - offset * 3600], (spelling, text)
        assert told(talk) == unix(text) - offset * 3600, (spelling, text)


@each("offset", OFFSETS)
@pytest.mark.parametrize("utc_date", [False, True])
def test_lx200gps_surface_takes_the_date_nearer_to_the_hosts_clock(offset: float, utc_date: bool) -> None:
    """By the manual its date is UTC's; programs send the local one as well."""
    for text, error in _some(itertools.product(LOCAL, (-3600, 0, 3600)), offset):
        local = datetime.fromisoformat(text)
        true = unix(text) - offset * 3600
        talk = Talk(model="lx200gps")
        talk.now = true + error
        date = datetime.fromtimestamp(true, UTC) if utc_date else local
        sent = {**pieces(local, spellings(offset)[0]), "SC": date.strftime(":SC%m/%d/%y#").encode()}
        talk.send(b"".join(sent.values()))
        assert instants(talk.mount) == [true], (text, error)


@each("host", ["2023-01-01 00:00:00", "2026-07-01 00:00:00", "2026-07-09 00:00:00"])
@each(("offset", "local", "sent"), [(b"+05", "21:30:00", "07/05/26"), (b"-10", "05:00:00", "07/03/26")])
def test_lx200gps_surface_takes_the_date_as_utc_where_the_host_lost_its_clock(
    host: str, offset: bytes, local: str, sent: str
) -> None:
    """Either reading is days away from it, so which is nearer says nothing: the date that was sent is UTC's."""
    talk = Talk(model="lx200gps")
    talk.now = unix(host)
    talk.send(b":SG%s#:SL%s#:SC%s#" % (offset, local.encode(), sent.encode()))
    assert instants(talk.mount) == [unix("2026-07-05 02:30:00" if offset == b"+05" else "2026-07-03 19:00:00")]


def test_other_lx200_surfaces_take_the_local_date_whatever_the_host_says() -> None:
    talk = Talk(model="lx200")
    talk.now = unix("2026-07-04 00:00:00")
    talk.send(b":SG+05#:SL21:30:00#:SC07/04/26#")
    assert instants(talk.mount) == [unix("2026-07-05 02:30:00")]


def test_lx200_clock_is_set_two_quiet_seconds_after_the_last_piece() -> None:
    talk = Talk()
    talk.send(b":SL20:00:00#")
    talk.wait(1.5)
    talk.send(b":SC03/22/26#")
    talk.wait(1.5)
    assert talk.mount.of(op.SetClock) == []
    talk.wait(0.6)
    assert instants(talk.mount) == [pytest.approx(unix("2026-03-23 04:00:00") + 3.5)]
    talk.wait(10)
    assert len(talk.mount.of(op.SetClock)) == 1


def test_lx200_utc_offset_alone_changes_no_clock() -> None:
    talk = Talk()
    talk.send(b":SG+05#")
    talk.wait(10)
    assert talk.mount.of(op.SetClock) == []
    assert talk.send(b":GG#:GL#") == b"+05#23:15:40#"
    assert told(talk) == unix("2026-03-21 04:15:40")


def test_lx200_utc_offset_set_a_minute_after_the_time_changes_no_clock() -> None:
    talk = Talk()
    for seconds, changes in ((59.0, 2), (61.0, 3)):
        talk.send(b":SG+06#:SL21:30:00#:SC07/04/26#")
        talk.wait(seconds)
        talk.send(b":SG+05#")
        talk.wait(10)
        assert len(instants(talk.mount)) == changes
    assert told(talk) == unix("2026-07-05 03:30:00") + 71.0


def test_second_lx200_date_time_and_offset_set_the_mount_clock_at_once() -> None:
    talk = Talk()
    talk.send(b":SG+06#:SL21:30:00#:SC07/04/26#")
    talk.send(b":SG+05#:SL21:31:00#:SC07/04/26#")
    assert instants(talk.mount) == [unix("2026-07-05 03:30:00"), unix("2026-07-05 02:31:00")]


@each("question", [b":GL#", b":GC#", b":GG#", b":Ga#", b":GS#"])
def test_lx200_time_query_first_applies_a_date_and_time_already_sent(question: bytes) -> None:
    talk = Talk()
    talk.send(b":SL23:00:00#:SC03/22/26#")
    assert talk.mount.of(op.SetClock) == []
    talk.send(question)
    kinds = [type(operation) for operation in talk.mount.asked]
    assert kinds.count(op.SetClock) == 1
    assert kinds.index(op.SetClock) < len(kinds) - 1 or question == b":GG#"
    assert instants(talk.mount) == [unix("2026-03-23 07:00:00")]
    assert talk.send(b":GC#:GL#") == b"03/22/26#23:00:00#"


def test_refused_lx200_date_time_or_offset_does_not_spoil_later_valid_ones() -> None:
    talk = Talk()
    assert talk.send(b":SG+05#:SL24:00:00#:SC02/30/26#:SC13/01/26#:SL12:61:00#:SGabc#:SG+15#") == b"1000000"
    assert talk.send(b":SL21:30:00#") == b"1"
    assert talk.send(b":SC07/04/26#") == DATED
    assert instants(talk.mount) == [unix("2026-07-05 02:30:00")]


def test_lx200_hi_command_sets_local_date_and_time_at_once() -> None:
    talk = Talk(model="lx200gps")
    talk.now = unix("2023-01-01 00:00:00")
    assert talk.send(b":SG+05#:hI260704213000#") == b"11"
    assert talk.send(b":hI269904213000#") == b""
    assert instants(talk.mount) == [unix("2026-07-05 02:30:00")]


# --- telling ------------------------------------------------------------------------------------------------------


@some
@given(st.integers(946684800, 4102444799), st.sampled_from(OFFSETS), st.sampled_from(OFFSETS))
def test_two_lx200_clients_with_different_offsets_read_the_same_utc(now: int, one: float, other: float) -> None:
    mount = Mount()
    mount.clock = op.Moment(float(now), one)
    first, second = Talk(mount), Talk(mount)
    second.send(b":SG%s#" % spellings(other)[0])
    assert told(first) == told(second) == now if now < 2524608000 else True
    assert first.send(b":GL#") == (
        b"%s#" % (datetime.fromtimestamp(now, UTC) + timedelta(hours=_printed(one))).strftime("%H:%M:%S").encode()
    )


def _printed(offset: float) -> float:
    """Three quarters would be read in two ways; half an hour less is told with the time that belongs to it."""
    return offset - 0.25 if offset % 1 == 0.75 else offset


def test_twelve_hour_format_belongs_to_one_lx200_client() -> None:
    one, other = Talk(mount := Mount()), Talk(mount)
    assert one.send(b":Gc#:H#:Gc#:GL#:Ga#") == b"24#12#20:15:30#08:15:30#"
    assert other.send(b":Gc#") == b"24#"
    for local, shown in ((0, b"12"), (1, b"01"), (11, b"11"), (12, b"12"), (13, b"01"), (23, b"11")):
        mount.clock = op.Moment(unix("2026-03-21 00:05:07") + local * 3600, 0.0)
        assert one.send(b":Ga#") == b"%s:05:07#" % shown


def test_every_accepted_lx200_utc_offset_can_be_reported() -> None:
    """In tenths of an hour, those of no zone on Earth, too."""
    talk = Talk(Mount())
    for tenths in range(-160, 161):
        sign, size = "-" if tenths < 0 else "+", abs(tenths)
        if talk.send(b":SG%s%02d.%d#" % (sign.encode(), *divmod(size, 10))) == b"1":
            told = talk.send(b":GG#")
            assert talk.send(b":SG" + told) == b"1", (tenths, told)
