"""Controllers of other makers that speak LX200: found, driven in their own words, and told what they do not take.

Byte by byte they are judged in ``tests/conformance/test_dialects.py``.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.app.config.endpoints import parse_device
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Busy, Fault, NoTarget, Refused, TooHigh, UserError
from gateway.diagnostics.virtual_time import run
from gateway.mount.policy import Limits
from gateway.protocols.base.driver import Send
from gateway.protocols.base.spec import SurfaceSettings
from gateway.protocols.lx200.reply_rules import Lx200ReplyRules
from gateway.protocols.registry import PROTOCOLS
from tests.support.each import each
from tests.support.evening import MODELS, SYNSCANS, evening, off
from tests.support.in_process_gateway import Bridge
from tests.support.simulated_meade import overhead
from tests.support.typed_programs import FACES

NAMES = {"onstep": "On-Step", "teenastro": "TeenAstro"}


def bridge(model: str, **more: Any) -> Bridge:
    config = {"site_time": "always", "lowest": -90.0, "sun": 0.0} | more.pop("config", {})
    return Bridge(model, driven="lx200", surface=None, latency=0.02, config=config, **more)


def answering(own: Bridge, replies: dict[bytes, bytes]) -> None:
    """Let the simulated mount give these replies to these commands, and do nothing."""
    usual = own.sim.answer
    own.sim.answer = lambda frame, later: replies[frame] if frame in replies else usual(frame, later)


#: Model -> what is refused -> to programs of these protocols. The motors of a SynScan have no pulses of their own.
REFUSED = {
    "synscan-az": {"pulses": ("nexstar",)},
    "onstep": {"its own limit": FACES},
    "teenastro": {"its own limit": FACES, "site": FACES},
}


@pytest.mark.parametrize("south", [False, True], ids=["north", "south"])
@pytest.mark.parametrize("model", [*SYNSCANS, *MODELS])
@pytest.mark.parametrize("face", FACES)
def test_observing_session_on_onstep_teenastro_or_synscan_has_no_wrong_result(
    model: str, face: str, south: bool
) -> None:
    found = run(evening(model, face, south))
    assert not {step: words for step, words in found.items() if words.startswith("wrong")}
    refused = {step for step, words in found.items() if words.startswith("refused: ")}
    expected = {step for step, faces in REFUSED.get(model, {}).items() if face in faces}
    assert refused == {step for step in expected if found[step] != "-"}


@pytest.mark.parametrize("model", MODELS)
def test_onstep_and_teenastro_are_detected_with_fewer_requests_than_a_meade(model: str) -> None:
    async def program(named: str) -> tuple[int, int]:
        async with bridge(named) as own:
            identity = await own.controller.answer(op.GetIdentity())
            assert identity.model == named
            assert identity.product == own.sim.facts["product"]
            client = own.client()
            await asyncio.sleep(10.0)
            ra = (own.sim.mechanics.sky.lst(own.clock()) + 60.0) % 360.0
            await own.controller.perform(op.Goto(ra, 10.0))
            before = len(own.sent_requests())
            for _ in range(10):  # a program that asks for all of it, once a second
                for question in (b":GR#", b":GD#", b":D#", b":GW#"):
                    await client.ask(question)
                await asyncio.sleep(1.0)
            sent = own.sent_requests()[before:]
            return len(sent), sum(map(len, sent))

    assert run(program(model))[0] <= run(program("autostar"))[0]


@each("model", MODELS)
def test_onstep_and_teenastro_are_sent_the_documented_bytes(model: str) -> None:
    assert parse_device(f"lx200:{model}").model == model
    assert parse_device("OnStepX").model == "onstep"
    with pytest.raises(UserError, match="cannot present"):
        PROTOCOLS["lx200"].make_surface(SurfaceSettings(model, None, None, None, Limits()))  # type: ignore[misc]


@pytest.mark.parametrize("model", MODELS)
async def test_unsuitable_meade_commands_do_not_reach_an_onstep_or_teenastro(model: str) -> None:
    async with bridge(model) as own:
        await own.controller.answer(op.GetIdentity())
        await asyncio.sleep(1.0)
        client = own.client()
        assert await client.ask(b":GVP#") == b"Autostar#"
        for said in (b":hS#", b":U#", b":GU#", b":Td#", b":F+#", b":B+#", b":$BA10#"):
            client.send(said)
        await asyncio.sleep(5.0)
        assert own.sim.tracking and not {b":hF#", b":hS#", b":U#", b":Td#", b":F+#"} & set(own.sent_requests())


@pytest.mark.parametrize(("model", "firmware"), [("onstep", "4.24s"), ("onstep", "3.16o"), ("teenastro", "1.6.2")])
async def test_position_is_read_precisely_from_a_mount_left_in_low_precision(model: str, firmware: str) -> None:
    """Another program of the evening has sent ``:U#``, before the gateway came and while it is there."""
    own = bridge(model)
    own.sim.facts = {**own.sim.facts, "firmware": firmware}
    assert own.sim.feed(b":U#") == b"" and len(own.sim.feed(b":GR#")) == len("12:34.5#")
    async with own:
        assert (await own.controller.answer(op.GetIdentity())).model == model
        for goal in (40.0, 60.0, 50.0):
            ra = round((own.sim.mechanics.sky.lst(own.clock()) + goal) * 240.0) / 240.0 % 360.0
            await own.controller.perform(op.Goto(ra, 20.5025))
            await asyncio.sleep(60.0)
            seen = await own.controller.read_now(op.Position())
            assert (
                off(own.sim.true_position(), (ra, 20.5025)) < 5.0
                and off((seen.ra, seen.dec), own.sim.true_position()) < 16.0
            )
            own.sim.feed(b":U#")
        assert b":U#" not in own.sent_requests()


