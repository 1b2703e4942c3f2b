"""The simulated Meades against the manual and against what real ones were seen to answer, typed by hand."""

from __future__ import annotations

import pytest

from gateway import FrameError, decode_reply
from gateway.astro.spherical import separation
from gateway.protocols.lx200.simulator.server import HANDLERS
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.manual_files import fits, raw, rows
from tests.support.simulated_meade import MODELS, SITES, meade

#: What real telescopes answer otherwise than programs need it: typed from captures.
GENUINE = {
    "GG": r"[+-]\d{1,2}(\.\d)?#",
    "Gg": r"[+-]?\d{3}\xdf\d\d(:\d\d)?#",
    "Gt": r"[+-]\d\d\xdf\d\d(:\d\d)?#",
    "GZ": r"\d{3}\xdf\d\d([:']\d\d)?#",
    "GT": r"\+?\d\d\.\d#",
    "SC": r"1Updating( {8}p| P)lanetary [dD]ata(\. )?# +#",
    "St": r"[01]",
    "I": r"X",
    "D": r"(\x7f)?#|[\xff ]{32}#",
    "G0": r"[^#]{0,16}#",
    "G1": r"[^#]{0,16}#",
    "G2": r"[^#]{0,16}#",
    "ST": r"[01]",
    "LI": r"[^#]+#",
    "gps": r"\$GP[^#]+#",
}


def test_every_command_of_the_meade_manual_has_a_simulator_handler() -> None:
    known = load("lx200").commands
    assert {name for name, command in known.items() if not command.beyond} <= set(HANDLERS) <= set(known)


def test_simulated_meade_ignores_a_command_without_a_handler(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, _ = meade("autostar")
    monkeypatch.delitem(HANDLERS, "D")
    assert sim.feed(b":D#:GR#") == sim.feed(b":GR#") != b""


def understood(name: str, reply: bytes) -> bool:
    """Whether the gateway would take this reply of a mount, and not drop it as garbled."""
    try:
        return bool(decode_reply("lx200", name, reply))
    except FrameError:
        return False


@pytest.mark.parametrize("model", MODELS)
def test_simulated_meade_answers_every_form_of_the_manual_as_real_ones_do(model: str) -> None:
    wrong = []
    for name, example, models, shapes in rows("lx200_forms.txt"):
        sim, _ = meade(model)
        if not sim.high_precision:
            sim.feed(b":U#")
        reply = sim.feed(raw(example))
        if model not in models.split(","):
            expected = "-"  # silence, but for a form that is known beyond the manual's column
            if name in ("Sz",):
                continue
        elif name in ("GVP", "GVN", "GVD", "GVT") and model in ("lx200", "lx200-16"):
            expected = "-"  # a classic has no name
        else:
            expected = GENUINE.get(name, shapes)
        if not fits(reply, expected):
            wrong.append((name, example, reply, expected))
        if reply and not understood(name, reply):
            wrong.append((name, example, reply, "what the gateway understands"))
    assert wrong == []


@each("way", ["whole", "byte by byte", "with trailing bytes"])
def test_simulated_meade_splits_commands_at_the_hash_mark(way: str) -> None:
    sim, _ = meade()
    data = b"#:GVP#\x06:GC#"
    if way == "byte by byte":
        reply = b"".join(sim.feed(bytes((byte,))) for byte in data)
    else:
        reply = sim.feed(data + (b"#:G" if way == "with trailing bytes" else b""))
    assert reply == b"LX2001#A01/15/26#"


def test_simulated_lx200gps_replies_as_recorded_on_the_wire() -> None:
    sim, _ = meade("lx200gps", (52 + 10 / 60 + 44 / 3600, 5.385))
    assert sim.feed(b":GVP#:GVN#") == b"LX2001#4.2l#"
    assert sim.feed(b":Gt#") == b"+52\xdf10:44#"
    assert sim.feed(b":Gg#") == b"354\xdf36:54#"
    assert sim.feed(b":GW#") == b"AT1"
    assert sim.feed(b":SF021#:GF#:G0#") == b"1021'##"
    assert sim.feed(b":P#:P#") == b"HIGH PRECISIONLOW  PRECISION"
    assert sim.feed(b":I#") == b"X"
    assert sim.feed(b":GX..#:V#") == b""


def test_simulated_classic_lx200_replies_as_recorded_ones() -> None:
    sim, _ = meade("lx200", utc_offset=-8.0)
    assert sim.feed(b":GVP#:GW#:Mgn0500#:MA#:h?#") == b""
    assert sim.feed(b":GG#") == b"+8#"
    assert sim.feed(b":Gg#:Gt#") == b"350\xdf00#+45\xdf00#"
    assert sim.feed(b":D#") == b" " * 32 + b"#"
    assert sim.feed(b":CM#") == b"Coordinates     matched.        #"
    assert sim.feed(b":GR#")[5:6] == b"."
    assert sim.feed(b":U#:GR#")[5:6] == b":"
    assert b"'" in sim.feed(b":GZ#")
    assert sim.feed(b":ST060.0#") == b"0"
    assert sim.feed(b":TM#:ST060.0#") == b"1"


def test_simulated_autostar_rejects_a_valid_latitude_but_stores_it() -> None:
    sim, _ = meade("autostar")
    assert sim.feed(b":St-33*30#") == b"0"
    assert sim.feed(b":Gt#") == b"-33\xdf30#"


@each("site", SITES)
@each("model", ["lx200", "lx200-16"])
def test_arrows_of_a_simulated_polar_mount_move_in_right_ascension_and_declination(
    model: str, site: tuple[float, float]
) -> None:
    for direction, axis, sign in ((b"n", 1, 1), (b"s", 1, -1), (b"e", 0, 1), (b"w", 0, -1)):
        sim, clock = meade(model, site, ramps=False)
        before = sim.true_position()
        sim.feed(b":RM#:M" + direction + b"#")
        clock.now += 2
        sim.feed(b":Q" + direction + b"#")
        moved = [(after - was + 180) % 360 - 180 for after, was in zip(sim.true_position(), before, strict=True)]
        assert moved[axis] * sign == pytest.approx(4.0, abs=0.1), direction
        assert abs(moved[1 - axis]) < 0.1
        still = sim.true_position()
        clock.now += 60
        assert separation(*sim.true_position(), *still) < 1 / 3600  # tracking goes on by itself
