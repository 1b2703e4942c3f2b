"""Who is led through the check may do anything: no limit is passed, nothing moves after a stop, all is as before."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from gateway.core import operations as op
from gateway.core import requests
from gateway.core.errors import UserError
from gateway.diagnostics.prove import small_motions
from gateway.diagnostics.prove.findings import DIFFERS, SAME, Finding, Findings, load, save
from gateway.diagnostics.prove.guide import STAGES, GuidedCheck
from gateway.diagnostics.prove.telescope import CLIENT, CheckedMount
from tests.support.prove_setup import Onlooker, Proven, run_calm
from tests.support.sampling import as_a_rule
from tests.support.true_mounts import CHECKS, SLEWS, alarms, point
from tests.support.true_mounts import MOUNTS as TRUE

#: Seconds in which a motor has come to rest after a stop, and for which it is watched then.
RESTS, WATCHED = 6.0, 10.0
#: Seconds for which the cable is out, or somebody else moves the mount and what follows from that.
OTHERS = {"the cable is out": 6.0, "another program moves it": 3.0, "the hand control is used": 3.0}
#: What changes an alignment, a setting or a parked state, typed from the manuals.
FORBIDDEN = {
    "nexstar": (b"s", b"S", b"W", b"H", b"I", b"x", b"y", b"b", b"B", b"P\x02\x10\x46", b"P\x02\x11\x46"),
    "lx200": (b":CM", b":CL", b":St", b":Sg", b":SG", b":SL", b":SC", b":hP", b":hN", b":hS", b":hF", b":AP", b":W"),
    "alpaca": (b"synctocoordinates", b"park", b"unpark", b"setpark", b"utcdate ", b"sitelatitude ", b"sitelongitude "),
}
#: What a simulated mount keeps until somebody sets it: the settings, the site, the clock and the rates.
KEPT = ("sites", "site", "zone", "daylight", "offset", "ahead", "rtc_ahead", "aligned", "mode", "parked",
        "asleep", "high", "guides", "drive_rate", "target_tracking")  # fmt: skip
MOUNTS = as_a_rule(
    ["nexstar:6-8se"],
    whole=["nexstar:6-8se", "nexstar:cgem", "lx200:lx200gps", "lx200:lx200", "lx200:onstep", "alpaca:german"],
)


def kept(proven: Proven) -> dict[str, str]:
    """Return the mount's settings as it keeps them, whether it tracks, and how fast."""
    sim = proven.sim
    sim.advance_to_now()
    own = {name: repr(value) for name, value in vars(sim).items() if name in KEPT}
    own["settings"] = repr({name: value for name, value in getattr(sim, "settings", {}).items() if value})
    return own | {"tracks": repr(sim.tracking), "drives": repr(sim.mechanics._drive_rate)}


def left_alone(proven: Proven, before: dict[str, str], but: tuple[str, ...] = ()) -> None:
    """Nothing forbidden was sent, all is as it was, and by truth the tube was never below the horizon."""
    wrong = [sent for sent in proven.sent() if sent.startswith(FORBIDDEN[proven.gateway.mount.protocol])]
    assert not wrong
    changed = {name: value for name, value in kept(proven).items() if before[name] != value and name not in but}
    assert not changed
    assert "altitude" in but or min(truth.altitude for truth in proven.truths) > -0.1


async def rests(proven: Proven, soon: float = RESTS) -> None:
    """By truth nothing moves after so many seconds, but for tracking."""
    await asyncio.sleep(soon)
    before = len(proven.truths)
    await asyncio.sleep(WATCHED)
    assert not any(truth.moving for truth in proven.truths[before:])


@pytest.mark.parametrize("seed", range(as_a_rule(1, whole=CHECKS)))
@pytest.mark.parametrize("mount", as_a_rule(["nexstar:6-8se", "lx200:lx200gps", "alpaca:polar"], whole=TRUE))
def test_prove_reports_no_false_difference_and_restores_the_mount(mount: str, seed: int) -> None:
    assert alarms(mount, seed, (9, 6, 1)) == []


# --- a fool: every stage, everything that can happen in it ------------------------------------------------------------

