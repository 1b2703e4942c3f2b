"""Tracking: the mode, its rate, and what a hand control calls them.

Tracking is a pair, mode and rate. Fast motion overrides it on the mount, so it is suspended as a whole before the first
axis moves and put back once after the last one has stopped (NexStar protocol, Slewing Commands, note).
"""

from __future__ import annotations

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.core import operations as op
from gateway.core.errors import NoDevice, Refused, Unsupported
from gateway.protocols.base.driver import Remark, Schedule, Send, Steps
from gateway.protocols.nexstar.counting import DRIVE_CODES
from gateway.protocols.nexstar.driver.state import NexStar
from gateway.protocols.nexstar.versions import code_of, modes

#: What the motors' own drive rates turn at, arcseconds a second.
_DRIVES = {"sidereal": SIDEREAL_ARCSECONDS, "solar": 15.0, "lunar": 14.685}
_ASSUMED = (
    "the hand control does not tell how it tracks: after motion it is put back to {}, as the mount is built; "
    "where that is wrong, say it by the key mode"
)
VERIFY_AFTER = 1.0


def mode_of(mount: NexStar, code: int) -> op.Tracking:
    """What the answer of ``t`` means. An unknown code (4 is seen on some) counts as equatorial."""
    return modes(mount.facts, mount.version).get(code, mount.equatorial_mode)


def _tell(mount: NexStar, mode: op.Tracking) -> Steps:
    """``T``, after which the drive goes at the hand control's own rate."""
    yield Send("T", {"mode": code_of(mode, mount.facts, mount.version)})
    mount.drive = "own"


def read_status(mount: NexStar) -> Steps:
    """Ask ``J`` and, where the version has it, ``t``."""
    answer = yield Send("J")
    if mount.aligned and not answer["aligned"]:
        _forget(mount)
    mount.aligned = bool(answer["aligned"])
    if not mount.aligned or mount.supports("s"):
        mount.offset = (0.0, 0.0)
    if mount.supports("t"):
        answer = yield Send("t")
        _learn(mount, mode_of(mount, answer["mode"]))
    elif mount.tracking is None and mount.settings.mode is not None:
        _learn(mount, op.Tracking(mount.settings.mode))


def _forget(mount: NexStar) -> None:
    """A hand control that lost its alignment was switched off: what it was doing is over, how it tracked unknown."""
    mount.at_rest()
    mount.suspended = mount.native_mode = None
    mount.in_doubt = False
    mount.checks_left = 0


def _learn(mount: NexStar, mode: op.Tracking) -> None:
    mount.tracking = mode
    if mode is not op.Tracking.OFF:
        mount.native_mode = mode


def native_mode(mount: NexStar) -> op.Tracking | None:
    """The mode this mount tracks in: the last one that was not off, else how it is built; None when unknown."""
    if mount.native_mode is not None:
        return mount.native_mode
    if not mount.supports("t") and mount.settings.mode is None:
        return None
    return _built_for(mount)


def _built_for(mount: NexStar) -> op.Tracking:
    return mount.equatorial_mode if mount.german else op.Tracking.ALTAZ


def status(mount: NexStar, _: op.GetStatus) -> Steps:
    """-> Status. While fast motion has put tracking off, the mode it will come back to counts."""
    yield from read_status(mount)
    known = native_mode(mount)
    equatorial = known.equatorial if known is not None else mount.german
    mode = mount.suspended or mount.tracking or op.Tracking.OFF
    if known is None and mount.tracking is None and mount.aligned:
        # one that cannot say tracks as it is built: what is aligned, tracks
        mode = _built_for(mount)
    return op.Status(tracking=mode, aligned=mount.aligned, equatorial=equatorial, wedge=equatorial and not mount.german)


def send_mode(mount: NexStar, mode: op.Tracking) -> Steps:
    """``T``, and the special rate again when tracking comes back. Off needs no mode, and so every ``T`` has it."""
    if not mount.supports("T"):
        raise Unsupported("This hand control cannot change tracking.")
    if mode is not op.Tracking.OFF and native_mode(mount) is None:
        yield Remark(_ASSUMED.format(mode.value))
    yield from _tell(mount, mode)
    _learn(mount, mode)
    if mode.equatorial and mount.rate.name != "sidereal":
        yield from _send_rate(mount)


def set_tracking(mount: NexStar, operation: op.SetTracking) -> Steps:
    """On in the mount's own mode or in a mode asked for by name, or off.

    Alt-az and equatorial are two frames for the axes: what was checked in one of them must not arrive in the other, so
    a mount in motion keeps its own. Raises Refused.
    """
    own = native_mode(mount)
    mode = (operation.mode or own or _built_for(mount)) if operation.on else op.Tracking.OFF
    if mode is op.Tracking.ALTAZ and mount.german:
        raise Unsupported("A German mount does not track in alt-az: it passes over that mode.")
    moves = mount.moving or mount.goto is not None or mount.suspended is not None
    if moves and operation.on and own is not None and mode.equatorial != own.equatorial:
        raise Refused("The mount moves: between alt-az and equatorial it changes only at rest.")
    mount.parked = mount.parked and not operation.on
    mount.checks_left, mount.woken = 0, False
    if mount.suspended is not None:
        mount.suspended = mode
        return
    yield from send_mode(mount, mode)


