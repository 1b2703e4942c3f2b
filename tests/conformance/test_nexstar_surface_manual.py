"""The NexStar surface against the manual typed by hand, and every row of its table on every presented model."""

from __future__ import annotations

import re

import pytest

from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, NoAnswer, SyncTooFar
from gateway.protocols.nexstar.surface.presented import missing_command_text
from gateway.protocols.nexstar.versions import parse, versions_of
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import parse_version
from tests.support.each import each
from tests.support.fake_mount import Mount, Talk, unix
from tests.support.manual_files import raw, rows
from tests.support.sampling import as_a_rule, chosen

NEXSTAR = load("nexstar")
MODELS = sorted(NEXSTAR.models)
CASES = [(model, version) for model in MODELS for version in versions_of(NEXSTAR.models[model])]
#: As a rule every model and every version once.
SOME = [CASES[number] for number in chosen(CASES, as_a_rule(1, whole=len(CASES)))]
REFUSED = [row[1:] for row in rows("refused_and_silent.txt") if row[0] == "nexstar"]
#: Rows that tell a place, which nobody knows when the mount does not answer.
TELLING = {"E", "e", "Z", "z", "L", "J", "t", "w", "h", "i", "l", "p"}
#: Rows whose acknowledgement would be a yes. A stop is owed, so it is acknowledged.
ORDERS = {"R", "r", "B", "b", "S", "s", "T", "W", "H", "I", "x", "y"}


def absent(asked: int) -> bytes:
    """The no-response form, by the manual: as many bytes as were asked for, one more, ``#``."""
    return b"\0" * asked + b"\0#"


def talk_to(model: str = "6-8se", mount: Mount | None = None, version: str | None = None) -> Talk:
    return Talk(mount, protocol="nexstar", model=model, version=version)


def manual_mount() -> Mount:
    """The state that the typed table names."""
    mount = Mount()
    mount.position = op.Equatorial(0x34AB05 / 2**24 * 360, 0x12CE05 / 2**24 * 360)
    mount.axes = mount.horizontal = op.Horizontal(0x12AB05 / 2**24 * 360, 0x400005 / 2**24 * 360)
    mount.site = op.Place(33 + 50 / 60 + 41 / 3600, -(118 + 20 / 60 + 17 / 3600))
    mount.clock = op.Moment(unix("2005-04-06 19:26:00"), -4.0)
    mount.gps = op.Gps(True, mount.site, mount.clock.unix)
    return mount


# --- the manual -----------------------------------------------------------------------------------------------------


@each(("name", "request_", "since", "reply"), rows("nexstar_forms.txt"))
def test_nexstar_surface_answers_a_form_as_the_manual_writes(name: str, request_: str, since: str, reply: str) -> None:
    """The state's CGE has a GPS unit, which the product's has not: those rows are asked of a CPC at the same place."""
    talk = talk_to("cpc" if name.startswith("gps_") else "cge", manual_mount(), "4.21")
    talk.send(raw("H\\x0f\\x1a\\x00\\x04\\x06\\x05\\xfb\\x01"))
    if name == "device_version":
        reply = "re:\\x05\\x0a#"  # this model's own motors
    answer = talk.send(raw(request_))
    if reply.startswith("re:"):
        assert re.fullmatch(reply[3:].encode("latin-1"), answer, re.DOTALL)
    else:
        assert answer == raw(reply)


@each(
    "name, request_, since, reply",
    [row for row in rows("nexstar_forms.txt") if not row[0].startswith(("no_", "gps", "rtc"))],
)
@each("version", ["1.2", "1.6", "2.2", "2.3", "3.01", "4.10", "4.21"])
def test_nexstar_surface_ignores_whole_commands_newer_than_its_version(
    name: str, request_: str, since: str, reply: str, version: str
) -> None:
    talk = talk_to("6-8se", version=version)
    known = parse_version(version) >= parse_version(since)
    assert (talk.send(raw(request_)) != b"") is known
    assert talk.send(b"?Kz").endswith(b"z#")


# --- refused and silent ---------------------------------------------------------------------------------------------

