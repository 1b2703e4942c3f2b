"""Identifies the Meade: its position is read first, then its name; a telescope without a name is a classic LX200.

A device that reports a position is a telescope. All other queries may get no reply or one of an unknown form; the
driver then works without the answer, and does not ask again until the line is connected again.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from gateway.astro.spherical import fold_declination, wrap180
from gateway.core.errors import Fault, Garbled, NoAnswer, Silence
from gateway.core.operations import Equatorial, GetStatus, Identity, Operation, Status, Tracking
from gateway.protocols.base.driver import Remark, Send, Steps, Wait
from gateway.protocols.lx200.driver.dialect import read_report, read_speeds
from gateway.protocols.lx200.driver.state import KNOWN_COMMAND_TIMEOUT, PUSHED_MESSAGE, Lx200Driver, ask, send_command
from gateway.protocols.wireformat.command_set import load

#: Timeout of a query that may stay unanswered: a multiple of the usual reply time, and its minimum in seconds.
TIMEOUT_FACTOR, MIN_PROBE_TIMEOUT = 2.0, 0.6
#: Questions to an unknown controller, and what remains unknown without an answer.
UNKNOWN_FACT_BY_COMMAND = {"GVN": "its version", "ACK": "how it is mounted", "GW": "whether it tracks"}
#: How many positions are read to find out whether a mount that shows bars moves, and the seconds between two.
POSITION_READS, POSITION_READ_INTERVAL = 3, 1.5
#: How often another maker's mount is asked for its status: without an answer it counts as an unknown controller.
STATUS_TRIES = 3
#: The length of a right ascension in high precision.
HIGH_PRECISION_LENGTH = len("HH:MM:SS#")


def contact(mount: Lx200Driver, _: object = None) -> Steps:
    """Read the position by ACK, :GR and :GD in high precision, so that clients can be served before identification."""
    pec_axes = mount.pec_axes
    mount.reset_state()
    mount.pec_axes, mount.pushed_by_hand = pec_axes, False
    mount.unanswered, mount.reply_time = frozenset(), KNOWN_COMMAND_TIMEOUT
    yield from _probe(mount, "ACK", unverified_ok=True)
    began = mount.now()
    first = yield from switch_to_high_precision(mount)
    since = mount.now()
    second = yield from ask(mount, "GD")
    mount.read_at = since, mount.now()
    mount.reply_time, mount.contacted = min(KNOWN_COMMAND_TIMEOUT, since - began, mount.now() - since), True
    return Equatorial(*fold_declination(first["ra"], second["dec"]))


def identity(mount: Lx200Driver, _: Operation) -> Steps:
    """Identify the mount by ACK, :GVP, :GVN and :GW; return Identity."""
    if not mount.contacted:
        yield from contact(mount)
    mount.contacted = False
    letter = yield from _probe(mount, "ACK")
    if letter is not None:
        _note_mounting(mount, letter["mode"])
        mount.in_land_mode = letter["mode"] == "L"
    times = 1 if mount.named_model is not None else 3 if mount.product else 2
    product = yield from ask_repeatedly(mount, "GVP", times - ("GVP" in mount.unanswered))
    mount.product = product["product"] if product else ""
    if mount.named_model is None:
        mount.assume_model((yield from _find_model(mount, mount.product)))
    mount.has_status = False
    if product:
        firmware = yield from _probe(mount, "GVN")
        mount.firmware = firmware["firmware"] if firmware else ""
        times = STATUS_TRIES if mount.dialect else 1
        mount.has_status = (yield from ask_repeatedly(mount, mount.status_command, times)) is not None
        if mount.dialect and not mount.has_status:
            mount.assume_model("other")
    mount.extra_commands = frozenset({mount.status_command} if mount.has_status else ())
    if mount.dialect:
        yield from read_speeds(mount)
    if mount.model == "other":
        unknown = [text for command, text in UNKNOWN_FACT_BY_COMMAND.items() if command in mount.unanswered]
        unnamed = load("lx200").model_of_product(mount.product) == "other"
        untold = "and does not report its state (a TeenAstro does from 1.5.1 on)"
        known = "which the gateway does not know" if unnamed else untold
        yield Remark(
            f"it calls itself {mount.product!r}, {known}: the gateway sends it only what all LX200 controllers "
            f"share, and does not switch its tracking, park it or send it home"
            + (f"; it did not report {' nor '.join(unknown)}" if unknown else "")
            + ". If it is a Meade, name it: lx200:autostar"
        )
        yield from _detect_pushed_by_hand(mount)
    try:
        yield from read_status(mount)
    except Fault as fault:  # a refusal is an answer too: the telescope is connected
        if isinstance(fault, NoAnswer) and not isinstance(fault, Garbled):
            raise
    return Identity(product=mount.product or "LX200", version=mount.firmware or "?", model=mount.model or "autostar")


def _detect_pushed_by_hand(mount: Lx200Driver) -> Steps:
    """Note whether the user pushes the telescope by hand: :D then shows bars although the position does not change."""
    places: list[Equatorial] = []
    for _ in range(POSITION_READS):
        if not ((yield from _probe(mount, "D")) or {"bars": ""})["bars"].strip():
            return
        ra, dec = (yield from ask(mount, "GR"))["ra"], (yield from ask(mount, "GD"))["dec"]
        places.append(Equatorial(ra, dec))
        yield Wait(POSITION_READ_INTERVAL)
    moved = max(max(abs(wrap180(place.ra - ra)), abs(place.dec - dec)) for place in places)
    mount.pushed_by_hand = moved < mount.rest_tolerance
    if mount.pushed_by_hand:
        yield Remark(PUSHED_MESSAGE)


def ask_repeatedly(mount: Lx200Driver, command: str, times: int) -> Steps:
    """Send a query up to ``times`` times, because replies may be lost; return the fields of its reply, or None."""
    answer = None
    for _ in range(times):
        if answer is None:
            mount.unanswered -= {command}
            answer = yield from _probe(mount, command)
    return answer


def _probe(mount: Lx200Driver, command: str, unverified_ok: bool = False) -> Steps:
    """Send a query unless it failed before; return its reply's fields or None. Raises NoAnswer if the line is down."""
    if command in mount.unanswered or command not in mount.protocol.commands:
        return None
    try:
        patience = min(KNOWN_COMMAND_TIMEOUT, max(MIN_PROBE_TIMEOUT, TIMEOUT_FACTOR * mount.reply_time))
        return (yield Send(command, timeout=patience, unverified_ok=unverified_ok))
    except (Garbled, Silence):
        mount.unanswered |= {command}
    except Fault as fault:  # a busy telescope may answer this query later
        if isinstance(fault, NoAnswer):
            raise
    return None