#: By stage: the words at which something happens, seconds later, the answers that lead there, and the declination.
MOMENTS: dict[str, tuple[str, float, str, float]] = {
    "reads": ("tracking", 0.1, "", 20.0),
    "sky": ("altitude and azimuth", 0.05, "s", 20.0),
    "place": ("on its way to a better place", 1.2, "ss", -27.0),
    "a small motion": ("rate 9 north/south", 1.2, "ss", 20.0),
    "a goto": ("goto of 5°", 1.2, "sss", 20.0),
    "a goto back": ("goto back", 1.2, "sss", 20.0),
    "a cancelled goto": ("goto, cancelled on the way", 1.2, "sss", 20.0),
    "guiding": ("pulses south", 1.2, "ssss", 20.0),
}
#: The stages in which something of the check moves.
MOVE = list(MOMENTS)[2:8]


def _space(proven: Proven, person: Onlooker) -> None:
    person.stop.set()


def _ctrl_c(proven: Proven, person: Onlooker) -> None:
    """As ``serve_mounts`` does at a signal: Ctrl-C, SIGTERM, or SIGHUP of a terminal that is closed."""
    proven.session.cancel()


def _terminal_gone(proven: Proven, person: Onlooker) -> None:
    """Nothing can be written any more; the signal comes a little later."""

    def gone(*_: object) -> None:
        raise OSError(5, "Input/output error")

    person.say = person.show_progress = gone  # type: ignore[method-assign]
    proven.loop.call_later(1.0, proven.session.cancel)


def _pull(proven: Proven, person: Onlooker) -> None:
    proven.owner.cable.pull()
    proven.loop.call_later(OTHERS["the cable is out"], setattr, proven.owner.cable, "out", False)


def _program(proven: Proven, person: Onlooker) -> None:
    """Another program presses an arrow, and lets it go."""
    take, number = proven.gateway.carry_out, requests.new_request_number()
    press = requests.PressKeyRequest(direction=op.Direction.WEST, key=6, number=number, who="192.168.1.7")
    proven.loop.create_task(take(press))
    proven.loop.call_later(3.0, lambda: proven.loop.create_task(take(requests.ReleaseKeyRequest(number=number))))


def _keys(proven: Proven, person: Onlooker) -> None:
    """Somebody presses a key of the hand control, and lets it go."""
    if proven.gateway.mount.protocol == "alpaca":
        sim = proven.sim
        sim.mechanics.move(sim.now, 1, -1.0)
        proven.loop.call_later(3.0, lambda: sim.mechanics.resume_tracking(sim.clock()))
        return
    proven.owner.keys("back")
    proven.loop.call_later(3.0, proven.owner.keys, "first let go")


def _page_stop(proven: Proven, person: Onlooker) -> None:
    proven.loop.create_task(proven.controller.stop("the page"))


def _hold(proven: Proven, person: Onlooker) -> None:
    proven.controller.hold.is_on = True
    proven.loop.create_task(proven.controller.stop("mount-gateway stop"))


#: What happens, and what is said where the check moves the mount.
MISHAPS: dict[str, tuple[Callable[[Proven, Onlooker], None], str]] = {
    "space": (_space, "STOPPED."),
    "Ctrl-C": (_ctrl_c, ""),
    "the terminal is gone": (_terminal_gone, ""),
    "the cable is out": (_pull, "This stage ends: "),
    "the hand control is used": (_keys, "This stage ends: "),
    "another program moves it": (_program, "another program moves the mount (192.168.1.7)"),
    "STOP on the page": (_page_stop, "stopped by the page"),
    "hold": (_hold, "the mount was stopped"),
}


