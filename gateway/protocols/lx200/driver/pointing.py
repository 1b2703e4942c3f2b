"""Positions, gotos, syncs, the side of the pier, and targets from the telescope's object library.

A Meade refuses a goto with a text, which is passed on to the client. No Meade reports the side of the pier of a German
mount, so it is computed from the hour angle: such a mount chooses its side at every goto by the hour angle of the goal,
and keeps it while it tracks past the meridian. Before the first goto its current position counts as the goal.
"""

from __future__ import annotations

import math
from contextlib import suppress

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S, fold_declination, separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Garbled, Refused, Silence, TooHigh, Unsupported
from gateway.protocols.base.driver import Remark, Send, Steps, Wait
from gateway.protocols.lx200.driver.dialect import read_pier_side, read_report
from gateway.protocols.lx200.driver.ends import MOUNT_AXES, count_motion, end_motion, restore_rates_later, set_max_speed
from gateway.protocols.lx200.driver.identify import HIGH_PRECISION_LENGTH, switch_to_high_precision
from gateway.protocols.lx200.driver.state import KNOWN_COMMAND_TIMEOUT, Lx200Driver, Lx200GotoState, ask

#: A goto counts as under way for at least so many seconds, and until so many replies to :D# have had no bars.
START_GRACE = 0.8
REPLIES_WITHOUT_BARS = 2
#: A goto is over, whatever :D# shows, if both coordinates have stayed within so many degrees for so many seconds: a
#: telescope pushed by hand may always show bars. Without tracking the right ascension changes by less in that time.
STILL_TOLERANCE, STILL_PERIOD = 0.1, 15.0
#: Before a goto the driver asks another maker's mount up to so many times whether it is at rest; after a sync it reads
#: the position up to so many times to see whether the mount has taken the sync. Seconds between two such requests.
SETTLE_CHECKS, SYNC_CHECKS, CHECK_INTERVAL = 20, 3, 0.5
#: Seconds allowed between the two reads of a position, and how many times at most both are read to achieve this.
MAX_PAIR_DELAY, PAIR_TRIES, HORIZONTAL_TRIES = 0.5, 5, 2
#: After so many missing replies in a row, azimuth and altitude are not asked for any more.
MAX_MISSING_REPLIES = 2
#: A reply may take this many times longer than before without counting as delayed.
REPLY_TIME_FACTOR = 1.25
#: Degrees: targets this near to each other are the same, because they are reported in whole seconds.
TARGET_TOLERANCE = 20.0 / 3600.0


def position(mount: Lx200Driver, _: op.Position) -> Steps:
    """:GR :GD -> Equatorial. After a restart the telescope replies in low precision: switch to high again."""
    first, second, _ = yield from _read_pair(mount, "GR", "GD", PAIR_TRIES)
    if not mount.low and first["length"] < HIGH_PRECISION_LENGTH:
        yield from switch_to_high_precision(mount)
    place = mount.last_position = op.Equatorial(*fold_declination(first["ra"], second["dec"]))
    if (state := mount.goto) is not None:
        state.position_read_at, old = mount.now(), state.moved_to
        if old is None or max(abs(wrap180(place.ra - old.ra)), abs(place.dec - old.dec)) > STILL_TOLERANCE:
            state.moved_to, state.moved_at = place, state.position_read_at
    return place


def horizontal_position(mount: Lx200Driver, _: op.HorizontalPosition) -> Steps:
    """:GZ :GA -> Horizontal; None if the telescope does not answer them, or the line is too busy to read both together.

    If None, the controller computes them. Single replies may be lost: the driver stops asking after two in a row.
    """
    if mount.unanswered.intersection(("GZ", "GA")):
        return None
    try:
        first, second, together = yield from _read_pair(mount, "GZ", "GA", HORIZONTAL_TRIES)
    except (Garbled, Silence):
        mount.missing_replies += 1
        if mount.missing_replies >= MAX_MISSING_REPLIES:
            mount.unanswered |= {"GZ", "GA"}
        return None
    mount.missing_replies = 0
    return op.Horizontal(first["az"], second["alt"]) if together else None


def _read_pair(mount: Lx200Driver, first_query: str, second_query: str, tries: int) -> Steps:
    """Return two replies, and whether they are of about the same instant, because other requests may delay the second.

    On a slow line it does not help to repeat both, so the delay is compared with the usual reply time.
    """
    shortest_delay = math.inf
    for _ in range(tries):
        value = yield from ask(mount, first_query)
        since = mount.now()
        other = yield from ask(mount, second_query)
        mount.read_at = since, mount.now()
        shortest_delay = min(shortest_delay, mount.now() - since)
        if mount.now() - since <= max(MAX_PAIR_DELAY, REPLY_TIME_FACTOR * mount.reply_time):
            return value, other, True
    mount.reply_time = shortest_delay
    return value, other, False


