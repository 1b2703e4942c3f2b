"""Random plays with three pages on one mount: fingers, rates, views, lost focus, reloads, and another program.

The law: no finger, no motion. When no finger has been on an arrow of any page for as long as the network and the mount
need, the true axes of the mount turn for nothing but tracking or a goto.
"""

from __future__ import annotations

import asyncio
from random import Random
from typing import NamedTuple

from gateway.console.mounts import Mounts
from gateway.diagnostics.rehearsal.stage import RehearsalClient
from tests.support.console.browser import Node, Page
from tests.support.taps import stage
from tests.support.truth import moving

DIRECTIONS = ("north", "south", "east", "west")
#: Delays of the network in each direction, seconds, and the jitter as a part of it.
DELAYS, JITTERS = (0.05, 0.15, 0.25, 0.4, 1.0), (0.0, 0.5)
#: Seconds that a play lasts, and between two looks at the truth.
LASTS, LOOK = 12.0, 0.1
#: Seconds from the moment at which the gateway knows that no finger is down, until the mount is at rest: a tap on its
#: way, the exchanges before its halt, and running on.
SETTLES = 3.0
#: Seconds after which a page counts as gone of which nothing arrives.
SILENT = 2.0


class Outcome(NamedTuple):
    """How a play went: seconds of motion without a finger, seconds of motion, what pages were told."""

    run_away: float
    moved: float
    words: list[str]


async def play(node: Node, seed: int, delay: float, jitter: float, mount: str = "cpc", latency: float = 0.1) -> Outcome:
    """Play at random, lift all fingers, and watch until everything must be at rest."""
    random, loop = Random(seed), asyncio.get_running_loop()
    async with stage("lx200", mount, latency) as own:
        mounts, program = Mounts([own.gateway]), own.client("10.0.0.1")
        pages = [Page(node, number, mounts, delay, jitter * delay, random) for number in range(3)]
        for page in pages:
            page.load()
        await asyncio.sleep(3.0 * delay + 1.0)
        longest = delay * (1.0 + jitter) + SILENT + SETTLES
        free, slewed, run_away, moved = loop.time(), -99.0, 0.0, 0.0
        began, next_act = loop.time(), loop.time()
        while loop.time() < began + LASTS + longest + 1.0:
            now = loop.time()
            if now >= began + LASTS:
                for page in pages:
                    for pointer in list(page.fingers):
                        page.lift(pointer)
            elif now >= next_act:
                act(random, random.choice(pages), program)
                next_act = now + random.choice((0.02, 0.05, 0.1, 0.15, 0.3, 0.6, 1.5))
            if any(page.fingers for page in pages):
                free = now
            own.sim.advance_to_now()
            if own.sim.mechanics.slewing(own.sim.now) or own.controller.wanted.goto_pending:
                slewed = now
            if moving(own.sim) and now - slewed > SETTLES:
                moved += LOOK
                run_away += LOOK if now - free > longest else 0.0
            await asyncio.sleep(LOOK)
        for page in pages:
            page.end()
        await asyncio.sleep(2.0 * delay + 0.5)
        return Outcome(run_away, moved, [words for page in pages for words in page.words])


def act(random: Random, page: Page, program: RehearsalClient) -> None:
    """Do something with one page, or as another program."""
    free = next(pointer for pointer in range(1, 9) if pointer not in page.fingers)
    what = random.random()
    if what < 0.42:
        if len(page.fingers) < 2:
            page.press(random.choice(DIRECTIONS), free)
    elif what < 0.82:
        if page.fingers:
            page.lift(random.choice(list(page.fingers)))
    elif what < 0.88:
        page.do("rate", random.randrange(5, 10))
    elif what < 0.91:
        page.loses("blur")
    elif what < 0.94:
        page.loses("view", random.choice(("sky", "readings", "control")))
    elif what < 0.96:
        page.load()
    else:
        program.send(random.choice((b":Q#", b":RM#:Mn#:Qn#", b":Sr02:00:00#:Sd+40*00:00#:MS#")))