@pytest.mark.sampled(1)
@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("mishap", MISHAPS)
@pytest.mark.parametrize("mount", MOUNTS)
def test_prove_restores_everything_after_a_fault_and_moves_nothing_more(mount: str, mishap: str, moment: str) -> None:
    words, later, answers, dec = MOMENTS[moment]
    act, said = MISHAPS[mishap]

    async def play() -> None:
        async with Proven(mount, change=lambda proven: point(proven, -20.0, dec)) as proven:
            await asyncio.sleep(SLEWS)
            before, person, acted = kept(proven), Onlooker(answers + "yq"), list[float]()

            def happens() -> None:
                acted.append(proven.clock())
                act(proven, person)

            person.when[words] = lambda: proven.loop.call_later(later, happens)
            with patch.object(small_motions, "RATE_KEYS", (9,)):  # so that its moment comes soon
                proven.session = asyncio.ensure_future(proven.check(person))
                with suppress(asyncio.CancelledError, OSError):
                    await proven.session
            assert acted or moment not in MOVE, person.said
            if proven.session.cancelled():
                await proven.gateway.close()
            others = OTHERS.get(mishap, 0.0)
            await asyncio.sleep(others)
            await rests(proven)
            if mishap == "the hand control is used":  # some end a stage only when they show, at its next position
                acted.clear()
            late = [truth for truth in proven.truths if acted and truth.t > acted[0] + RESTS + others]
            assert not any(truth.moving for truth in late)
            left_alone(proven, before, ("tracks", "mode", "altitude") if mishap == "the hand control is used" else ())
            shows = mishap != "the hand control is used" or (moment == "a small motion" and "nexstar" in mount)
            if moment in MOVE and shows:
                assert any(said in line for line in person.said), person.said
                assert not proven.findings.is_complete(STAGES[len(answers)].name)

    run_calm(play())


#: What may be so from the beginning: the settings, and the altitudes within which the tube stays.
NOON = 1768514400.0 + 13.3 * 3600.0
CONDITIONS: dict[str, tuple[dict[str, Any], tuple[float, float], str]] = {
    "unaligned": ({"aligned": False}, (0.0, 90.0), "not now: it is not aligned"),
    "near a limit": ({"config": {"lowest": 40.0, "highest": 50.0}}, (39.0, 51.0), ""),
    "near the Sun": ({"start": NOON, "site": (24.0, 10.0)}, (0.0, 90.0), ""),  # both are at 45° in the south
    "held": ({}, (0.0, 90.0), "not now: it is held"),
}


@pytest.mark.parametrize("what", CONDITIONS)
@pytest.mark.parametrize("mount", MOUNTS)
def test_prove_obeys_altitude_limits_the_sun_limit_and_a_hold(mount: str, what: str) -> None:
    settings, (low, high), words = CONDITIONS[what]

    async def play() -> None:
        async with Proven(mount, **settings) as proven:
            proven.controller.hold.is_on = what == "held"
            before, person = kept(proven), Onlooker()
            with patch.object(small_motions, "RATE_KEYS", (9, 7)):
                await proven.check(person)
            await rests(proven)
            left_alone(proven, before)
            assert all(low < truth.altitude < high for truth in proven.truths)
            if what == "near the Sun":
                first = proven.truths[0].sun_distance
                assert min(truth.sun_distance for truth in proven.truths) > min(first, 40.0) - 0.2
            if what == "held" or (what == "unaligned" and "nexstar" in mount):  # the others do not tell that
                refused = [line for line in person.said if ": not now" in line]
                assert len(refused) >= 3 and sum(words in line for line in refused) == 1, person.said
                assert all(line.endswith((words, ": not now either.")) or words in line for line in refused)
                assert not any(truth.moving for truth in proven.truths)

    run_calm(play())


def test_prove_postpones_the_sky_comparison_on_an_unaligned_mount() -> None:
    async def play() -> None:
        async with Proven("nexstar:6-8se", aligned=False) as proven:
            found = await proven.check(person := Onlooker("yq"))
            assert any(line.startswith("2/6 sky: not now: it is not aligned") for line in person.said), person.said
            assert list(found.stages) == ["reads"] and len(person.asked) == 1

    run_calm(play())


def test_prove_moves_away_first_if_it_begins_near_the_sun() -> None:
    async def play() -> None:
        async with Proven("nexstar:6-8se", **CONDITIONS["near the Sun"][0]) as proven:
            before, person = kept(proven), Onlooker("ssyssssy")
            await proven.check(person)
            assert "same  goto to a better place" in person.said, person.said
            assert proven.truths[-1].sun_distance > 45.0
            left_alone(proven, before)

    run_calm(play())


