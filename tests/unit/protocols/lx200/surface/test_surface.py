"""What the surface is as a whole: never upset, one format for each client, truthful about the mount."""

from __future__ import annotations

from hypothesis import example, given
from hypothesis import strategies as st

from gateway.core import operations as op
from gateway.core.errors import NoAnswer
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.examples import some
from tests.support.fake_mount import Mount, Talk
from tests.support.sampling import as_a_rule

MODELS = ["autostar", "lx200", "lx200-16", "lx200gps"]
NAMES = sorted(load("lx200").commands)
ARGUMENTS = (
    b"", b"x", b"abc", b" ", b"-5", b"+", b".", b"0", b"9", b"1.2.3", b"9999999", b"n", b"n-5", b"\xff", b"12:34:56",
    b"+12*34:56", b"nan", b"inf", b"1e3", b"1_0",
)  # fmt: skip


# --- whatever is sent ---------------------------------------------------------------------------------------------


@each("name", [name for name in NAMES if name != "ACK"])
def test_no_argument_breaks_an_lx200_command(name: str) -> None:
    """As a rule each with one model, and every command with all of them."""
    every = as_a_rule(len(MODELS), whole=1)
    for number, argument in enumerate(ARGUMENTS, len(name)):
        for model in MODELS[number % every :: every]:
            talk = Talk(model=model)
            talk.send((b"" if name.startswith("$Q") else b":") + name.encode() + argument + b"#")
            assert talk.send(b"#:Gc#").endswith((b"24#", b"12#"))


@some
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=12),
            st.sampled_from(NAMES).map(lambda name: b":" + name.encode()),
            st.just(b"#"),
            st.just(b"\x06"),
        ),
        max_size=30,
    )
)
@example([b":SG", b"-15:00", b"#"])
def test_no_bytes_break_the_lx200_surface(pieces: list[bytes]) -> None:
    talk = Talk()
    talk.send(b"".join(pieces))
    talk.wait(3)
    assert talk.send(b"#:Gc#").endswith((b"24#", b"12#"))


# --- formats ------------------------------------------------------------------------------------------------------


def _degrees(text: bytes) -> float:
    whole, minutes, *seconds = (float(part) for part in text.strip(b"+-#").replace(b"*", b":").split(b":"))
    size = whole + minutes / 60 + (seconds[0] / 3600 if seconds else 0)
    return -size if text.startswith(b"-") else size


@some
@given(st.floats(0, 360, exclude_max=True), st.floats(-90, 90))
def test_both_lx200_precisions_are_exact_to_half_their_last_digit(ra: float, dec: float) -> None:
    long, short = Talk(mount := Mount()), Talk(mount)
    short.send(b":U#")
    mount.position, mount.horizontal = op.Equatorial(ra, dec), op.Horizontal(ra, dec)
    for talk, hours, tick in ((long, 1 / 240, 1 / 3600), (short, 1 / 40, 1 / 60)):
        for command, wanted, size, digit in (
            (b":GR#", ra, 15.0, hours),
            (b":GD#", dec, 1.0, tick),
            (b":GZ#", ra, 1.0, tick),
            (b":GA#", dec, 1.0, tick),
        ):
            reply = talk.send(command)
            off = _degrees(reply) * size - wanted
            assert abs((off + 180) % 360 - 180) <= digit / 2 + 1e-9, (command, reply)


@each("start", ["high", "low"])
def test_lx200_precision_belongs_to_one_client(start: str) -> None:
    long, short = (
        (b"12:34:56#+45*12:34#", b"12:34.9#+45*13#")
        if start == "high"
        else (b"12:34.9#+45*13#", b"12:34:56#+45*12:34#")
    )
    one, other = Talk(mount := Mount(), precision=start), Talk(mount, precision=start)
    assert one.send(b":GR#:GD#") == long
    assert one.send(b":U#:GR#:GD#") == short
    assert other.send(b":GR#:GD#") == long
    assert other.send(b":U#:U#:GR#:GD#") == long
    assert one.send(b":GR#:GD#") == short


# --- one instant --------------------------------------------------------------------------------------------------


