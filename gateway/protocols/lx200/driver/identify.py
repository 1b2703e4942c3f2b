"""Finding out which Meade this is: ACK first, then its name; silence means a classic LX200."""

from __future__ import annotations

from gateway.driver import Ask, Steps
from gateway.errors import Fault, Silence
from gateway.operations import GetStatus, Identity, Operation, Status, Tracking
from gateway.protocols.lx200.driver.state import Meade, ask

PROBE = 1.5
#: The length of a right ascension in high precision.
HIGH = len("HH:MM:SS#")


def identity(mount: Meade, _: Operation) -> Steps:
    """ACK, :GVP, :GVN, :GW, :GR -> Identity."""
    mount.power_on()
    letter = yield from _probe("ACK")
    if letter is not None:
        _learn_letter(mount, letter["mode"])
        mount.land = letter["mode"] == "L"
    product = yield from _probe("GVP")
    mount.product = product["product"] if product else ""
    if mount.named_model is None:
        mount.model = yield from _model(mount.product)
    if product:
        firmware = yield from _probe("GVN")
        mount.firmware = firmware["firmware"] if firmware else ""
        mount.tells_status = (yield from _probe("GW")) is not None
        mount.more = frozenset({"GW"}) if mount.tells_status else frozenset()
    yield from high_precision(mount)
    yield from read_status(mount)
    return Identity(product=mount.product or "LX200", version=mount.firmware or "?", model=mount.model or "autostar")


def _probe(command: str) -> Steps:
    """A question that may stay unanswered -> its fields or None."""
    try:
        return (yield Ask(command, patience=PROBE))
    except Silence:
        return None


def _model(product: str) -> Steps:
    """The model that a product text stands for; a nameless one is a classic, one with a home is the 16 inch."""
    if product.startswith("LX2001"):
        return "lx200gps"
    if product.startswith("LX200 16"):
        return "lx200-16"
    if product.startswith("LX200 "):
        return "lx200"
    if product:
        return "autostar"
    return "lx200-16" if (yield from _probe("h?")) is not None else "lx200"


def high_precision(mount: Meade) -> Steps:
    """Make sure once: read, toggle if the answer is short, read again."""
    for _ in range(2):
        answer = yield from ask(mount, "GR")
        mount.low = answer["length"] < HIGH
        if not mount.low:
            return
        yield from ask(mount, "U")
    answer = yield from ask(mount, "GR")
    mount.low = answer["length"] < HIGH


def _learn_letter(mount: Meade, letter: str) -> None:
    mount.letter = letter
    if letter != "L":
        mount.home_letter = letter


def read_status(mount: Meade) -> Steps:
    """:GW where the telescope knows it, else ACK."""
    if mount.tells_status:
        answer = yield from ask(mount, "GW")
        tracks = answer["tracking"] == "T"
        if answer["build"] in "PG" or mount.home_letter == "A":
            _learn_letter(mount, answer["build"])
        else:
            mount.land = yield from _in_land_mode()
            if not mount.land:
                _learn_letter(mount, answer["build"])
        mount.land = mount.land and not (tracks and mount.goto is None)
        mount.aligned = answer["aligned"] not in "0"
        mount.asleep_as_told = mount.asleep_as_told and not tracks  # somebody has woken it at its keys
    else:
        answer = yield from _probe("ACK")
        if answer is None:
            return None
        _learn_letter(mount, answer["mode"])
        mount.aligned, tracks = True, answer["mode"] != "L" and not mount.parked
    mount.tracking = native_mode(mount) if tracks else Tracking.OFF
    return None


def _in_land_mode() -> Steps:
    """Whether the alignment mode is L.

    Of a polar telescope whose tracking is off for that reason, ``:GW#`` may tell an A, and a T while it slews. How it
    stands is then what it said before; if somebody has taken it off its wedge, the alignment mode is an A.
    """
    answer = yield from _probe("ACK")
    return answer is not None and answer["mode"] == "L"


def native_mode(mount: Meade) -> Tracking:
    """The mode this telescope tracks in."""
    if not mount.equatorial:
        return Tracking.ALTAZ
    return Tracking.EQ_SOUTH if mount.southern else Tracking.EQ_NORTH


def status(mount: Meade, _: GetStatus) -> Steps:
    """-> Status."""
    try:
        yield from read_status(mount)
    except Fault:
        if mount.goto is None:  # some are mute to this while they slew
            raise
    return Status(tracking=mount.tracking, aligned=mount.aligned, equatorial=mount.equatorial,
                  wedge=mount.equatorial and not mount.german)
