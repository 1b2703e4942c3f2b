"""Where it points and where it is sent: positions, gotos, syncs, the side of the pier, targets of its own library.

A Meade says no to a goto, with words; that no is passed on. No Meade tells the side of the pier of a German mount, so
it follows the hour angle: such a mount chooses its side with every goto by the hour angle of the goal, and keeps it
while it tracks on past the meridian. Before the first goto the place where it is found counts as one.
"""

from __future__ import annotations

import math

from gateway.astro.spherical import SIDEREAL_ARCSECONDS, fold_declination, wrap180
from gateway.core import operations as op
from gateway.core.errors import Garbled, Refused, Silence, Unsupported
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.lx200.driver.ends import MOUNT, at_most, begins, end, put_back_later
from gateway.protocols.lx200.driver.identify import HIGH, high_precision
from gateway.protocols.lx200.driver.state import OWN_PATIENCE, GotoState, Lx200Driver, ask

#: A goto counts as under way this long at least, and until the bars were empty twice.
START_GRACE = 0.8
QUIET = 2
#: Seconds between the halves of a position, and how often both are asked until they are no further apart.
INSTANT, PAIR_TRIES, HORIZONTAL_TRIES = 0.5, 5, 2
#: After so many silences in a row it is not asked any more where it points over the horizon.
GIVEN_UP = 2
#: So many times longer than two answers took before is no delay.
SLOWER = 1.25
#: Degrees: so near to the target of before it is that one, for it is told in whole seconds.
SAME = 20.0 / 3600.0


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
        mount.read_at = since, mount.now()
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
    moves = yield from _bars(mount)
    state = mount.goto
    if state is None:
        return False
    if moves:
        state.quiet = 0
        return True
    state.quiet += mount.now() >= state.since
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
    yield from put_back_later(mount)


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
    yield from put_back_later(mount)


def begin(mount: Lx200Driver, command: str, then: str | None = None) -> Steps:
    """Send what begins a goto."""
    begins(mount, *MOUNT)
    yield from mount.begin_goto(GotoState(since=mount.now(), then=then), ask(mount, command), _bars)


def _bars(mount: Lx200Driver) -> Steps:
    """-> whether the bars tell that a goto is under way."""
    return bool((yield from ask(mount, "D"))["bars"].strip())


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


# --- the side of the pier ---------------------------------------------------------------------------------------------


def chooses_side(mount: Lx200Driver, ra: float) -> None:
    """A goto to this right ascension was begun."""
    mount.side_by, mount.beyond_pole = (ra, mount.now()), None


def beyond_pole(mount: Lx200Driver) -> Steps:
    """-> whether the second axis is turned over the pole; by :GS and the last goto, or by :GR. False for a fork."""
    if not mount.german:
        return False
    if mount.beyond_pole is None:
        if mount.side_by is None:
            chooses_side(mount, (yield from ask(mount, "GR"))["ra"])
        sidereal = (yield from ask(mount, "GS"))["sidereal"]
        assert mount.side_by is not None
        ra, then = mount.side_by
        hour_angle = wrap180(sidereal - (mount.now() - then) * SIDEREAL_ARCSECONDS / 3600.0 - ra)
        mount.beyond_pole = (hour_angle > 0.0) if mount.southern else (hour_angle < 0.0)
    return mount.beyond_pole


def pier_side(mount: Lx200Driver, _: op.PierSide) -> Steps:
    """-> the letter, as a German hand control up to 5.24 has it: W where the second motor's axis reads beyond the pole.

    Raises Unsupported for a fork, which has no sides.
    """
    if not mount.german:
        raise Unsupported("A fork has no sides of the pier.")
    return "W" if (yield from beyond_pole(mount)) else "E"


# --- the telescope's own object library, for programs that speak its protocol -----------------------------------------


def choose(mount: Lx200Driver, operation: op.Choose) -> Steps:
    """:Sr :Sd, the choice, :LI :Gr :Gd -> Chosen. Gotos and syncs set the same target: none comes in between.

    The library knows one target, and so does the telescope: what this client has aimed at is put there first, so that a
    number that is not found leaves it as it was, as on the telescope itself.
    """
    yield from aim(mount, operation.ra, operation.dec)
    for name, fields in operation.first:
        yield from ask(mount, name, **dict(fields))
    reply = yield from _said(mount, operation.command, dict(operation.fields))
    text = yield from _said(mount, "LI", {})
    ra = (yield from ask(mount, "Gr"))["ra"]
    dec = (yield from ask(mount, "Gd"))["dec"]
    same = abs(wrap180(ra - operation.ra)) < SAME and abs(dec - operation.dec) < SAME
    return op.Chosen(None if same else op.Equatorial(ra, dec), text.decode("latin-1").rstrip("#"), reply)


def _said(mount: Lx200Driver, command: str, values: dict[str, object]) -> Steps:
    """The bytes of a reply; none where it has none, or the telescope does not know the command."""
    if not mount.protocol.commands[command].replies:
        yield from ask(mount, command, **values)
        return b""
    try:
        return (yield Send(command, {**values, "low": mount.low}, OWN_PATIENCE, raw=True))["raw"]
    except Silence:
        return b""