@each(
    ("first", "second", "before", "after"),
    [(b":GR#", b":GD#", b"+45*12:34#", b"+20*00:00#"), (b":GZ#", b":GA#", b"+40*00:00#", b"+20*00:00#")],
)
def test_lx200_position_pair_is_of_one_instant(first: bytes, second: bytes, before: bytes, after: bytes) -> None:
    def moved() -> Talk:
        talk = Talk()
        talk.send(first)
        talk.mount.position, talk.mount.horizontal = op.Equatorial(100.0, 20.0), op.Horizontal(100.0, 20.0)
        return talk

    assert moved().send(second) == before
    assert (talk := moved()).send(second + second) == before + after, "the pair is used up"
    assert talk.send(first + second).endswith(after)
    assert moved().send(b":D#" + second) == b"#" + after, "something else came between"
    talk = moved()
    talk.wait(1.1)
    assert talk.send(second) == after, "too long ago"
    talk = moved()
    talk.reconnect()
    assert talk.send(second) == after, "another connection's"


# --- truthful about the mount -------------------------------------------------------------------------------------


@each(
    ("tracking", "aligned", "equatorial", "ack", "state"),
    [
        (op.Tracking.ALTAZ, True, False, b"A", b"AT1"),
        (op.Tracking.EQ_NORTH, True, True, b"P", b"PT1"),
        (op.Tracking.EQ_SOUTH, False, True, b"P", b"PT0"),
        (op.Tracking.OFF, True, False, b"A", b"AN1"),
        (op.Tracking.OFF, False, True, b"P", b"PN0"),
    ],
)
def test_lx200_surface_reports_tracking_mode_and_alignment(
    tracking: op.Tracking, aligned: bool, equatorial: bool, ack: bytes, state: bytes
) -> None:
    talk = Talk()
    talk.mount.status = op.Status(tracking, aligned=aligned, equatorial=equatorial)
    assert talk.send(b"\x06:GW#") == ack + state
    assert Talk(talk.mount, model="lx200gps").send(b":Aa#") == (b"1" if aligned else b"0")


def test_land_mode_is_reported_only_to_the_client_that_set_it() -> None:
    one, other = Talk(mount := Mount()), Talk(mount)
    assert one.send(b"\x06:AL#\x06") == b"PL"
    assert other.send(b"\x06") == b"P"
    assert one.send(b":AP#\x06:AL#:AA#\x06") == b"PP"


def test_lx200_alignment_menu_marks_the_current_mode() -> None:
    talk = Talk(model="lx200")
    marked = [talk.send(b":G%d#" % entry).startswith(b">") for entry in range(3)]
    assert marked == [False, True, False]
    talk.mount.status = op.Status(op.Tracking.ALTAZ, aligned=True, equatorial=False)
    assert [talk.send(b":G%d#" % entry).startswith(b">") for entry in range(3)] == [True, False, False]
    assert talk.send(b":AL#:G2#").startswith(b">")


@each(("model", "product", "firmware"), [("autostar", b"Autostar", b"43Eg"), ("lx200gps", b"LX2001", b"4.2l")])
def test_lx200_surface_tells_the_identity_of_the_presented_model(model: str, product: bytes, firmware: bytes) -> None:
    talk = Talk(model=model)
    assert talk.send(b":GVP#:GVN#") == product + b"#" + firmware + b"#"
    assert talk.mount.asked == []


def test_lx200_restart_unparks_mount_and_clears_client_settings() -> None:
    talk = Talk(model="lx200gps")
    talk.send(b":U#:H#:AL#:Sr05:34:32#:Sd+22*00:52#:So30#")
    assert talk.send(b":I#") == b"X"
    assert talk.mount.of(op.Unpark) == [op.Unpark()]
    assert talk.send(b":GR#:Gc#\x06:MS#:Go#") == b"12:34:56#24#P1No target set.#00*#"
    assert Talk().send(b":I#") == b"", "an Autostar has no reply"


def test_lx200_surface_is_silent_while_the_mount_is_silent() -> None:
    talk = Talk()
    talk.mount.fault = NoAnswer()
    assert talk.send(b"\x06:GW#:GR#:GD#:D#:GZ#:GA#:h?#:G0#") == b""
    assert talk.send(b":GVP#:Gc#:GT#:GM#") == b"Autostar#24#60.1#SITE 1#"