REASONS: dict[str, dict[bytes, type[Fault]]] = {
    "onstep": {
        b"1": BelowHorizon, b"2": TooHigh, b"3": Refused, b"4": Refused, b"5": Busy, b"6": Refused, b"7": Refused,
        b"8": Busy, b"9": Refused,
    },
    "teenastro": {
        b"1": BelowHorizon, b"2": NoTarget, b"3": Refused, b"4": Refused, b"5": Busy, b"6": Refused, b"7": Busy,
        b"8": TooHigh, b"9": Refused, b";": Refused, b"<": Refused, b"=": Refused, b">": Refused, b"?": Refused,
        b"@": Refused, b"A": Refused,
    },
}  # fmt: skip


@each("model", MODELS)
def test_every_goto_refusal_of_onstep_and_teenastro_has_a_message(model: str) -> None:
    rules = Lx200ReplyRules(model)
    for said, fault in REASONS[model].items():
        outcome, length = rules.parse_reply(Send("MS"), said) or (None, 0)
        assert type(outcome) is fault and length == 1 and str(outcome), said
    assert rules.parse_reply(Send("MS"), b"0") == ({"length": 1}, 1)


@pytest.mark.parametrize("model", MODELS)
async def test_tracking_order_is_refused_when_the_mount_does_not_obey(model: str) -> None:
    async with bridge(model) as own:
        await own.controller.perform(op.SetTracking(on=False, heard=True))
        answering(own, {b":Te#": b"1"})
        with pytest.raises(Refused, match="did not turn tracking on"):
            await own.controller.perform(op.SetTracking(on=True, heard=True))
        answering(own, {b":Te#": b"0"})
        with pytest.raises(Refused, match="does not track: it is parked"):
            await own.controller.perform(op.SetTracking(on=True, heard=True))


@pytest.mark.parametrize("model", MODELS)
async def test_recent_change_at_the_keypad_is_read_before_an_order(model: str) -> None:
    """Within the time for which a reply about its state serves other questions."""
    async with bridge(model) as own:
        await own.controller.read_now(op.GetStatus())
        own.sim.feed(b":Td#")
        await asyncio.sleep(1.0)
        await own.controller.perform(op.SetTracking(on=True, heard=True))
        assert own.sim.tracking
        await own.controller.read_now(op.GetStatus())
        own.sim.feed(b":Td#")
        own.sim.parked = True
        await own.controller.perform(op.Unpark())
        assert own.sim.tracking


@pytest.mark.parametrize("model", MODELS)
def test_tracking_order_whose_effect_shows_late_is_not_refused(model: str) -> None:
    async def program() -> None:
        async with bridge(model) as own:
            await own.controller.perform(op.SetTracking(on=False, heard=True))
            usual, command = own.sim.answer, own.driver.status_command.encode()
            old, ordered = usual(b":" + command + b"#", False), list[float]()

            def late(frame: bytes, later: bool) -> bytes:
                ordered.extend([own.clock()] if frame == b":Te#" else [])
                reply: bytes = usual(frame, later)
                return old if command in frame and ordered and own.clock() - ordered[0] < 0.3 else reply

            own.sim.answer = late
            await own.controller.perform(op.SetTracking(on=True, heard=True))
            assert own.sim.tracking and 0.3 < own.clock() - ordered[0] < 1.0

    run(program())


