"""Positions, gotos, syncs. A Meade says no to a goto, with words; that no is passed on."""

from __future__ import annotations

import math

from gateway.astro.spherical import fold_declination
from gateway.core import operations as op
from gateway.core.errors import Fault, Garbled, NoAnswer, Refused, Silence
from gateway.protocols.base.driver import Steps, Wait
from gateway.protocols.lx200.driver.ends import MOUNT, begins, end
from gateway.protocols.lx200.driver.identify import HIGH, high_precision
from gateway.protocols.lx200.driver.pier import chooses_side
from gateway.protocols.lx200.driver.put_back import at_most, later
from gateway.protocols.lx200.driver.state import GotoState, Lx200Driver, ask

#: A goto counts as under way this long at least, and until the bars were empty twice.
START_GRACE = 0.8
QUIET = 2
#: Seconds between two looks at the bars after an acknowledgement was lost.
LOOK_AGAIN = 0.5
#: Seconds between the halves of a position, and how often both are asked until they are no further apart.
INSTANT, PAIR_TRIES, HORIZONTAL_TRIES = 0.5, 5, 2
#: After so many silences in a row it is not asked any more where it points over the horizon.
GIVEN_UP = 2
#: So many times longer than two answers took before is no delay.
SLOWER = 1.25


def position(mount: Lx200Driver, _: op.Position) -> Steps:
    """:GR and :GD -> Equatorial. A telescope that was switched off and on answers short: it is made precise again."""
    first, second, _ = yield from _pair(mount, "GR", "GD", PAIR_TRIES)
    if not mount.low and first["length"] < HIGH:
        yield from high_precision(mount)
    return op.Equatorial(*fold_declination(first["ra"], second["dec"]))


def horizontal_position(mount: Lx200Driver, _: op.HorizontalPosition) -> Steps:
    """:GZ and :GA -> Horizontal; None where the telescope does not answer that, or the line is too busy for both.

    The controller derives it then. One silence may be an answer that was lost.
    """
    if mount.mute.intersection(("GZ", "GA")):
        return None
    try:
        first, second, together = yield from _pair(mount, "GZ", "GA", HORIZONTAL_TRIES)
    except (Garbled, Silence):
        mount.unanswered += 1
        if mount.unanswered >= GIVEN_UP:
            mount.mute |= {"GZ", "GA"}
        return None
    mount.unanswered = 0
    return op.Horizontal(first["az"], second["alt"]) if together else None


def _pair(mount: Lx200Driver, first: str, second: str, tries: int) -> Steps:
    """Two answers, and whether they are of about one instant: what comes between them on the line may take long.

    Where the line itself takes long they are no nearer to each other however often both are asked.
    """
    nearest = math.inf
    for _ in range(tries):
        one = yield from ask(mount, first)
        since = mount.now()
        other = yield from ask(mount, second)
        mount.halves = since, mount.now()
        nearest = min(nearest, mount.now() - since)
        if mount.now() - since <= max(INSTANT, SLOWER * mount.quick):
            return one, other, True
    mount.quick = nearest
    return one, other, False


def slewing(mount: Lx200Driver, _: op.Slewing) -> Steps:
    """:D -> bool, latched from the goto until the telescope has settled; hand motion is none."""
    if mount.seeking:
        return (yield from still_seeking(mount))
    if mount.goto is None:
        return False
    bars = (yield from ask(mount, "D"))["bars"]
    state = mount.goto
    if state is None:
        return False
    if bars.strip():
        state.quiet = 0
        return True
    state.quiet += 1
    if mount.now() - state.since < START_GRACE or state.quiet < QUIET:
        return True
    mount.goto = None
    mount.parked = state.then == "park"
    return False


def still_seeking(mount: Lx200Driver) -> Steps:
    """:h? -> whether it still looks for its home."""
    mount.seeking = (yield from ask(mount, "h?"))["state"] == "2"
    return mount.seeking


def goto(mount: Lx200Driver, operation: op.Goto) -> Steps:
    """:Sr :Sd :MS - refusals come with the telescope's own words."""
    yield from stop_current_motion(mount)
    yield from at_most(mount, operation.fastest)
    yield from aim(mount, operation.ra, operation.dec)
    yield from begin(mount, "MS")
    chooses_side(mount, operation.ra)
    yield from later(mount)


def aim(mount: Lx200Driver, ra: float, dec: float) -> Steps:
    """:Sr :Sd"""
    yield from ask(mount, "Sr", ra=ra)
    yield from ask(mount, "Sd", dec=dec)


def goto_axes(mount: Lx200Driver, operation: op.GotoAxes) -> Steps:
    """:Sz :Sa :MA - where the model has it."""
    yield from stop_current_motion(mount)
    yield from at_most(mount, operation.fastest)
    yield from ask(mount, "Sz", az=operation.az)
    yield from ask(mount, "Sa", alt=operation.alt)
    yield from begin(mount, "MA")
    yield from later(mount)


def begin(mount: Lx200Driver, command: str, then: str | None = None) -> Steps:
    """Send what begins a goto. It counts as under way before that, for a stop must know of it."""
    mount.parked, mount.goto = False, GotoState(since=mount.now(), then=then)
    begins(mount, *MOUNT)
    try:
        yield from ask(mount, command)
    except (NoAnswer, Garbled):
        if not (yield from _has_begun(mount)):
            mount.goto = None
            raise
    except Fault:
        mount.goto = None
        raise
    mount.goto.since = mount.now()


def _has_begun(mount: Lx200Driver) -> Steps:
    """Whether a goto whose acknowledgement was lost is under way: the bars tell. Raises NoAnswer while nobody can."""
    assert mount.goto is not None
    mount.goto.unsure = True
    for attempt in range(QUIET):
        if attempt:
            yield Wait(LOOK_AGAIN)
        if (yield from ask(mount, "D"))["bars"].strip():
            mount.goto.unsure = False
            return True
    return False


def stop_current_motion(mount: Lx200Driver) -> Steps:
    """The newer goto wins; arrows are let go."""
    if mount.goto is not None or mount.moving or mount.pulsing or mount.seeking:
        yield from ask(mount, "Q")
        mount.goto, mount.seeking = None, False
        mount.moving.clear()
        mount.pulsing.clear()


def abort_slew(mount: Lx200Driver, _: op.AbortSlew) -> Steps:
    """:Q, when a goto or a search for home is under way: it would end hand motion, too."""
    if mount.goto is not None or mount.seeking:
        mount.goto = None
        yield from end(mount, "Q", MOUNT, True)
        mount.seeking = False


def sync(mount: Lx200Driver, operation: op.Sync) -> Steps:
    """:Sr :Sd :CM - an empty text is a no."""
    yield from aim(mount, operation.ra, operation.dec)
    answer = yield from ask(mount, "CM")
    if not answer["text"].strip():
        raise Refused("The mount refused the sync.")