#: The cases of the hand-typed list: what is sent, on what model, and what the mount says to it.
SENT: dict[tuple[str, str], list[bytes]] = {
    ("R", "ten"): [b"R34XX,12CE"],
    ("r", "eighteen"): [b"r34ABXX00,12CE0500"],
    ("B", "ten"): [b"B12AB;4000"],
    ("b", "eighteen"): [b"b12AB0500;40000500"],
    ("S", "ten"): [b"S34AB,12GG"],
    ("s", "eighteen"): [b"s34AB0500,GGCE0500"],
    ("T", "a"): [b"T\4", b"T#", b"T1", b"T\xff"],
    ("H", "no"): [
        b"H\x18\0\0\4\6\5\0\0",
        b"H\0\x3c\0\4\6\5\0\0",
        b"H\0\0\x3c\4\6\5\0\0",
        b"H\0\0\0\x0d\6\5\0\0",
        b"H\0\0\0\0\6\5\0\0",
        b"H\0\0\0\4\x1f\5\0\0",
        b"H\0\0\0\2\x1d\5\0\0",
        b"H\0\0\0\4\6\5\x0f\0",
        b"H\0\0\0\4\6\5\xf1\0",
        b"H\0\0\0\4\6\5\0\2",
        b"H\0\0\0\4\6\x64\0\0",
        b"H" + b"\xff" * 8,
    ],
    ("W", "no"): [
        b"W\x5b\0\0\0\0\0\0\0",
        b"W\0\0\0\0\xb5\0\0\0",
        b"W\0\x3c\0\0\0\0\0\0",
        b"W\0\0\x3c\0\0\0\0\0",
        b"W\x5a\0\1\0\0\0\0\0",
        b"W\0\0\0\2\0\0\0\0",
        b"W\0\0\0\0\0\0\0\2",
        b"W" + b"\xff" * 8,
    ],
}


@each("form, outcome, when, reply, reason", REFUSED)
def test_nexstar_surface_refuses_or_stays_silent_where_the_manual_says_so(
    form: str, outcome: str, when: str, reply: str, reason: str
) -> None:
    mount = Mount()
    talk = talk_to("6-8se", mount)
    if form.startswith("\\x"):
        with_it = b"" if raw(form) not in (b"?", b"#", b"\r", b"\n", b"\0", b" ") else b"z#"
        assert talk.send(raw(form)) == b""
        talk.now += 0.11
        assert talk.send(raw(form) + b"Kz" + raw(form)) == with_it
        talk.now += 0.11
        assert talk.send(b"Kz") == b"z#"
        assert mount.asked == []
    elif form.startswith("P "):
        _, device, command = form.split()
        for model in ("6-8se", "cge", "cpc", "cgx"):
            if "not" in when and any(part in NEXSTAR.models[model]["has"] for part in ("gps", "rtc")):
                continue
            talk = talk_to(model, mount)
            for count in (1, 2, 3, 4):
                for asked in (0, 1, 2, 3, 35):
                    frame = bytes((80, count, int(device), int(command), 1, 2, 3, asked))
                    assert talk.send(frame) == absent(asked)
                    assert mount.asked == []
    elif when.startswith("the Meade has not answered"):
        mount.fault = NoAnswer()
        assert talk.send(form.encode()) == b""
    elif when.startswith("cut short"):
        for width in range(1, 18 if form == "r" else 10 if form == "R" else 8):
            assert talk.send((form.encode() + b"3555,2000,35552000")[:width]) == b""
            talk.now += 2
        assert talk.send(b"Kz") == b"z#"
        assert mount.asked == []
    elif when.startswith(("the Meade refuses", "farther than")):
        for fault in (BelowHorizon(), SyncTooFar()):
            mount.faults = dict.fromkeys((op.Goto, op.GotoHorizontal, op.GotoAxes, op.Sync), fault)
            field = b"3555,E000" if form.isupper() else b"35555500,E0000000"
            for model in ("6-8se", "cge"):
                assert talk_to(model, mount).send(form.encode() + field + b"L") == b"#0#"
    else:
        for frame in SENT[form, when.split()[0]]:
            assert talk.send(frame) in (b"", b"#"), "it is read as one command"
            assert all(isinstance(operation, op.Read) for operation in mount.asked), frame
            assert talk.send(b"Kz") == b"z#"


