"""Finding out which Meade this is: where it points first, then its name; silence means a classic LX200.

Whatever tells where it points is a telescope. All else may stay unanswered, or be answered in a form that nobody knows:
then it can do less. What was not answered is not asked again before the line comes up anew.
"""

from __future__ import annotations

from gateway.astro.spherical import fold_declination
from gateway.core.errors import Fault, Garbled, NoAnswer, Silence
from gateway.core.operations import Equatorial, GetStatus, Identity, Operation, Status, Tracking
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.lx200.driver.state import OWN_PATIENCE, Lx200Driver, ask

#: A question that may stay unanswered is waited for so many times longer than two answers took, and at least so long.
TIMES, AT_LEAST = 2.0, 0.6
#: The length of a right ascension in high precision.
HIGH = len("HH:MM:SS#")


def contact(mount: Lx200Driver, _: object = None) -> Steps:
    """ACK, :GR and :GD in high precision -> Equatorial: from then on programs can be told where it points."""
    mount.power_on()
    mount.mute, mount.quick = frozenset(), OWN_PATIENCE
    yield from _probe(mount, "ACK", light=True)
    began = mount.now()
    first = yield from high_precision(mount)
    since = mount.now()
    second = yield from ask(mount, "GD")
    mount.read_at = since, mount.now()
    mount.quick, mount.met = min(OWN_PATIENCE, since - began, mount.now() - since), True
    return Equatorial(*fold_declination(first["ra"], second["dec"]))


def identity(mount: Lx200Driver, _: Operation) -> Steps:
    """ACK, :GVP, :GVN, :GW -> Identity."""
    if not mount.met:
        yield from contact(mount)
    mount.met = False
    letter = yield from _probe(mount, "ACK")
    if letter is not None:
        _learn_letter(mount, letter["mode"])
        mount.land = letter["mode"] == "L"
    product = yield from _name(mount)
    mount.product = product["product"] if product else ""
    if mount.named_model is None:
        mount.model = yield from _model(mount, mount.product)
    mount.tells_status = False
    if product:
        firmware = yield from _probe(mount, "GVN")
        mount.firmware = firmware["firmware"] if firmware else ""
        mount.tells_status = (yield from _probe(mount, "GW")) is not None
    mount.more = frozenset({"GW"} if mount.tells_status else ())
    try:
        yield from read_status(mount)
    except Fault as fault:  # whatever it says of that, it is there
        if isinstance(fault, NoAnswer) and not isinstance(fault, Garbled):
            raise
    return Identity(product=mount.product or "LX200", version=mount.firmware or "?", model=mount.model or "autostar")


def _name(mount: Lx200Driver) -> Steps:
    """The name, asked for twice where the model hangs on it: one question may have been lost on its way."""
    product = yield from _probe(mount, "GVP")
    if product is None and mount.named_model is None:
        mount.mute -= {"GVP"}
        product = yield from _probe(mount, "GVP")
    return product


def _probe(mount: Lx200Driver, command: str, light: bool = False) -> Steps:
    """A question that need not be answered -> its fields or None. Raises NoAnswer where the line is down."""
    if command in mount.mute:
        return None
    try:
        patience = min(OWN_PATIENCE, max(AT_LEAST, TIMES * mount.quick))
        return (yield Send(command, patience=patience, light=light))
    except (Garbled, Silence):
        mount.mute |= {command}
    except Fault as fault:  # one that is busy will know the answer when it has time for it
        if isinstance(fault, NoAnswer):
            raise
    return None


def _model(mount: Lx200Driver, product: str) -> Steps:
    """The model that a product text stands for; a nameless one is a classic, one with a home is the 16 inch."""
    if product.startswith(("LX2001", "LX200GPS")):
        return "lx200gps"
    if product.startswith("LX200 16"):
        return "lx200-16"
    if product.startswith("LX200 "):
        return "lx200"
    if product:
        return "autostar"
    return "lx200-16" if (yield from _probe(mount, "h?")) is not None else "lx200"


def high_precision(mount: Lx200Driver) -> Steps:
    """Make sure once: read, toggle if the answer is short, read again -> the last answer."""
    for attempt in range(3):
        if attempt:
            yield from ask(mount, "U")
        answer = yield from ask(mount, "GR")
        mount.low = answer["length"] < HIGH
        if not mount.low:
            break
    return answer


def _learn_letter(mount: Lx200Driver, letter: str) -> None:
    if letter != "L":
        mount.home_letter = letter


def read_status(mount: Lx200Driver) -> Steps:
    """:GW where the telescope knows it, else ACK; where it knows neither, it is taken to be aligned and to track.

    In motion a Meade tells what its motors do: under a key that it does not track, for a moment of a goto that it does.
    How it goes on afterwards is what it said at rest.
    """
    if mount.product and not mount.tells_status and "GW" not in mount.mute:  # it was too busy to tell
        mount.tells_status = (yield from _probe(mount, "GW")) is not None
    answer = (yield from ask(mount, "GW")) if mount.tells_status else None
    if answer is not None:
        tracks = answer["tracking"] == "T"
        if answer["build"] == "L":
            mount.land = True
        elif answer["build"] in "PG" or mount.home_letter == "A":
            _learn_letter(mount, answer["build"])
        else:
            mount.land = yield from _in_land_mode(mount)
            if not mount.land:
                _learn_letter(mount, answer["build"])
        mount.land = mount.land and not (tracks and mount.goto is None)
        mount.aligned = answer["aligned"] not in "0"
        mount.powerless = mount.powerless and not tracks  # somebody has woken it at its keys
    else:
        answer = yield from _probe(mount, "ACK")
        if answer is None:
            mount.aligned, mount.tracking = True, Tracking.OFF if mount.parked else native_mode(mount)
            return None
        _learn_letter(mount, answer["mode"])
        mount.aligned, tracks = True, answer["mode"] != "L" and not mount.parked
    if not (mount.tells_status and (mount.moving or mount.goto is not None)):
        mount.tracking = native_mode(mount) if tracks else Tracking.OFF
    return None


def _in_land_mode(mount: Lx200Driver) -> Steps:
    """Whether the alignment mode is L.

    Of a polar telescope whose tracking is off for that reason, ``:GW#`` may tell an A, and a T while it slews. How it
    stands is then what it said before; if somebody has taken it off its wedge, the alignment mode is an A.
    """
    answer = yield from _probe(mount, "ACK")
    return answer is not None and answer["mode"] == "L"


def native_mode(mount: Lx200Driver) -> Tracking:
    return mount.equatorial_mode if mount.equatorial else Tracking.ALTAZ


def status(mount: Lx200Driver, _: GetStatus) -> Steps:
    """-> Status."""
    try:
        yield from read_status(mount)
    except Fault:
        if mount.goto is None:  # some are mute to this while they slew
            raise
    return Status(
        tracking=mount.tracking,
        aligned=mount.aligned,
        equatorial=mount.equatorial,
        wedge=mount.equatorial and not mount.german,
    )