def suspend(mount: NexStar) -> Steps:
    """Before fast motion: remember what the mount does now, once, and put tracking off.

    -> the seconds that this order took, None where nothing was to be put off.
    """
    if mount.suspended is not None or not mount.supports("T"):
        return None
    if mount.supports("t"):
        answer = yield Send("t")
        _learn(mount, mode_of(mount, answer["mode"]))
    mount.suspended = mount.tracking or (_built_for(mount) if mount.aligned else op.Tracking.OFF)
    if mount.suspended is op.Tracking.OFF:
        return None
    began = mount.now()
    yield from _tell(mount, op.Tracking.OFF)
    mount.tracking = op.Tracking.OFF
    return mount.now() - began


def resume(mount: NexStar) -> Steps:
    """After the last axis has stopped: back to what was suspended, and look a second later whether it took."""
    mode = mount.suspended
    if mode is None or mode is op.Tracking.OFF:
        mount.suspended = None
        return
    if mount.in_doubt and not (yield Send("J"))["aligned"]:
        mount.suspended = None  # it has been switched off since the last run: it must not begin to track by itself
        return
    yield from send_mode(mount, mode)
    mount.in_doubt = False
    mount.suspended = None  # not before: what is lost here must be resumed by the next one
    mount.checks_left = 1
    if mount.supports("t"):
        yield Schedule(VERIFY_AFTER, VerifyTracking(mode=mode.value))


def keep_rate(mount: NexStar) -> Steps:
    """A gentle motion ends with rate 0 to the motor: a drive rate that is not the hand control's own is sent again.

    So is any where a variable rate took the place of tracking.
    """
    mode = mount.tracking or op.Tracking.OFF
    if mode.equatorial and mount.suspended is None and (mount.drive != "own" or mount.rate.name != "sidereal"):
        yield from _send_rate(mount)


class VerifyTracking(op.Operation, frozen=True):
    """Internal: a hand control may ignore ``T`` sent right after motion."""

    survives_abort = True

    mode: str


def verify(mount: NexStar, operation: VerifyTracking) -> Steps:
    """``t`` a second later; once more ``T`` if it did not take."""
    if mount.moving or mount.riding or mount.goto is not None or mount.checks_left == 0 or mount.parked:
        return
    mount.checks_left -= 1
    wanted = op.Tracking(operation.mode)
    answer = yield Send("t")
    if mode_of(mount, answer["mode"]) is not wanted:
        yield from send_mode(mount, wanted)


def track_rate(mount: NexStar, operation: op.TrackRate) -> Steps:
    """Sidereal by ``T``; the named rates by the motor's own codes; any other one as fine as the motor takes it."""
    mode = native_mode(mount)
    if mode is None or not mode.equatorial or not mount.supports("rate_azm_pos"):
        if operation.name == "sidereal":
            mount.rate = operation
            return
        raise Unsupported("This mount follows the sky by both axes, at the sidereal rate alone.")
    mount.rate = operation
    if mount.goto is not None:
        return  # it would end the goto of one axis; it is sent when the goto is over
    if mount.suspended is not None or (mount.tracking or op.Tracking.OFF) is op.Tracking.OFF:
        return  # it is sent when tracking comes back
    if operation.name == "sidereal":
        yield from _tell(mount, mode)
    else:
        yield from _send_rate(mount)


def drive_rate(mount: NexStar, _: op.DriveRate) -> Steps:
    """-> float: what it tracks at when it tracks, a multiple of sidereal. No hand control tells it."""
    yield from ()  # a generator like all others
    return abs(drive_speed(mount)) * 3600.0 / SIDEREAL_ARCSECONDS


def drive_speed(mount: NexStar) -> float:
    """How fast its drive turns the motor in right ascension, degrees a second, signed as the motor counts."""
    arcseconds = _DRIVES.get(mount.rate.name or "", SIDEREAL_ARCSECONDS * (mount.rate.factor or 0.0))
    return (-arcseconds if mount.native_mode is op.Tracking.EQ_SOUTH else arcseconds) / 3600.0


def _send_rate(mount: NexStar) -> Steps:
    sense = "neg" if mount.native_mode is op.Tracking.EQ_SOUTH else "pos"
    if mount.rate.name is not None:
        yield Send(f"rate_azm_{sense}", {"rate": DRIVE_CODES[mount.rate.name]})
        mount.drive = "told"
        return
    arcseconds = SIDEREAL_ARCSECONDS * (mount.rate.factor or 0.0)
    try:
        yield Send(f"fine_rate_{sense}", {"device": 16, "rate": round(arcseconds * 1024)})
    except NoDevice:
        yield Send(f"rate_azm_{sense}", {"rate": rate_code(arcseconds)})
    mount.drive = "told"


def rate_code(arcseconds: float) -> int:
    """A variable rate as its 16-bit number, which must never reach the tracking codes 0xFFFD-0xFFFF."""
    return min(round(arcseconds * 4), 0xFFFC)


def guide_rate(mount: NexStar, operation: op.GuideRate) -> Steps:
    """-> the autoguide rate as a fraction of sidereal (AUX 0x47)."""
    answer = yield Send("guide_rate", {"device": 15 + operation.axis})
    return answer["rate"] / 256.0


def set_guide_rate(mount: NexStar, operation: op.SetGuideRate) -> Steps:
    """AUX 0x46; whatever is guided through here goes by it too, also where the motors have no such setting."""
    mount.guide_rates[operation.axis] = max(0.0, min(1.0, operation.rate))
    value = max(0, min(255, round(operation.rate * 256)))
    try:
        yield Send("set_guide_rate", {"device": 15 + operation.axis, "rate": value})
    except NoDevice as fault:
        raise Unsupported("The motors keep no guide rate; what is guided through the gateway goes at it.") from fault
