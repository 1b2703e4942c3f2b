"""Leads a person through the stages of ``prove``: asks before each, and stops the mount when the person presses space.

A stage that ends early keeps its findings; the rest is ``not tried``. The next session offers that stage again, and
continues after the last measured rate. At an early end the stage's motion is stopped. After each stage its findings are
saved, and tracking that the stage has turned on is turned off. If others stopped the mount, no command follows.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import NamedTuple, Protocol

from gateway.app.gateway import Gateway
from gateway.core import operations as op
from gateway.core import requests
from gateway.core.errors import Fault, UserError
from gateway.diagnostics.prove import gotos, guiding, reads, sky, small_motions
from gateway.diagnostics.prove.findings import DIFFERS, NOT_TRIED, Finding, Findings, StageReporter, untried_rest_title
from gateway.diagnostics.prove.telescope import CLIENT, CheckedMount, StageEnded, StoppedByOthers

#: The question after the person has stopped a stage with the space bar.
STOP_PROMPT = "y: next stage  a: this one again  q: leave"


class Stage(NamedTuple):
    """A stage of ``prove``. ``announcement`` describes it to the person. ``moves_mount``: whether it moves the mount,
    which must then be aligned. ``needs_alignment``: whether the mount must be aligned although it is not moved.

    ``run`` raises StageEnded. ``why_needed`` returns why the stage is necessary; empty if it is not.
    """

    name: str
    announcement: str
    moves_mount: bool
    run: Callable[[CheckedMount, StageReporter], Awaitable[None]]
    why_needed: Callable[[CheckedMount], str] = lambda telescope: "it belongs to every check"
    needs_alignment: bool = False


STAGES: tuple[Stage, ...] = (
    Stage("reads", "sends it every question of its protocol. Nothing moves.", False, reads.run),
    Stage("sky", "compares its site, its clock and the sky. Nothing moves.", False, sky.run, needs_alignment=True),
    Stage("place", "goes to a place with room for the motions.", True, gotos.go_to_roomy_position, gotos.why_no_room),
    Stage("motions", "moves it every way at every rate, up to 5°: about 5 min.", True, small_motions.run),
    Stage("goto", "goes 5° and back, stops a goto on its way: about 30 s.", True, gotos.run),
    Stage("guiding", "sends short pulses in all directions: about 1 min.", True, guiding.run),
)  # fmt: skip


class Person(Protocol):
    """The person at the terminal. ``ask_for_key`` asks a question, and returns the pressed key (a blank for space)."""

    stop: asyncio.Event  # set when the space bar is pressed

    def say(self, text: str) -> None: ...
    def show_progress(self, fraction: float, title: str) -> None: ...
    async def ask_for_key(self, question: str, keys: str) -> str: ...  # one of ``keys``, or a blank


class GuidedCheck:
    """One session of ``prove``. ``save`` is called with all findings after every stage."""

    def __init__(
        self,
        gateway: Gateway,
        person: Person,
        findings: Findings,
        save: Callable[[Findings], None],
        stages: tuple[Stage, ...] = STAGES,
    ) -> None:
        self._telescope, self._person, self._findings, self._save = CheckedMount(gateway), person, findings, save
        self._stages = stages
        self._stage_findings: list[Finding] = []
        self.old_findings: list[Finding] = []

    async def run(self) -> Findings:
        """Lead through all unfinished stages, as far as the person wants, and return the findings. Raises UserError if
        the saved findings belong to another mount.
        """
        person, telescope = self._person, self._telescope
        identity: op.Identity | None = telescope.controller.cache.last_value(op.GetIdentity)
        if identity is not None:
            mount, version = reads.name_and_version(identity, telescope.driver)
            findings = self._findings
            unknown = reads.UNKNOWN_VERSION in (version, findings.version)
            same = mount.removesuffix(version) == findings.mount.removesuffix(findings.version)
            if mount != findings.mount and not (same and unknown):
                if findings.stages:
                    raise UserError(f"the folder holds what was found of {findings.mount}; --folder names another one")
                self._findings = Findings(mount, identity.model, version)
            elif version != reads.UNKNOWN_VERSION:
                findings.mount, findings.version = mount, version
        person.say(f"Your mount: {self._findings.mount}. Space stops everything at any time.")
        telescope.begin_stage()
        try:
            await telescope.read_position()
            self._findings.equatorial = telescope.status.equatorial
        except StageEnded as ended:
            person.say(f"{str(ended).capitalize()}.")
            return self._findings
        if any(stage.moves_mount for stage in self._stages):
            person.say("Take care of its cables, and keep a hand near its switch.")
        refused = ""  # why the stage before could not be carried out
        for stage in self._stages:
            title = f"{STAGES.index(stage) + 1}/{len(STAGES)} {stage.name}"
            if self._findings.is_complete(stage.name):
                person.say(f"{title}: done before.")
                continue
            if not stage.why_needed(telescope):
                person.say(f"{title}: not needed.")
                continue
            key = ""
            while key in ("", "a"):
                before, refused = refused, self._why_impossible(stage)
                if refused:
                    person.say(f"{title}: not now{' either' if refused == before else f': {refused}'}.")
                    break
                resumes = any(finding.rate is not None for finding in self._findings.stages.get(stage.name, []))
                again = " It continues after the last measurement." * resumes
                person.say(f"{title}: {stage.announcement}{again}{self._position_text() * stage.moves_mount}")
                key = key or await self._ask_person("y: yes  s: skip it  q: leave", "ysq")
                if key in ("y", "a"):
                    key = await self._carry_out(stage)
            if key == "q":
                break
        return self._findings

    def _position_text(self) -> str:
        """Return a sentence with the mount's altitude and azimuth; empty if they are unknown."""
        if (latest := self._telescope.position) is None:
            return ""
        try:
            horizon = self._telescope.controller.astrometry.horizontal(latest.position)
        except Fault:
            return ""
        return f" It points {horizon.alt:.0f}° high, at azimuth {horizon.az:.0f}°."

    def _why_impossible(self, stage: Stage) -> str:
        """Return why a stage cannot be carried out now; empty if it can."""
        controller = self._telescope.controller
        if stage.moves_mount and controller.hold.is_on:
            return "it is held (mount-gateway stop --release ends that)"
        if stage.moves_mount and (controller.driver.asleep or controller.driver.parked):
            return "it is parked or asleep; unpark it first (mount-gateway unpark)"
        status: op.Status | None = controller.cache.last_value(op.GetStatus)
        if (stage.moves_mount or stage.needs_alignment) and status is not None and not status.aligned:
            return "it is not aligned, so that it does not know where it points; align it first"
        return ""

    async def _carry_out(self, stage: Stage) -> str:
        """Carry out a stage; return the key for the next step: y for the next stage, a for again, q to quit."""
        telescope, person = self._telescope, self._person
        self._stage_findings, self.old_findings = [], self._findings.stages.get(stage.name, [])
        telescope.begin_stage()
        try:
            await telescope.read_position()
            tracked = telescope.status.tracking
        except StageEnded as ended:
            person.say(f"Not now: {ended}.")
            return "y"
        if person.stop.is_set():  # pressed before the stage began
            return await self._ask_person(STOP_PROMPT, "yaq")
        work = asyncio.ensure_future(stage.run(telescope, self))
        space = asyncio.ensure_future(person.stop.wait())
        stopped = theirs = False
        try:
            await asyncio.wait((work, space), return_when=asyncio.FIRST_COMPLETED)
            if stopped := not work.done():
                work.cancel()
                person.stop.clear()
                await self._stop_mount()
            await work
        except (StageEnded, asyncio.CancelledError) as ended:
            if isinstance(ended, asyncio.CancelledError) and not stopped:  # this session itself is ended
                try:
                    await telescope.stop()
                finally:
                    self._note_early_end(stage, "prove was ended")
                    self._save_findings(stage)
                raise
            reason, theirs = "stopped by you" if stopped else str(ended), isinstance(ended, StoppedByOthers)
            if telescope.is_moving and not (stopped or theirs or telescope.other_mover):
                await telescope.stop()
            person.say(f"This stage ends: {reason}.")
            self._note_early_end(stage, reason)
        finally:
            for task in (space, work):
                task.cancel()
            with contextlib.suppress(StageEnded, asyncio.CancelledError):
                await work
            if not theirs:
                await self._restore_tracking(tracked, stage.moves_mount and not telescope.others_set_tracking)
        self._save_findings(stage)
        return await self._ask_person(STOP_PROMPT, "yaq") if stopped else "y"

    def _note_early_end(self, stage: Stage, reason: str) -> None:
        """Add the findings of an earlier run that this run has not replaced, and the reason why the rest is missing."""
        replaced = {untried_rest_title(stage.name), *(finding.what for finding in self._stage_findings)}
        self._stage_findings += [finding for finding in self.old_findings if finding.what not in replaced]
        self._stage_findings.append(Finding(untried_rest_title(stage.name), NOT_TRIED, reason))

    def _save_findings(self, stage: Stage) -> None:
        stages = self._findings.stages | {stage.name: self._stage_findings}
        self._findings.stages = {known.name: stages[known.name] for known in STAGES if known.name in stages}
        self._save(self._findings)

    async def _ask_person(self, question: str, keys: str) -> str:
        """Ask until the person presses one of the keys, and return it. The space bar stops the mount."""
        while (key := await self._person.ask_for_key(question, keys)) == " ":
            self._person.stop.clear()
            await self._stop_mount()
        return key

    async def _stop_mount(self) -> None:
        stopping = asyncio.ensure_future(self._telescope.stop())
        await asyncio.sleep(0)  # the stop is sent before anything is written to a terminal, which may block
        self._person.say("Stopping …")
        trouble = await stopping
        self._person.say(f"Not stopped: {trouble}" if trouble else "STOPPED.")

    async def _restore_tracking(self, earlier_tracking: op.Tracking, set_by_check: bool) -> None:
        """Turn tracking off if it was off before the stage and the stage has turned it on. Report any other change
        of tracking to the person: it was made by somebody else, or by the gateway at a limit.
        """
        telescope = self._telescope
        telescope.begin_stage()
        with contextlib.suppress(StageEnded):
            await telescope.read_position()
            before, after = (each is not op.Tracking.OFF for each in (earlier_tracking, telescope.status.tracking))
            if before == after:
                return
            if before or not set_by_check:
                was, now = ("on", "off") if before else ("off", "on")
                why = telescope.tracking_off_note if before else ""
                self._person.say(f"Its tracking was {was}, and is {now} now: {why or 'prove did not do that'}.")
            elif not (answer := await telescope.ask(requests.TrackRequest(on=False, who=CLIENT))).is_ok:
                self._person.say(f"Its tracking was off: {answer.text}")

    # --- reports of a stage -------------------------------------------------------------------------------------------

    def add(self, finding: Finding) -> None:
        self._stage_findings.append(finding)
        if any(earlier is finding for earlier in self.old_findings):  # a rate measured before the stage was ended
            return
        self._person.say(finding.as_line)
        if finding.verdict == DIFFERS and finding.means:
            self._person.say(f"  {finding.means}")

    def progress(self, done_count: int, total: int, title: str) -> None:
        """Show the person the progress; let the console's page and ``status`` show that ``prove`` is running."""
        self._telescope.controller.wire_log.remember_notice(CLIENT, "checks this mount")
        self._person.show_progress(done_count / max(1, total), title)
