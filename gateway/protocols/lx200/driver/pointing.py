"""Positions, gotos, syncs. A Meade says no to a goto, with words; that no is passed on."""

from __future__ import annotations

import contextlib

from gateway.driver import Steps
from gateway.errors import Fault, NoAnswer, Refused
from gateway.operations import (
    CancelGoto,
    Equatorial,
    Goto,
    GotoAxes,
    Home,
    HomeState,
    Horizontal,
    HorizontalPosition,
    Park,
    Position,
    SetHome,
    Sleep,
    Slewing,
    Sync,
    Unpark,
    Wake,
)
from gateway.protocols.lx200.driver.identify import HIGH, high_precision, read_status
from gateway.protocols.lx200.driver.state import GotoState, Meade, ask
from gateway.spherical import fold_declination

#: A goto counts as under way this long at least, and until the bars were empty twice.
START_GRACE = 0.8
QUIET = 2
#: Seconds between the halves of a position, and how often both are asked until they are no further apart.
INSTANT, PAIR_TRIES = 0.5, 5


def position(mount: Meade, _: Position) -> Steps:
    """:GR and :GD -> Equatorial. A telescope that was switched off and on answers short: it is made precise again."""
    first, second = yield from _pair(mount, "GR", "GD")
    if not mount.low and first["length"] < HIGH:
        yield from high_precision(mount)
    return Equatorial(*fold_declination(first["ra"], second["dec"]))


def horizontal_position(mount: Meade, _: HorizontalPosition) -> Steps:
    """:GZ and :GA -> Horizontal."""
    first, second = yield from _pair(mount, "GZ", "GA")
    return Horizontal(first["az"], second["alt"])


def _pair(mount: Meade, first: str, second: str) -> Steps:
    """Two answers of about one instant: what comes between them on the line may take long."""
    for attempt in range(PAIR_TRIES):
        one = yield from ask(mount, first)
        since = mount.now()
        other = yield from ask(mount, second)
        if mount.now() - since <= INSTANT or attempt == PAIR_TRIES - 1:
            break
    return one, other


def slewing(mount: Meade, _: Slewing) -> Steps:
    """:D -> bool, latched from the goto until the telescope has settled; hand motion is none."""
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


def goto(mount: Meade, operation: Goto) -> Steps:
    """:Sr :Sd :MS - refusals come with the telescope's own words."""
    yield from _clear_the_way(mount)
    yield from ask(mount, "Sr", ra=operation.ra)
    yield from ask(mount, "Sd", dec=operation.dec)
    yield from _begin(mount, "MS")


def goto_axes(mount: Meade, operation: GotoAxes) -> Steps:
    """:Sz :Sa :MA - where the model has it."""
    yield from _clear_the_way(mount)
    yield from ask(mount, "Sz", az=operation.az)
    yield from ask(mount, "Sa", alt=operation.alt)
    yield from _begin(mount, "MA")


def _begin(mount: Meade, command: str, then: str | None = None) -> Steps:
    """Send what begins a goto. It counts as under way before that, for a stop must know of it."""
    mount.parked, mount.goto = False, GotoState(since=mount.now(), then=then)
    try:
        yield from ask(mount, command)
    except NoAnswer:
        raise  # it may have heard all the same: the bars will tell
    except Fault:
        mount.goto = None
        raise
    mount.goto.since = mount.now()


def _clear_the_way(mount: Meade) -> Steps:
    """The newer goto wins; arrows are let go."""
    if mount.goto is not None or mount.moving:
        yield from ask(mount, "Q")
        mount.goto = None
        mount.moving.clear()


def cancel_goto(mount: Meade, _: CancelGoto) -> Steps:
    """:Q, when a goto is under way: it would end hand motion, too."""
    if mount.goto is not None:
        mount.goto = None
        yield from ask(mount, "Q")


def sync(mount: Meade, operation: Sync) -> Steps:
    """:Sr :Sd :CM - an empty text is a no."""
    yield from ask(mount, "Sr", ra=operation.ra)
    yield from ask(mount, "Sd", dec=operation.dec)
    answer = yield from ask(mount, "CM")
    if not answer["text"].strip():
        raise Refused("The mount refused the sync.")


def park(mount: Meade, _: Park) -> Steps:
    """:hP"""
    yield from _clear_the_way(mount)
    yield from _begin(mount, "hP", then="park")


def home(mount: Meade, _: Home) -> Steps:
    """:hF"""
    yield from _clear_the_way(mount)
    yield from ask(mount, "hF")


def set_home(mount: Meade, _: SetHome) -> Steps:
    """:hS"""
    yield from ask(mount, "hS")


def home_state(mount: Meade, _: HomeState) -> Steps:
    """:h? -> 0 failed, 1 found, 2 searching."""
    return int((yield from ask(mount, "h?"))["state"])


def unpark(mount: Meade, _: Unpark) -> Steps:
    """A parked LX200GPS wakes by :I, others by the next goto; the state is read anew."""
    if mount.parked and mount.model == "lx200gps":
        with contextlib.suppress(NoAnswer):
            yield from ask(mount, "I")
    mount.parked = False
    yield from read_status(mount)


def sleep(mount: Meade, _: Sleep) -> Steps:
    """:hN"""
    yield from ask(mount, "hN")


def wake(mount: Meade, _: Wake) -> Steps:
    """:hW"""
    yield from ask(mount, "hW")