def test_prove_names_a_limit_that_ends_tracking_and_changes_no_setting() -> None:
    async def play() -> None:
        async with Proven("lx200:lx200gps", **CONDITIONS["near the Sun"][0]) as proven:
            with patch.object(small_motions, "RATE_KEYS", (9, 7)):
                person = Onlooker("yssyssssy")
                person.when["rate 7 west"] = lambda: proven.controller.watch.carried_to_limit.emit("the Sun")
                found = await proven.check(person)
            assert not proven.sim.tracking
            assert any("switched off at the Sun" in one for one in person.said)
            assert not found.select("differs")

    run_calm(play())


def test_space_key_between_two_prove_questions_stops_the_mount() -> None:
    """Pressed while a stage ends, as the mount is asked what it does."""

    async def play() -> None:
        async with Proven() as proven:
            person = Onlooker("sq")
            person.when["1/"] = person.stop.set
            await proven.check(person)
            assert "STOPPED." in person.said

    run_calm(play())


def test_prove_session_continues_where_the_last_one_ended(tmp_path: Path) -> None:
    kept = tmp_path / "findings.json"
    assert load(kept) == Findings()

    async def play() -> None:
        async with Proven() as proven:
            person = Onlooker("yyq")
            findings = await proven.check(person)
            save(kept, findings)
            proven.findings = load(kept)
            assert proven.findings == findings and list(findings.stages) == ["reads", "sky"]
            again = Onlooker("q")
            await proven.check(again)
            assert len(again.asked) == 1 and sum("done before" in line for line in again.said) == 2
            proven.findings.mount = "another mount"
            with pytest.raises(UserError, match="holds what was found of another mount"):
                await proven.check(Onlooker("q"))

    run_calm(play())


@pytest.mark.parametrize("mount", ["lx200:onstep", "nexstar:6-8se"])
def test_prove_recognises_the_mount_though_the_version_reply_is_lost(mount: str) -> None:
    async def play(nth: int, findings: Findings) -> Findings:
        def lose(proven: Proven) -> None:
            write, count = proven.wire.write, iter(range(1, 10**6))
            proven.wire.write = lambda data: None if next(count) == nth else write(data)  # type: ignore[method-assign]

        async with Proven(mount, every=9.0, change=lose) as proven:
            proven.findings = findings
            return await proven.check(Onlooker("ssssssss"))

    for nth in as_a_rule((0, 9), whole=range(12)):  # 9 is :GVN#
        first: Findings = run_calm(play(nth, Findings()))
        first.stages["reads"] = [Finding("identity", SAME)]
        second: Findings = run_calm(play(9, first))
        third: Findings = run_calm(play(0, second))
        assert (third.mount, third.version) == (run_calm(play(0, Findings())).mount, third.version)
        assert "?" not in third.mount and third.stages.keys() == {"reads"}


def test_prove_resumes_stopped_motions_after_the_last_measured_rate(tmp_path: Path) -> None:
    measured, real = list[str](), small_motions._measure_rate

    async def counted(telescope: CheckedMount, what: str, *rate: Any) -> Finding:
        measured.append(what)
        return await real(telescope, what, *rate)

    async def play() -> None:
        async with Proven() as proven:
            person = Onlooker("ssyaq")  # after the first stop again at once, and then in another session
            person.when |= dict.fromkeys(("rate 9 west/east", "rate 9 north/south"), person.stop.set)
            stopped = await proven.check(person)
            assert sum("same  rate 6 west/east" in line for line in person.said) == 1
            assert any("continues after the last measurement" in line for line in person.said)
            save(tmp_path / "findings.json", stopped)
            proven.findings = load(tmp_path / "findings.json")
            assert not stopped.is_complete("motions") and proven.findings == stopped
            again = Onlooker("ssyssss")
            found = await proven.check(again)
            assert found.is_complete("motions") and not found.select("differs")
            assert [line[:10] for line in again.said if "continues after the last measurement" in line] == [
                "4/6 motion"
            ]
            verdicts = {one.what: one.verdict for one in found.stages["motions"]}
            assert verdicts["rate 6 west/east"] == verdicts["direction of west and east"] == SAME

    with patch.object(small_motions, "RATE_KEYS", (9, 6)), patch.object(small_motions, "_measure_rate", counted):
        run_calm(play())
    first, second = (["rate 9 west/east"] * 2, ["rate 9 north/south"] * 2)
    assert measured == ["rate 6 west/east", "rate 6 north/south", *first, *second]


