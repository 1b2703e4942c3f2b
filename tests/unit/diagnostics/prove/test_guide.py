"""Who is led through the check may do anything: no limit is passed, nothing moves after a stop, all is as before."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from gateway.core import operations as op
from gateway.core import requests
from gateway.diagnostics.prove import small_motions
from gateway.diagnostics.prove.findings import DIFFERS, NOT_TRIED, SAME, Findings, load, save
from gateway.diagnostics.prove.guide import STAGES
from gateway.protocols.wireformat.command_set import load as commands
from tests.support.proven import Onlooker, Proven, run_calm
from tests.support.sampling import as_a_rule

#: Seconds in which a motor has come to rest after a stop, and for which it is watched then.
RESTS, WATCHED = 6.0, 10.0
#: Seconds for which the cable is out.
CABLE = 6.0
#: What changes an alignment, a setting or a parked state, typed from the manuals.
FORBIDDEN = {
    "nexstar": (b"s", b"S", b"W", b"H", b"I", b"x", b"y", b"b", b"B", b"P\x02\x10\x46", b"P\x02\x11\x46"),
    "lx200": (b":CM", b":CL", b":St", b":Sg", b":SG", b":SL", b":SC", b":hP", b":hN", b":hS", b":hF", b":A", b":W"),
}
SOME = ["lx200:lx200gps", "nexstar:cgem"]
MODELS = as_a_rule(
    ["nexstar:6-8se", "lx200:lx200gps"],
    whole=[f"{protocol}:{model}" for protocol in FORBIDDEN for model in commands(protocol).models],
)


def left_alone(proven: Proven) -> None:
    """Nothing forbidden was sent, and by truth the tube was never below the horizon."""
    wrong = [sent for sent in proven.sent() if sent.startswith(FORBIDDEN[proven.gateway.mount.protocol])]
    assert not wrong
    assert min(truth.altitude for truth in proven.truths) > -0.1


async def rests(proven: Proven, soon: float = RESTS) -> None:
    """By truth nothing moves after so many seconds, but for tracking."""
    await asyncio.sleep(soon)
    before = len(proven.truths)
    await asyncio.sleep(WATCHED)
    assert not any(truth.moving for truth in proven.truths[before:])


@pytest.mark.parametrize("mount", MODELS)
def test_a_true_mount_raises_no_alarm_and_is_left_as_it_was(mount: str) -> None:
    async def whole() -> None:
        async with Proven(mount, every=5.0) as proven:
            tracked = proven.sim.tracking
            with patch.object(small_motions, "KEYS", as_a_rule((9, 6, 1), whole=small_motions.KEYS)):
                findings = await proven.check(Onlooker())
            assert [one.line for one in findings.of(DIFFERS)] == []
            assert findings.stages.keys() >= {"reads", "sky", "motions", "goto"} or findings.model == "unknown"
            await rests(proven)
            assert proven.sim.tracking == tracked
            left_alone(proven)

    run_calm(whole())


#: Words at which something happens, by stage; the answers that lead there; and whether it moves then.
MOMENTS = {
    "reads": ("tracking", ""),
    "sky": ("altitude and azimuth", "s"),
    "a small motion": ("rate 9 north/south", "ss"),
    "a goto": ("goto of 5°", "sss"),
    "a goto back": ("goto back", "sss"),
    "a cancelled goto": ("goto, cancelled on the way", "sss"),
}


def _played(
    mount: str, moment: str, act: Callable[[Proven], Any], later: float = 1.0, **settings: Any
) -> tuple[Findings, list[str], bool]:
    """Let something happen a second after a moment; return the findings, what was said, and whether it still tracks."""
    words, answers = MOMENTS[moment]

    async def play() -> tuple[Findings, list[str], bool]:
        async with Proven(mount, **settings) as proven:
            tracked = proven.sim.tracking

            def soon() -> None:
                asyncio.get_running_loop().call_later(later, act, proven)

            person = Onlooker(answers + "yq", {words: soon})
            proven.person = person  # type: ignore[attr-defined]
            with patch.object(small_motions, "KEYS", (9,)):  # so that its moment comes soon
                findings = await proven.check(person)
            await rests(proven, RESTS + CABLE * (act is _pull))
            left_alone(proven)
            return findings, person.said, proven.sim.tracking == tracked

    result: tuple[Findings, list[str], bool] = run_calm(play())
    return result


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("mount", as_a_rule(["nexstar:6-8se"], whole=["nexstar:6-8se", *SOME]))
def test_the_space_bar_stops_everything_and_tracking_is_as_before(mount: str, moment: str) -> None:
    later = 0.1 if moment in ("reads", "sky") else 1.2
    _, said, tracks = _played(mount, moment, lambda proven: proven.person.stop.set(), later)  # type: ignore[attr-defined]
    assert "STOPPED." in said
    assert tracks


def test_a_space_that_comes_between_two_questions_stops_the_mount_too() -> None:
    """Pressed while a stage ends, as the mount is asked what it does."""

    async def play() -> None:
        async with Proven() as proven:
            person = Onlooker("sq")
            person._when["1/"] = person.stop.set
            await proven.check(person)
            assert "STOPPED." in person.said
            left_alone(proven)

    run_calm(play())


def _pull(proven: Proven) -> None:
    proven.owner.cable.pull()
    asyncio.get_running_loop().call_later(CABLE, setattr, proven.owner.cable, "out", False)


def _program(proven: Proven) -> None:
    """Another program presses an arrow, and lets it go."""
    take, loop = proven.gateway.request_handler.take, asyncio.get_running_loop()
    number = requests.new_number()
    press = requests.Press(direction=op.Direction.WEST, key=6, number=number, who="192.168.1.7")
    loop.create_task(take(press))
    loop.call_later(3.0, lambda: loop.create_task(take(requests.LetGo(number=number))))


def _keys(proven: Proven) -> None:
    proven.owner.keys("back")
    asyncio.get_running_loop().call_later(3.0, proven.owner.keys, "first let go")


async def _page_stop(proven: Proven) -> None:
    await proven.controller.stop("the page")


EVENTS: dict[str, tuple[str, Callable[[Proven], Any], str]] = {
    "the cable is out": ("a small motion", _pull, "does not answer"),
    "another program moves it": ("a goto", _program, "another program moves the mount (192.168.1.7)"),
    "somebody stops it": (
        "a goto back", lambda proven: asyncio.ensure_future(_page_stop(proven)), "stopped by the page"),
    "the hand control is used": ("a small motion", _keys, "somebody used its keys"),
}  # fmt: skip


@pytest.mark.parametrize("event", EVENTS)
def test_what_others_do_ends_the_stage_and_nothing_is_moved_any_more(event: str) -> None:
    moment, act, why = EVENTS[event]
    findings, said, tracks = _played("nexstar:6-8se", moment, act)
    assert tracks
    assert any(line.startswith("This stage ends:") and why in line for line in said), said
    assert not findings.stages


def test_a_mount_that_may_not_move_is_left_alone() -> None:
    async def play() -> None:
        async with Proven(aligned=False) as proven:
            with patch.object(small_motions, "KEYS", (9,)):
                findings = await proven.check(Onlooker("sss"))
            [goto] = findings.stages["goto"]
            assert goto.verdict == NOT_TRIED and "align" in goto.measured.lower()
        async with Proven() as held:
            held.controller.hold.on = True
            person = Onlooker("ss")
            await held.check(person)
            assert sum("it is held" in line for line in person.said) == 4
            await rests(held)

    run_calm(play())


@pytest.mark.parametrize("where", ["near a limit", "near the Sun"])
def test_limits_and_the_sun_are_kept(where: str) -> None:
    """The mount points at 45° of altitude in the south; at noon the Sun is there, too."""
    noon = 1768514400.0 + 13.3 * 3600.0
    settings: dict[str, Any] = {"config": {"lowest": 40.0, "highest": 50.0}}
    if where == "near the Sun":
        settings = {"start": noon, "site": (24.0, 10.0)}

    async def play() -> None:
        async with Proven(**settings) as proven:
            begins = proven.truths[0] if proven.truths else None
            person = Onlooker("ss")
            with patch.object(small_motions, "KEYS", (9, 7)):
                await proven.check(person)
            await rests(proven)
            left_alone(proven)
            if where == "near a limit":
                assert all(39.0 < truth.altitude < 51.0 for truth in proven.truths)
            else:
                nearest = min(truth.sun_distance for truth in proven.truths)
                first = begins.sun_distance if begins is not None else proven.truths[0].sun_distance
                assert nearest > min(first, 40.0) - 0.2, (first, nearest)

    run_calm(play())


def test_another_session_goes_on_where_this_one_ended(tmp_path: Path) -> None:
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
            other = Onlooker("q")
            await proven.check(other)
            assert not any("done before" in line for line in other.said)

    run_calm(play())


def test_every_stage_says_what_comes_in_one_sentence() -> None:
    for stage in STAGES:
        assert stage.will.endswith(".") and len(stage.will) <= 60
    assert [stage.name for stage in STAGES if stage.moves] == ["place", "motions", "goto", "guiding", "program"]


def test_findings_of_other_files_are_none(tmp_path: Path) -> None:
    (tmp_path / "findings.json").write_text("no findings")
    assert load(tmp_path / "findings.json") == Findings()
    assert SAME == "same"