def _find_model(mount: Lx200Driver, product: str) -> Steps:
    """Return the model for a product text; without a text, the 16 inch if the mount answers :h?, else a classic."""
    if product.startswith(("LX2001", "LX200GPS")):
        return "lx200gps"
    if product.startswith("LX200 16"):
        return "lx200-16"
    if product.startswith("LX200 "):
        return "lx200"
    if product:
        return load("lx200").model_of_product(product) or "autostar"
    return "lx200-16" if (yield from _probe(mount, "h?")) is not None else "lx200"


def _is_low_precision(answer: Mapping[str, object]) -> bool:
    length = answer.get("length")
    return isinstance(length, int) and length < HIGH_PRECISION_LENGTH


def switch_to_high_precision(mount: Lx200Driver) -> Steps:
    """Switch to high precision: read :GR, toggle (:U) if the reply is short, read again; return the last reply.

    Another maker's mount is not switched, because it answers some queries in high precision in any mode. A mount that
    does not answer these queries, such as a TeenAstro before 1.5, counts as an unknown controller.
    """
    mount.low, began = False, mount.now()
    for attempt in range(3):
        answer = yield from send_command(mount, "GR", {}, _is_low_precision)  # only its length counts then
        mount.low = _is_low_precision(answer)
        if not mount.low or attempt == 2:
            break
        if mount.model is None:
            mount.reply_time = min(KNOWN_COMMAND_TIMEOUT, mount.now() - began)
            if (product := (yield from _probe(mount, "GVP"))) is not None:
                mount.assume_model((yield from _find_model(mount, product["product"])))
        for _ in range(2 if mount.dialect else 0):
            with suppress(Garbled, Silence):
                return (yield Send("GR", {"low": True}, timeout=KNOWN_COMMAND_TIMEOUT))
        if mount.dialect:
            mount.assume_model("other")
        if not mount.supports("U"):
            break
        yield from ask(mount, "U")
    return answer