# --- every row on every model ---------------------------------------------------------------------------------------


def frames_of(name: str) -> list[bytes]:
    """A few requests of that form, with all the devices where one is named."""
    picture = NEXSTAR.commands[name].request
    frames = []
    for fill in (1, 35):
        values = dict.fromkeys(picture.fields, fill)
        for device in (16, 17, 18, 176, 178, 153) if "device" in values else (0,):
            if "device" in values:
                values["device"] = device
            frames.append(picture.encode(values))
    return frames


@each("model, version", SOME)
def test_nexstar_surface_answers_every_command_in_its_exact_length(model: str, version: str) -> None:
    talk = talk_to(model, version=version)
    for name in NEXSTAR.surface_rows:
        command = NEXSTAR.commands[name]
        for frame in frames_of(name):
            assert talk.binding.make_framer().feed(frame, talk.now) == [frame]
            if missing_command_text(talk.binding.model, frame):
                assert model in command.lacking_models or (command.first_version or (1, 2)) > (1, 2), (
                    "what every version has is read"
                )
                assert talk.send(frame) == b""
                continue
            reply = talk.send(frame)
            form = command.reply_form(talk.binding.model.get("dialect"))
            assert form is not None
            width = form.length
            if (name, version) == ("t", "starsense-1.20"):
                assert reply[1:] == b"\x01\x14#"  # it tells its version as well
                continue
            forms = {width, frame[7] + 2} if frame[:1] == b"P" else {width}
            assert len(reply) in forms, (name, frame, reply)
            assert reply[-1:] == b"#", (name, frame)
            if frame[:1] == b"P" and len(reply) != width:
                assert reply == absent(frame[7])
            assert talk.send(b"Kz") == b"z#"


@pytest.mark.parametrize("model", ["6-8se", "cge", "cpc"])
@each("name", sorted(NEXSTAR.surface_rows))
def test_nexstar_surface_invents_no_value_when_the_mount_is_silent(model: str, name: str) -> None:
    mount = Mount()
    mount.fault = NoAnswer()
    talk = talk_to(model, mount, "5.31")
    for frame in frames_of(name):
        reply = talk.send(frame)
        if name in {"H", "I", "T"} and frame[1] == 35:
            assert reply == b"#", "there is no such time or mode, whatever the mount says"
        elif name in TELLING | ORDERS and not (name == "p" and model != "cge"):
            assert reply == b"", "an honest error is silence"
        else:
            assert reply.endswith(b"#")


@each("model", MODELS)
def test_nexstar_surface_tells_the_model_and_version_of_the_presented_mount(model: str) -> None:
    row = NEXSTAR.models[model]
    talk = talk_to(model)
    major, minor = parse_version(row["motors"])
    version, variant = (b"042705#", b"") if model.startswith("synscan") else (b"\x04\x15#", b"\x11#")
    assert talk.send(b"Vmv") == version + bytes((row["id"],)) + b"#" + variant
    for device in (16, 17):
        assert talk.send(bytes((80, 1, device, 254, 0, 0, 0, 2))) == bytes((major, minor)) + b"#"
    for device, part in ((176, "gps"), (178, "rtc")):
        reply = talk.send(bytes((80, 1, device, 254, 0, 0, 0, 2)))
        assert (reply != absent(2)) == (part in row["has"])
        assert len(reply) == (3 if part in row["has"] else 4)
    assert talk.mount.asked == []


def test_no_nexstar_version_has_a_minor_number_that_reads_as_a_terminator() -> None:
    for model, version in CASES:
        assert 35 not in parse(version).reported
        assert 35 not in parse_version(NEXSTAR.models[model]["motors"])


def test_nexstar_gt_101_acts_as_version_1_2_and_104_as_4_03() -> None:
    """By the manual one before 104.0 is to be treated as 1.2, and from then on as 4.03."""
    old, new = talk_to("gt", version="101.0"), talk_to("gt", version="104.0")
    assert old.send(b"V") == b"\x65\x00#"
    assert new.send(b"V") == b"\x68\x00#"
    assert old.send(b"?emtw") == b""
    assert len(old.send(b"E")) == 10
    assert len(new.send(b"e")) == 18
    assert new.send(b"s35555500,20000000plKz") == b"z#"