def slewing(mount: Lx200Driver, _: op.Slewing) -> Steps:
    """:D (:h? in a search for home) -> whether the mount slews or has not settled yet; motion by hand does not count.

    Without a goto of the gateway, :D is sent only while something else, such as the hand control, moves the mount.
    """
    if mount.seeking:
        return (yield from is_seeking_home(mount))
    unordered = mount.goto is None
    if mount.pushed_by_hand:
        return False
    if unordered and not mount.moved_by_others:
        return False
    moves: bool = yield from _bars_show_goto(mount)
    state = mount.goto
    if state is None:
        return unordered and moves
    if moves and not _stands_still(mount, state):
        state.replies_without_bars = 0
        return True
    state.replies_without_bars += mount.now() >= state.began
    if mount.now() - state.began < START_GRACE or state.replies_without_bars < REPLIES_WITHOUT_BARS:
        return True
    mount.goto = None
    mount.parked = state.purpose == "park"
    if state.purpose and mount.dialect and mount.has_status:
        mount.last_report = None
        status = yield from read_report(mount)
        mount.parked = status.parked
        if not (status.parked if state.purpose == "park" else status.at_home):
            place = "parked" if state.purpose == "park" else "at its home"
            yield Remark(f"the mount stands still, and reports that it is not {place}")
    return False


def _stands_still(mount: Lx200Driver, state: Lx200GotoState) -> bool:
    """Whether the position shows that the telescope has not moved for a while since it was sent to a goal.

    False while it parks or homes, and for another maker's mount that reports its status: an OnStep may wait at the
    meridian for the user.
    """
    reports = mount.dialect and mount.has_status
    return state.purpose is None and not reports and state.position_read_at - state.moved_at > STILL_PERIOD


def is_seeking_home(mount: Lx200Driver) -> Steps:
    """:h? -> whether the telescope still seeks its home."""
    mount.seeking = (yield from ask(mount, "h?"))["state"] == "2"
    return mount.seeking


def goto(mount: Lx200Driver, operation: op.Goto) -> Steps:
    """:Sr :Sd :MS - slew to a position; a refusal carries the telescope's own text."""
    yield from stop_current_motion(mount)
    yield from set_max_speed(mount, operation.fastest)
    yield from set_target(mount, operation.ra, operation.dec)
    yield from begin_goto(mount, "MS")
    note_pier_side_basis(mount, operation.ra)
    yield from restore_rates_later(mount)


def set_target(mount: Lx200Driver, ra: float, dec: float) -> Steps:
    """:Sr :Sd - set the target."""
    yield from ask(mount, "Sr", ra=ra)
    yield from ask(mount, "Sd", dec=dec)


def goto_axes(mount: Lx200Driver, operation: op.GotoAxes) -> Steps:
    """:Sz :Sa :MA - slew to an azimuth and altitude."""
    yield from stop_current_motion(mount)
    yield from set_max_speed(mount, operation.fastest)
    yield from ask(mount, "Sz", az=operation.az)
    yield from ask(mount, "Sa", alt=operation.alt)
    yield from begin_goto(mount, "MA")
    yield from restore_rates_later(mount)


def begin_goto(mount: Lx200Driver, command: str, purpose: str | None = None) -> Steps:
    """Send the command that begins a goto; ``purpose`` is ``park`` or ``home``, None for a goto to a target."""
    mount.check_movable()
    count_motion(mount, *MOUNT_AXES)
    yield from mount.begin_goto(Lx200GotoState(purpose=purpose), _send_goto(mount, command), _bars_show_goto)


def _send_goto(mount: Lx200Driver, command: str) -> Steps:
    """Send a goto command. A model with ``by_effect`` may refuse and yet slew: no refusal is raised if bars show it."""
    try:
        yield from ask(mount, command)
    except (BelowHorizon, TooHigh, Refused):
        if not mount.facts.get("by_effect") or not (yield from _bars_show_goto(mount)):
            raise


def _bars_show_goto(mount: Lx200Driver) -> Steps:
    """:D -> whether its bars show that a goto is under way; bars do not show a search for home by switches.
    On the way to park or home, another maker's status report shows it instead, if the mount has one.
    """
    if mount.goto is not None and mount.goto.purpose and mount.dialect and mount.has_status:
        mount.last_report = None
        status = yield from read_report(mount)
        if status.slews is not None:
            return status.slews or status.moves
    return bool((yield from ask(mount, "D"))["bars"].strip())


def stop_current_motion(mount: Lx200Driver) -> Steps:
    """End a goto, a motion by hand or a search for home before a newer goto begins."""
    if mount.goto is not None or mount.moving or mount.pulsing or mount.seeking:
        yield from ask(mount, "Q")
        mount.goto, mount.seeking = None, False
        mount.moving.clear()
        mount.pulsing.clear()
        for _ in range(SETTLE_CHECKS if mount.dialect else 0):  # until it has slowed down it refuses another goto
            if not (yield from _bars_show_goto(mount)):
                break
            yield Wait(CHECK_INTERVAL)