@pytest.mark.parametrize("model", MODELS)
async def test_refused_time_zone_is_replaced_and_utc_stays_exact(model: str) -> None:
    """A TeenAstro's own is +13.5, which it refuses."""
    async with bridge(model, site=(-36.8, 174.8)) as own:
        await own.controller.perform(op.SetClock(own.clock() + 90.0, 13.5))
        await asyncio.sleep(10.0)
        assert abs(own.sim.utc() - own.sim.now - 90.0) < 3.0
        assert not [entry.note for entry in own.entries if "not in force" in (entry.note or "")]


async def test_clock_refused_by_the_mount_is_reported() -> None:
    async with bridge("onstep") as own:
        await own.controller.answer(op.GetClock())
        answering(own, {b":SC01/25/26#": b"1"})
        await own.controller.perform(op.SetClock(own.clock() + 10 * 86400.0, 0.0))
        await asyncio.sleep(10.0)
        assert any("did not take the time" in (one.note or "") for one in own.entries)


@pytest.mark.parametrize("south", [False, True])
@pytest.mark.parametrize("model", MODELS)
async def test_pier_side_is_taken_from_the_mounts_report(model: str, south: bool) -> None:
    """In German hand controls' letters: W if the second axis reads beyond the pole."""
    async with bridge(model, site=(-45.0, 10.0) if south else (45.0, 10.0)) as own:
        for east in (-40.0, 40.0):
            ra = (own.sim.mechanics.sky.lst(own.clock()) + east) % 360.0
            await own.controller.perform(op.Goto(ra, 0.0))
            await asyncio.sleep(90.0)
            beyond = own.sim.mechanics.axes(own.sim.now)[1] % 360.0 > 90.0
            flipped = own.sim.mechanics.flipped
            assert await own.controller.read_now(op.PierSide()) == ("W" if flipped else "E"), (east, beyond)


async def test_guide_pulse_ignores_the_faster_keypad_speed() -> None:
    """Where pulses have the rate of the arrows, :RS# would make a slew of them."""
    async with bridge("onstep") as own:
        own.sim.has_pulse_rate = False
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        await own.controller.perform(op.Goto(ra, 20.0))
        await asyncio.sleep(90.0)
        own.sim.feed(b":R9#")  # at its own keypad
        await own.controller.read_now(op.GetStatus())
        for _ in range(2):
            before = own.sim.true_position()[1]
            await own.controller.perform(op.Pulse(op.Direction.NORTH, 1000))
            await asyncio.sleep(5.0)
            assert 10.0 < (own.sim.true_position()[1] - before) * 3600.0 < 20.0
            own.sim.feed(b":R9#")  # nobody asks for its state between two pulses
        await own.controller.perform(op.Move(op.Direction.NORTH, op.Rate(name="find")))
        with pytest.raises(Refused, match="guide pulse is dropped"):
            await own.controller.perform(op.Pulse(op.Direction.WEST, 1000))


@pytest.mark.parametrize("keys", [6, 1, 9])
@pytest.mark.parametrize("separate", [True, False])
async def test_keypad_has_its_previous_speed_again_after_guide_pulses(keys: int, separate: bool) -> None:
    """The one that it told before the first pulse, or that somebody has chosen at the keypad meanwhile."""
    async with bridge("onstep") as own:
        own.sim.has_pulse_rate = separate
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        await own.controller.perform(op.Goto(ra, 20.0))
        await asyncio.sleep(60.0)
        for chosen in (keys, 7):
            own.sim.feed(b":R%d#" % chosen)
            await own.controller.read_now(op.GetStatus())
            for direction in (op.Direction.NORTH, op.Direction.WEST, op.Direction.NORTH):
                await own.controller.perform(op.Pulse(direction, 1500))
                await asyncio.sleep(0.7)
                assert own.sim.rate_number == 2
            await asyncio.sleep(5.0)
            assert own.sim.rate_number == chosen
        await own.controller.perform(op.Pulse(op.Direction.NORTH, 1000))
        own.sim.feed(b":R5#")
        await own.controller.read_now(op.GetStatus())
        await asyncio.sleep(5.0)
        assert own.sim.rate_number == 5


