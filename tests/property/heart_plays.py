"""A play: programs, a person at the keys and a line with faults around one mount, judged by the simulator's axes.

    python -m tests.property.heart_plays [--examples 300] [--seed 1] [--mount cpc] [--presented lx200] [--whole]

A script that fails is made smaller before it is shown. Nothing that anybody answers counts as the truth.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import time
from collections.abc import Iterable
from typing import Any

from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.truth import truth_of
from tests.property.judge import Judge
from tests.property.line_of_faults import FaultyLine
from tests.property.orders import Event, Keypad, lx200, nexstar, set_up
from tests.property.scripts import DAY, MOUNTS, NIGHT, Script, draw, shrink
from tests.support.in_process_gateway import Bridge, RehearsalClient

#: How often the truth is looked at, seconds: while anything moves, and while the mount has been at rest.
GLANCE, GLANCE_AT_REST = 0.2, 0.5
SETTLE = 10.0
#: Seconds that a goto may take from its order on.
LONGEST_GOTO = 150.0
SITE = (45.0, 10.0)


def bound(script: Script) -> float:
    """Seconds until this mount has heard what it was told last: identification, the longest exchange, the way there."""
    driven, model, _ = MOUNTS[script.mount]
    identification = 6.0 if driven == "nexstar" else 8.0
    longest = {"lx200": 14.0, "lx200-16": 14.0}.get(model, 3.5)
    restored = 32.0 if script.mount in ("nexstar-gps-2.2", "gt", "nexstar-gps-1.2") else 0.0  # by the hand control
    return identification + longest + 40 * script.latency + restored


def play(script: Script) -> list[str]:
    """What was wrong, in words."""
    return run(_play(script))  # type: ignore[no-any-return]


async def _play(script: Script) -> list[str]:
    driven, model, version = MOUNTS[script.mount]
    config: dict[str, Any] = {"lowest": script.lowest, "site": SITE}
    config["mode"] = "eq-north" if model == "cge" else "alt-az" if driven == "nexstar" else None
    if model == "cge":
        config["hour_angle_limit"] = 1.5
    surface = "autostar" if script.presented == "lx200" else "cge" if model == "cge" else "6-8se"
    bridge = Bridge(
        model,
        version,
        driven=driven,
        presented=script.presented,
        surface=surface,
        latency=script.latency,
        config=config,
        start=DAY if script.day else NIGHT,
        site=SITE,
    )
    set_up(bridge.sim, *script.start)
    await asyncio.sleep(120.0)
    wire = FaultyLine(bridge.sim.connection, script.latency, script.faults, lambda seconds: _busy(bridge.sim, seconds))
    bridge.controller.line.wire = wire
    async with bridge:
        stage = _Stage(bridge, script, wire)
        await stage.act()
        await stage.end()
        return stage.judge.complaints


def _busy(sim: Any, seconds: float) -> bool:
    """An LX200GPS says that it is busy; others are mute."""
    if getattr(sim, "model", "") != "lx200gps":
        return False
    sim.busy_until = max(sim.busy_until, sim.clock() + seconds)
    return True


class _Stage:
    """One play under way."""

    def __init__(self, bridge: Bridge, script: Script, wire: FaultyLine) -> None:
        self.bridge, self.script, self.wire = bridge, script, wire
        self.now = asyncio.get_running_loop().time
        self.began = wire.began = self.now()
        self.say = lx200 if script.presented == "lx200" else nexstar
        self.programs: dict[int, RehearsalClient] = {}
        self.keypad = Keypad(bridge.sim)
        self.judge = Judge(bridge, script, wire, self.began)
        self.arrows: dict[int, set[str]] = {}
        self._polled = 0.0
        self._moves = False

    async def act(self) -> None:
        for event in self.script.events:
            await self.until(event.at)
            self.do(event)

    async def until(self, at: float) -> None:
        """Let time pass, to so many seconds after the beginning."""
        while (left := self.began + at - self.now()) > 1e-6:
            await asyncio.sleep(min(GLANCE if self._moves else GLANCE_AT_REST, left))
            self._moves = self.judge.look()
            if self.script.polled and self.now() - self._polled > 1.0:
                self._polled = self.now()
                self.program(9).send(b":GR#" if self.script.presented == "lx200" else b"e")

    def program(self, number: int) -> RehearsalClient:
        if number not in self.programs:
            self.programs[number] = self.bridge.client(f"10.0.0.{number}")
        return self.programs[number]

    def do(self, event: Event) -> None:
        self.judge.hear(event)
        if event.who == 0:
            self.keypad.do(event)
            return
        held = self.arrows.setdefault(event.who, set())
        if event.what == "arrow":
            held.add(event.how[0])
        self.program(event.who).send(self.say(self.bridge.sim, event))

    async def end(self) -> None:
        """The last orders; then time to come to rest, and the verdict."""
        last = max([0.0, *(event.at for event in self.script.events)])
        await self.until(last + 0.5)
        self.keypad.release()
        if self.script.ending == "stop":
            self.do(Event(last + 0.5, 1, "stop"))
        elif self.script.ending == "release":
            for who, letters in sorted(self.arrows.items()):
                for letter in sorted(letters):
                    self.do(Event(last + 0.5, who, "release", (letter,)))
        else:
            for number in set(self.programs) - {9}:
                self.programs.pop(number).close()
        self.wire.heal()
        over = max([self.now(), *(end for _, end in self.wire.spoilt)]) - self.began
        await self.until(over + bound(self.script) + SETTLE)
        over = self.now() - self.began
        while (
            truth_of(self.bridge.sim).moving
            and self.now() - self.began < over + LONGEST_GOTO
            and (self.judge.goto_wanted())
        ):
            await self.until(self.now() - self.began + 1.0)
        await self.until(self.now() - self.began + SETTLE)
        await self.judge.verdict(self.until, self.bridge.client("10.0.0.8"))


def examples(mount: str, seeds: Iterable[int], presented: str | None = None) -> list[tuple[int, Script, list[str]]]:
    """Play these seeds -> those that failed."""
    failed = []
    for seed in seeds:
        script = draw(seed, mount, presented)
        wrong = play(script)
        if wrong:
            failed.append((seed, script, wrong))
    return failed


def smallest(script: Script, wrong: list[str]) -> Script:
    """The smallest script with a complaint of the same kind."""
    kind = wrong[0].partition(":")[0]
    return shrink(script, lambda smaller: any(text.startswith(kind) for text in play(smaller)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--mount", choices=list(MOUNTS))
    parser.add_argument("--presented", choices=("lx200", "nexstar"))
    parser.add_argument("--whole", action="store_true", help="show failing scripts as they were drawn")
    given = parser.parse_args()
    failures = 0
    for mount in [given.mount] if given.mount else MOUNTS:
        began = time.process_time()
        failed = examples(mount, range(given.seed, given.seed + given.examples), given.presented)
        failures += len(failed)
        print(f"{mount}: {given.examples} plays, {len(failed)} failed, {time.process_time() - began:.1f} s", flush=True)
        for seed, script, wrong in failed:
            shown = script if given.whole else smallest(script, wrong)
            print(f"  seed {seed}: {'; '.join(play(shown))}\n  {shown.words()}", flush=True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