def test_prove_stores_measurements_made_before_ctrl_c(tmp_path: Path) -> None:
    async def play() -> None:
        async with Proven() as proven:
            kept, person = tmp_path / "findings.json", Onlooker("ssy")
            guide = GuidedCheck(proven.gateway, person, Findings(), lambda found: save(kept, found))
            session = asyncio.ensure_future(guide.run())
            person.when["rate 9 north/south"] = lambda: proven.loop.call_later(1.0, session.cancel)
            with suppress(asyncio.CancelledError):
                await session
            assert session.cancelled()
            await rests(proven)
            proven.findings = load(kept)
            assert [one.what for one in proven.findings.stages["motions"]] == [
                "rate 9 west/east",
                "the rest of motions",
            ]
            with patch.object(small_motions, "_measure_rate", counted):
                found = await proven.check(Onlooker("ssyssss"))
            assert found.is_complete("motions") and measured == ["rate 9 north/south"]

    measured, real = list[str](), small_motions._measure_rate

    async def counted(telescope: CheckedMount, what: str, *rate: Any) -> Finding:
        measured.append(what)
        return await real(telescope, what, *rate)

    with patch.object(small_motions, "RATE_KEYS", (9,)):
        run_calm(play())


def test_prove_leaves_tracking_on_that_another_program_switched_on() -> None:
    async def play() -> None:
        async with Proven() as proven:
            take = proven.gateway.carry_out
            await take(requests.TrackRequest(on=False, who=CLIENT))
            person = Onlooker("ssyq")
            on = requests.TrackRequest(on=True, who="192.168.1.7")
            person.when["rate 9 north/south"] = lambda: proven.loop.create_task(take(on))
            with patch.object(small_motions, "RATE_KEYS", (9,)):
                await proven.check(person)
            await asyncio.sleep(5.0)
            assert proven.sim.tracking
            assert any("Its tracking was off, and is on" in one for one in person.said)

    run_calm(play())


def test_page_shows_that_a_prove_check_is_running() -> None:
    async def play() -> None:
        async with Proven() as proven:
            person, shown = Onlooker("ssyq"), list[str]()

            def look() -> None:
                state = proven.gateway.state().to_state()
                shown.extend((*state.wanted, *state.lately))

            person.when["rate 9 north/south"] = lambda: proven.loop.call_later(2.0, look)
            with patch.object(small_motions, "RATE_KEYS", (9,)):
                await proven.check(person)
            assert any("mount-gateway prove: checks this mount" in line for line in shown)
            assert any(line.endswith("by mount-gateway prove") for line in shown), shown

    run_calm(play())


def test_prove_reports_a_goto_that_ends_off_its_target() -> None:
    async def program() -> list[Finding]:
        async with Proven() as proven:
            mechanics = proven.sim.mechanics
            goto_sky = mechanics.goto_sky
            with patch.object(mechanics, "goto_sky", lambda now, ra, dec: goto_sky(now, ra, dec + 0.3)):
                findings = await proven.check(Onlooker("sssysss"))
            return [finding for finding in findings.stages["goto"] if finding.what == "goto of 5°"]

    [finding] = run_calm(program())
    assert finding.verdict == DIFFERS and "18.0' from its goal" in finding.measured


def test_every_prove_stage_is_announced_in_one_sentence() -> None:
    for stage in STAGES:
        assert stage.announcement.endswith(".") and len(stage.announcement) <= 60
    assert [stage.name for stage in STAGES if stage.moves_mount] == ["place", "motions", "goto", "guiding"]


def test_prove_treats_a_findings_file_that_is_not_json_as_empty(tmp_path: Path) -> None:
    (tmp_path / "findings.json").write_text("no findings")
    assert load(tmp_path / "findings.json") == Findings()
    assert SAME == "same"