async def test_stop_does_not_wait_for_the_keypad_speed_to_be_restored() -> None:
    """The speed is put back when all stands still, and not during an arrow that follows the pulse."""
    async with bridge("onstep") as own:
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        await own.controller.perform(op.Goto(ra, 20.0))
        await asyncio.sleep(60.0)
        await own.controller.perform(op.Pulse(op.Direction.NORTH, 500))
        await asyncio.sleep(0.8)
        await own.controller.perform(op.Move(op.Direction.NORTH, op.Rate(key=7)))
        await asyncio.sleep(5.0)
        assert own.sim.rate_number == 7 and own.driver.moving
        began = own.clock()
        await own.controller.perform(op.StopAxis(2))
        assert own.clock() - began < 0.2 and b":R6#" not in own.sent_requests()
        await asyncio.sleep(3.0)
        assert own.sim.rate_number == 6


@each("firmware", ["10.28g", "4.24s", "3.16o", "2.22b"])
async def test_fastest_arrow_is_as_fast_as_a_goto(firmware: str) -> None:
    """Every version tells that speed, 4 degrees a second here; the second fastest is half of it."""
    own = bridge("onstep")
    own.sim.facts = {**own.sim.facts, "firmware": firmware}
    async with own:
        await own.controller.answer(op.GetIdentity())
        assert own.driver.speed(op.Rate(name="max")) == pytest.approx(4.0, rel=0.01)
        assert own.driver.speed(op.Rate(key=8)) == pytest.approx(2.0, rel=0.01)


async def test_onstep_waiting_for_its_clock_refuses_gotos_until_the_clock_is_set() -> None:
    async with bridge("onstep", aligned=False, config={"site_time": "never"}) as own:
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        with pytest.raises(Refused, match="standby: it waits for its date and time"):
            await own.controller.perform(op.Goto(ra, 20.0))
        own.sim.feed(b":SL22:00:00#:SC01/15/26#")
        await own.controller.perform(op.Goto(ra, 20.0))


async def test_long_onstep_arrow_is_pressed_again_and_ends_at_its_release() -> None:
    """OnStep ends it after 10 s; the gateway looks at 9.5 and 11.5 s: the release falls before, between and after."""
    async with bridge("onstep") as own:
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        for late in (9.4, 9.52, 9.54, 10.5, 11.48, 11.5, 11.52, 11.56, 11.6):
            await own.controller.perform(op.Goto(ra, 0.0))
            await asyncio.sleep(60.0)
            await own.controller.perform(op.Move(op.Direction.NORTH, op.Rate(name="find")))
            await asyncio.sleep(late)
            await own.controller.perform(op.StopAxis(2) if late < 11.0 else op.AbortMotion())
            await asyncio.sleep(3.0)
            stood = own.sim.true_position()[1]
            await asyncio.sleep(4.0)
            assert abs(own.sim.true_position()[1] - stood) < 0.01, late


@pytest.mark.parametrize("after", [3.0, 8.0, 10.0])
@pytest.mark.parametrize("error", [b"0", b"1"])
async def test_arrow_ended_by_the_mount_or_its_keypad_is_not_pressed_again(after: float, error: bytes) -> None:
    """Its keypad, or a limit of its own, which ends a motion once and tells its number: only its clock is overruled."""
    async with bridge("onstep") as own:
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        await own.controller.perform(op.Goto(ra, 0.0))
        await asyncio.sleep(60.0)
        await own.controller.perform(op.Move(op.Direction.NORTH, op.Rate(key=6)))
        await asyncio.sleep(after)
        own.sim.error = int(error)
        own.sim.feed(b":Q#")
        await asyncio.sleep(10.0)
        pressed = own.sent_requests().count(b":Mn#") == 2
        assert pressed is (after == 10.0 and error == b"0")  # that is what its own clock looks like
        assert any("ended the arrow" in (one.note or "") for one in own.entries) is not pressed
        assert pressed or not own.driver.moving