def _note_mounting(mount: Lx200Driver, letter: str) -> None:
    if letter != "L":
        mount.mounting = letter


def read_status(mount: Lx200Driver) -> Steps:
    """Read :GW, or ACK if the telescope lacks :GW; without both the telescope counts as aligned and as tracking.

    In motion a Meade reports what its motors do: not tracking while a key is pressed, tracking briefly during a goto.
    So its last report at rest counts during a motion. Another maker's mount is asked during a motion too.
    """
    command = mount.status_command
    if mount.product and not mount.has_status and command not in mount.unanswered:  # too busy at identification
        mount.has_status = (yield from _probe(mount, command)) is not None
    if mount.dialect and mount.has_status:
        mount.last_report = None
        state = yield from read_report(mount)
        _note_mounting(mount, state.mounting or mount.mounting)
        mount.aligned, mount.in_land_mode = True, False
        if mount.goto is None:
            mount.parked = state.parked
        if mount.goto is None and not mount.moving:
            mount.tracking = native_mode(mount) if state.tracks else Tracking.OFF
        return None
    answer = (yield from ask(mount, "GW")) if mount.has_status else None
    if answer is not None:
        tracks = answer["tracking"] == "T"
        if answer["build"] == "L":
            mount.in_land_mode = True
        elif answer["build"] in "PG" or mount.mounting == "A":
            _note_mounting(mount, answer["build"])
        else:
            mount.in_land_mode = yield from _in_land_mode(mount)
            if not mount.in_land_mode:
                _note_mounting(mount, answer["build"])
        mount.in_land_mode = mount.in_land_mode and not (tracks and mount.goto is None)
        mount.aligned = answer["aligned"] not in "0"
        mount.powerless = mount.powerless and not tracks  # the user has woken it on the hand control
    else:
        answer = yield from _probe(mount, "ACK")
        if answer is None:
            mount.aligned, mount.tracking = True, Tracking.OFF if mount.parked else native_mode(mount)
            return None
        _note_mounting(mount, answer["mode"])
        mount.aligned, tracks = True, answer["mode"] != "L" and not mount.parked
    if not (mount.has_status and (mount.moving or mount.goto is not None)):
        mount.tracking = native_mode(mount) if tracks else Tracking.OFF
    return None


def _in_land_mode(mount: Lx200Driver) -> Steps:
    """ACK -> whether the alignment mode is L (land).

    A polar telescope in land mode may report the mounting A in ``:GW#``, and T (tracking) while it slews. So the
    mounting reported before counts. The alignment mode is A only if the user has taken the telescope off its wedge.
    """
    answer = yield from _probe(mount, "ACK")
    return answer is not None and answer["mode"] == "L"


def native_mode(mount: Lx200Driver) -> Tracking:
    return mount.equatorial_mode if mount.equatorial else Tracking.ALTAZ


def status(mount: Lx200Driver, _: GetStatus) -> Steps:
    """Return Status by :GW, :GU or ACK. A mount pushed by hand is asked :D too: without bars it counts as motorised."""
    try:
        mount.pushed_by_hand = mount.pushed_by_hand and bool((yield from ask(mount, "D"))["bars"].strip())
        yield from read_status(mount)
    except Fault:
        if mount.goto is None:  # some do not answer this while they slew
            raise
    return Status(
        tracking=mount.tracking,
        aligned=mount.aligned,
        equatorial=mount.equatorial,
        wedge=mount.equatorial and not mount.german,
    )