def abort_slew(mount: Lx200Driver, _: op.AbortSlew) -> Steps:
    """:Q - end a goto or home search, also one that others began; send nothing if only hand motion or pulses run."""
    known = mount.goto is not None or mount.seeking
    by_hand = mount.moving or mount.pulsing or mount.now() < mount.pulses_end_at
    if known or not by_hand:
        mount.goto = None
        yield from end_motion(mount, "Q", MOUNT_AXES, known)
        mount.seeking = False


def sync(mount: Lx200Driver, operation: op.Sync) -> Steps:
    """:Sr :Sd :CM - sync. After a reply without words, or if ``by_effect``, read the position back. Raises Refused."""
    mount.check_movable()
    yield from set_target(mount, operation.ra, operation.dec)
    said = ""
    with suppress(Garbled, Silence):
        answer = yield from ask(mount, "CM")
        if not (said := answer.get("text", "-").strip()):
            raise Refused("The mount refused the sync.")
    worded = not said.isdigit() and said != ""
    if worded and not mount.facts.get("by_effect"):
        return
    within = STILL_TOLERANCE if worded else 2.0 * mount.rest_tolerance
    for look in range(SYNC_CHECKS if worded else SYNC_CHECKS - 1):  # each maker has words of its own for a refusal
        if look:
            yield Wait(CHECK_INTERVAL)
        place = yield from position(mount, op.Position())
        if separation(place.ra, place.dec, operation.ra, operation.dec) < within:
            return
    raise Refused("The mount did not take the sync: it reports another position.")


# --- the side of the pier ---------------------------------------------------------------------------------------------


def note_pier_side_basis(mount: Lx200Driver, ra: float) -> None:
    """Note the right ascension and the time of a goto; ``is_beyond_pole`` derives the side that the mount chose."""
    mount.pier_side_basis, mount.beyond_pole = (ra, mount.now()), None


def is_beyond_pole(mount: Lx200Driver) -> Steps:
    """Return whether the second axis is beyond the pole: as reported, or by the last goto; False if not German."""
    if not mount.german:
        return False
    if (side := (yield from read_pier_side(mount))) is not None:
        mount.beyond_pole = (side == "W") is not mount.southern
        return mount.beyond_pole
    if mount.beyond_pole is None:
        if mount.pier_side_basis is None:
            note_pier_side_basis(mount, (yield from ask(mount, "GR"))["ra"])
        sidereal = (yield from ask(mount, "GS"))["sidereal"]
        assert mount.pier_side_basis is not None
        ra, then = mount.pier_side_basis
        hour_angle = wrap180(sidereal - (mount.now() - then) * SIDEREAL_ARCSEC_PER_S / 3600.0 - ra)
        mount.beyond_pole = (hour_angle > 0.0) if mount.southern else (hour_angle < 0.0)
    return mount.beyond_pole


def pier_side(mount: Lx200Driver, _: op.PierSide) -> Steps:
    """Return W if the second axis reads beyond the pole, else E, as a German Celestron up to version 5.24 does.
    Raises Unsupported unless the mount is known to be German: a fork has no sides of the pier.
    """
    if not mount.german:
        raise Unsupported("A fork has no sides of the pier.")
    return "W" if (yield from is_beyond_pole(mount)) else "E"


# --- the telescope's own object library, for clients of its protocol --------------------------------------------------


def choose_object(mount: Lx200Driver, operation: op.Choose) -> Steps:
    """:Sr :Sd, the client's command, :LI :Gr :Gd -> Chosen, as one operation, so that no goto or sync comes between.

    The telescope has one target for all clients, so that of this client is set first: it stays if no object is found.
    """
    yield from set_target(mount, operation.ra, operation.dec)
    for name, fields in operation.first:
        yield from ask(mount, name, **dict(fields))
    reply = yield from _raw_reply(mount, operation.command, dict(operation.fields))
    text = yield from _raw_reply(mount, "LI", {})
    ra = (yield from ask(mount, "Gr"))["ra"]
    dec = (yield from ask(mount, "Gd"))["dec"]
    same = abs(wrap180(ra - operation.ra)) < TARGET_TOLERANCE and abs(dec - operation.dec) < TARGET_TOLERANCE
    return op.Chosen(None if same else op.Equatorial(ra, dec), text.decode("latin-1").rstrip("#"), reply)


def _raw_reply(mount: Lx200Driver, command: str, values: dict[str, object]) -> Steps:
    """Return the bytes of a reply; empty if the command has none, or if a telescope without the command is silent."""
    if not mount.protocol.commands[command].replies:
        yield from ask(mount, command, **values)
        return b""
    try:
        return (yield Send(command, {**values, "low": mount.low}, KNOWN_COMMAND_TIMEOUT, include_raw=True))["raw"]
    except Silence:
        return b""