@pytest.mark.parametrize("released", [True, False])
async def test_lost_status_reply_delays_an_arrow_release_by_less_than_a_second(released: bool) -> None:
    """And if nobody has released it, it is looked at again: it goes on beyond the 10 s of OnStep's clock."""
    async with bridge("onstep") as own:
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        await own.controller.perform(op.Goto(ra, -20.0))
        await asyncio.sleep(60.0)
        usual, lost = own.sim.answer, list[float]()
        own.sim.answer = lambda frame, later: (
            lost.append(own.clock()) or b"" if frame == b":GU#" and not lost else usual(frame, later)
        )
        await own.controller.perform(op.Move(op.Direction.NORTH, op.Rate(key=6)))
        while not lost:
            await asyncio.sleep(0.01)
        if released:
            await asyncio.sleep(0.1)
            await own.controller.perform(op.StopAxis(2))
            assert b":Qn#" in own.sent_requests() and own.clock() - lost[0] < 1.0
        else:
            await asyncio.sleep(15.0)
            assert own.sent_requests().count(b":Mn#") == 2 and own.driver.moving


@pytest.mark.parametrize("arrives", [True, False])
async def test_search_for_home_by_switches_ends_when_the_status_letters_say_so(arrives: bool) -> None:
    """It is a motion by hand to OnStep: no bars, no goto. An order that it ignores is not told as done."""
    async with bridge("onstep") as own:
        usual = own.sim.status_letters
        own.sim.status_letters = lambda: usual().replace(b"p", b"Np").replace(b"NN", b"N")
        answering(own, {b":D#": b"#"} if arrives else {b":hC#": b"", b":D#": b"#"})
        await own.controller.perform(op.Goto((own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0, 0.0))
        await asyncio.sleep(60.0)
        await own.controller.perform(op.Home())
        await asyncio.sleep(5.0)
        assert (await own.controller.read_now(op.HomeState()) == 2) is arrives
        assert bool(await own.controller.read_now(op.Slewing())) is arrives is own.sim.homing
        await asyncio.sleep(90.0)
        assert await own.controller.read_now(op.HomeState()) == int(arrives)
        assert any("is not at its home" in (one.note or "") for one in own.entries) is not arrives


@pytest.mark.parametrize("model", MODELS)
async def test_mount_keeps_its_identity_after_lost_status_replies(model: str) -> None:
    own = bridge(model)
    own.sim.feed(b":Td#")
    usual, lost = own.sim.answer, [own.driver.protocol.in_dialect_of(model).dialect_rows.facts["status"]["command"]] * 2
    own.sim.answer = lambda frame, later: (
        b"" if lost and frame == f":{lost[0]}#".encode() and lost.pop() else usual(frame, later)
    )
    async with own:
        await own.controller.answer(op.GetIdentity())
        status = await own.controller.read_now(op.GetStatus())
        assert own.driver.german and status.tracking is op.Tracking.OFF and not lost


async def test_onstep_mistaken_for_a_meade_is_not_sent_the_home_search_command() -> None:
    """It answers ``:h?#`` with a bare 0 and is taken for a 16 inch, whose search for home is ``:hF#``."""
    own = bridge("onstep")
    own._hands_on = True  # :h?# is no form of an OnStep's
    usual, lost = own.sim.answer, [b":GVP#"] * 2
    own.sim.answer = lambda frame, later: b"" if lost and frame == lost[0] and lost.pop() else usual(frame, later)
    async with own:
        assert (await own.controller.answer(op.GetIdentity())).model == "lx200-16"
        with pytest.raises(Refused, match="reported its name only now"):
            await own.controller.perform(op.Home())
        assert b":hF#" not in own.sent_requests()


@each("said", [b"0#", b"#", b"nNp#"])
async def test_truncated_status_reply_is_rejected(said: bytes) -> None:
    async with bridge("onstep") as own:
        answering(own, {b":GU#": said})
        with pytest.raises(Fault):
            await own.controller.read_now(op.GetStatus())


@pytest.mark.parametrize("model", [*MODELS, "autostar"])
async def test_abort_slew_ends_a_goto_from_the_keypad_but_no_arrow(model: str) -> None:
    """At its own keys or page. Of a goto that the gateway knows it is the same, as near the pole as it may be."""
    async with bridge(model) as own:
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        await own.controller.perform(op.Goto(ra, 20.0))
        await asyncio.sleep(90.0)
        own.sim.feed(b":Sd-10*00:00#:MS#")
        assert own.sim.slewing
        await own.controller.perform(op.AbortSlew())
        assert not own.sim.slewing and own.sent_requests().count(b":Q#") == 1
        await asyncio.sleep(5.0)
        await own.controller.perform(op.Move(op.Direction.NORTH, op.Rate(name="center")))
        await own.controller.perform(op.AbortSlew())
        assert own.sent_requests().count(b":Q#") == 1 and own.driver.moving


@each("model", MODELS)
async def test_goto_beside_the_pole_reports_slewing_while_an_axis_turns(model: str) -> None:
    async with bridge(model) as own:
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        await own.controller.perform(op.Goto(ra, 89.96))
        await asyncio.sleep(90.0)
        own.sim.mechanics.max_rate = 1.5
        await own.controller.perform(op.Goto((ra - 80.0) % 360.0, 89.96))
        await asyncio.sleep(40.0)
        assert own.sim.slewing and await own.controller.read_now(op.Slewing())


# --- unknown ones, and those that are pushed --------------------------------------------------------------------------


async def test_unknown_controller_is_driven_by_common_commands_and_lists_what_it_lacks() -> None:
    own = bridge("autostar")
    own.sim.facts = {**own.sim.facts, "product": "OpenAstroTracker"}
    answering(own, {b":GW#": b""})
    async with own:
        identity = await own.controller.answer(op.GetIdentity())
        assert (identity.product, identity.model) == ("OpenAstroTracker", "other")
        [said] = [one.note for one in own.entries if "the gateway does not know" in (one.note or "")]
        assert "'OpenAstroTracker'" in said and "it did not report whether it tracks" in said
        ra, dec = own.sim.true_position()
        await own.controller.perform(op.Goto(ra, dec - 20.0))
        await asyncio.sleep(60.0)
        assert abs(own.sim.true_position()[1] - dec + 20.0) < 0.1
        for order in (op.SetTracking(on=False), op.SetTracking(on=True), op.Park(), op.Home()):
            with pytest.raises(Fault):
                await own.controller.perform(order)
        assert not {b":AP#", b":AL#", b":AA#", b":hF#", b":hP#"} & set(own.sent_requests())


async def test_refusals_of_an_unknown_controller_are_reported_as_refusals() -> None:
    """Those of a goto by their forms, that of a sync by the position: each maker has words of its own for it."""
    own = bridge("autostar")
    own.sim.facts = {**own.sim.facts, "product": "OpenAstroTracker"}
    replies: dict[bytes, bytes] = {}
    answering(own, replies)
    async with own:
        ra, dec = own.sim.true_position()
        for said in (b"5", b"e5#", b"1Below.#", b"1", b"2"):
            replies[b":MS#"], began = said, own.clock()
            with pytest.raises((Refused, BelowHorizon, TooHigh)):
                await own.controller.perform(op.Goto(ra, dec - 20.0))
            assert own.clock() - began < 2.0, said
        for said in (b"No object!#", b"e9#", b"Match fail: dist. too large#", b"E6#"):
            replies[b":CM#"] = said
            with pytest.raises(Refused, match="did not take the sync"):
                await own.controller.perform(op.Sync(ra, dec - 2.0))
        del replies[b":CM#"]
        await own.controller.perform(op.Sync(ra, dec - 2.0))
        replies |= {b":MS#": b"1", b":D#": b"|#"}  # on a few a 1 is a yes: it slews
        await own.controller.perform(op.Goto(ra, dec - 2.0))
        assert own.driver.goto is not None


@each("told", [b"1", b"1Updating        Planetary Data#                                #"])
async def test_site_and_date_reach_an_unknown_controller(told: bytes) -> None:
    """A longitude without a sign is another one to some, and many have no text after the 1 for a date."""
    own = bridge("autostar")
    own.sim.facts = {**own.sim.facts, "product": "OpenAstroTracker"}
    own._hands_on = True  # a sign is no form of a Meade's
    answering(own, {b":Sg-010*30#": b"1", b":Gg#": b"-010*30#", b":SC02/14/26#": told, b":GC#": b"02/14/26#"})
    async with own:
        await own.controller.answer(op.GetIdentity())
        await own.controller.perform(op.SetSite(45.0, 10.5))
        await own.controller.perform(op.SetClock(own.clock() + 30 * 86400.0, 0.0))
        while not any(frame.startswith(b":SC") for frame in own.sent_requests()):
            await asyncio.sleep(0.1)
        await asyncio.sleep(1.0)
        began = own.clock()
        await own.controller.read_now(op.Position())
        assert (
            own.clock() - began < 1.0
            and b":Sg-010*30#" in own.sent_requests()
            and b":SC02/14/26#" in own.sent_requests()
        )


async def test_old_teenastro_is_driven_as_an_unknown_controller() -> None:
    """Before 1.5.1 it answers neither ACK nor ``:GW#``, and ``:Gm#`` with one hash."""
    own = bridge("teenastro")
    own.sim.facts = {**own.sim.facts, "firmware": "1.4.19"}
    answering(own, {b"\x06": b"", b":GW#": b"0", b":Gm#": b"E#"})
    async with own:
        identity = await own.controller.answer(op.GetIdentity())
        assert (identity.product, identity.version, identity.model) == ("TeenAstro", "1.4.19", "other")
        assert any("does not report its state" in (one.note or "") for one in own.entries)
        ra = (own.sim.mechanics.sky.lst(own.clock()) + 40.0) % 360.0
        await own.controller.perform(op.Goto(ra, 20.0))
        await asyncio.sleep(60.0)
        assert off(own.sim.true_position(), (ra, 20.0)) < 16.0
        assert not {b":Te#", b":Td#", b":Gm#", b":AP#", b":AL#"} & set(own.sent_requests())


async def test_old_teenastro_left_in_low_precision_is_detected() -> None:
    """It has no question that is answered in high precision at all times: as one that is not known, it is switched."""
    own = bridge("teenastro")
    own._hands_on = True  # :U# is no form of a TeenAstro's
    own.sim.feed(b":U#")
    answering(own, {b"\x06": b"", b":GW#": b"0", b":GRL#": b"#", b":GDL#": b"#"})
    async with own:
        assert (await own.controller.answer(op.GetIdentity())).model == "other"
        seen = await own.controller.read_now(op.Position())
        assert off((seen.ra, seen.dec), own.sim.true_position()) < 16.0 and own.sent_requests().count(b":U#") == 1


async def test_meade_of_any_name_is_driven_as_a_meade() -> None:
    own = bridge("autostar")
    own.sim.facts = {**own.sim.facts, "product": "ETX Autostar"}
    async with own:
        assert (await own.controller.answer(op.GetIdentity())).model == "autostar"


@each("slews", [True, False])
async def test_slewing_mount_is_not_taken_for_a_push_to_telescope_at_the_start(slews: bool) -> None:
    """In declination only; in the last seconds of a goto neither coordinate changes, and empty bars tell it later."""
    own = bridge("autostar")
    own.sim.facts, began = {**own.sim.facts, "product": "Clone"}, own.clock()
    replies = {b":D#": b"|#"} | ({b":GR#": b"06:00:00#"} if slews else {})
    answering(own, replies)
    usual = own.sim.answer
    own.sim.answer = lambda frame, later: (
        f"+10*{int(10 * (own.clock() - began)) // 60:02}:{int(10 * (own.clock() - began)) % 60:02}#".encode()
        if slews and frame == b":GD#"
        else usual(frame, later)
    )
    async with own:
        await own.controller.answer(op.GetIdentity())
        assert own.driver.pushed_by_hand is not slews
        replies.clear()
        await asyncio.sleep(60.0)
        assert not own.driver.pushed_by_hand
        ra, dec = own.sim.true_position()
        await own.controller.perform(op.Goto(ra, dec - 5.0))


@pytest.mark.parametrize("product", ["PiFinder", "MyPushTo"])
async def test_push_to_telescope_is_recognised_and_never_reports_slewing(product: str) -> None:
    """Its bars are always there, and its position is that of the hand: never slewing for ever."""
    own = bridge("autostar")
    own.sim.facts = {**own.sim.facts, "product": product}
    answering(own, {b":D#": b"|#", b":MS#": b"0", b":GW#": b"AT1", b":Q#": b""})
    async with own:
        await own.controller.answer(op.GetIdentity())
        target = overhead(own.sim)
        client = own.client()
        assert any("push it by hand" in (one.note or "") for one in own.entries)
        assert not await own.controller.answer(op.Slewing())
        assert b"push it by hand" in await client.ask(target + b":MS#", 20.0, ending=b"#")
        assert len(await client.ask(b":GR#")) == len("12:34:56#") and await client.ask(b":D#") == b"#"
        able = (await own.controller.answer(op.GetAbilities())).can
        assert not {"Goto", "Move", "Sync", "Park", "Pulse"} & able and "Position" in able
