"""Tracking of a NexStar: its mode and its rate, which are always suspended and resumed together.

Fast motion overrides tracking on the mount. So the driver suspends it before the first axis moves and resumes it once
after the last one has stopped (NexStar protocol, Slewing Commands, note).
"""

from __future__ import annotations

import contextlib

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S
from gateway.core import operations as op
from gateway.core.errors import NoAnswer, NoDevice, Refused, Unsupported
from gateway.protocols.base.driver import Remark, Schedule, Send, Steps
from gateway.protocols.nexstar.counting import DRIVE_CODES
from gateway.protocols.nexstar.driver.state import NexStar
from gateway.protocols.nexstar.versions import mode_code, modes_by_code

#: Speeds of the motors' own drive rates, arcseconds a second.
_DRIVE_SPEEDS = {"sidereal": SIDEREAL_ARCSEC_PER_S, "solar": 15.0, "lunar": 14.685}
_ASSUMED_MODE_REMARK = (
    "the hand control does not report its tracking mode: after motion the gateway turns on {}, which fits the mount's "
    "type; if that is wrong, set the key mode"
)
#: Seconds after ``T`` at which ``t`` is read to check it.
VERIFY_DELAY = 1.0


def _set_mode(mount: NexStar, mode: op.Tracking) -> Steps:
    """Send ``T``, after which the drive runs at the hand control's own rate.

    If the mount already uses a byte of this mode, it gets the same byte: two bytes may mean one mode. A SynScan's 3
    corrects the periodic error, its 2 does not.
    """
    known = modes_by_code(mount.model_facts, mount.version)
    own_code = mount.mode_code in known and _mode_of(mount, mount.mode_code) is mode
    yield Send("T", {"mode": mount.mode_code if own_code else mode_code(mode, mount.model_facts, mount.version)})
    mount.drive = "own"


def _mode_of(mount: NexStar, code: int | None) -> op.Tracking:
    """Return the mode for a byte of ``t``: off for None, equatorial for an unknown byte (4 occurs on some mounts)."""
    return modes_by_code(mount.model_facts, mount.version).get(code or 0) or mount.equatorial_mode


def read_status(mount: NexStar) -> Steps:
    """Record the alignment (``J``) and mode (``t``, else the configured one). If alignment was lost, forget motion."""
    answer = yield Send("J")
    if mount.aligned and not answer["aligned"]:
        _forget_motion(mount)
    mount.aligned = bool(answer["aligned"])
    if not mount.aligned or mount.supports("s"):
        mount.sync_offset = (0.0, 0.0)
    if mount.supports("t"):
        yield from _read_mode(mount)
        if mount.mounting_unknown and mount.settings.mode is not None:
            mount.native_mode = op.Tracking(mount.settings.mode)
    elif mount.tracking is None and mount.settings.mode is not None:
        _note_mode(mount, op.Tracking(mount.settings.mode))
    if mount.native_mode is op.Tracking.ALTAZ and mount.german:  # an AZ-EQ of Sky-Watcher, which is either
        mount.model = mount.model_facts.get("alt-az", mount.model)


def _forget_motion(mount: NexStar) -> None:
    """Forget motion, tracking and drive rate: a hand control that lost its alignment has been switched off."""
    mount.record_at_rest()
    mount.suspended_mode = mount.native_mode = mount.mode_code = None
    mount.record_alignment_lost()
    mount.resume_needs_alignment = False
    mount.mode_checks_left = 0


def _note_mode(mount: NexStar, mode: op.Tracking) -> None:
    mount.tracking = mode
    if mode is not op.Tracking.OFF:
        mount.native_mode = mode


def native_mode(mount: NexStar) -> op.Tracking | None:
    """Return the mode in which this mount tracks: the last mode except off, else that of its build; None if unknown."""
    if mount.native_mode is not None:
        return mount.native_mode
    if mount.mounting_unknown or (not mount.supports("t") and mount.settings.mode is None):
        return None
    return _mode_by_build(mount)


def _mode_by_build(mount: NexStar) -> op.Tracking:
    return mount.equatorial_mode if mount.german else op.Tracking.ALTAZ


def status(mount: NexStar, _: op.GetStatus) -> Steps:
    """Return the Status. While fast motion suspends tracking, the mode that will be resumed counts."""
    yield from read_status(mount)
    known = native_mode(mount)
    equatorial = known.equatorial if known is not None else mount.german
    mode = mount.suspended_mode or mount.tracking or op.Tracking.OFF
    if known is None and mount.tracking is None and mount.aligned:
        # the hand control cannot report its mode: an aligned hand control tracks, in the mode of its build
        mode = _mode_by_build(mount)
    wedge = equatorial and not mount.german
    code = mount.mode_code if mode is not op.Tracking.OFF and _mode_of(mount, mount.mode_code) is mode else None
    return op.Status(tracking=mode, aligned=mount.aligned, equatorial=equatorial, wedge=wedge, code=code)


def send_mode(mount: NexStar, mode: op.Tracking) -> Steps:
    """Send ``T``, and restore a special drive rate if the mode is equatorial. Raises Unsupported without ``T``."""
    if not mount.supports("T"):
        raise Unsupported("Tracking cannot be turned on or off on this hand control.")
    if mode is not op.Tracking.OFF and native_mode(mount) is None:
        yield Remark(_ASSUMED_MODE_REMARK.format(mode.value))
    yield from _set_mode(mount, mode)
    _note_mode(mount, mode)
    if mode.equatorial and mount.rate.name != "sidereal":
        yield from _send_drive_rate(mount)


def set_tracking(mount: NexStar, operation: op.SetTracking) -> Steps:
    """Turn tracking off, or on in the requested mode, by default the mount's native mode.
    A motion that was checked in alt-az must not continue equatorially, or the reverse: the axes mean other directions.
    So Refused is raised for such a change in motion; also if no mode is requested, and it is unknown whether the mount
    is set up in alt-az. Raises Unsupported for alt-az on a German mount, and without ``T``. ``T`` is not sent to a
    mount that already reports the mode, unless its drive was given another rate.
    """
    native = native_mode(mount)
    if operation.on and operation.mode is None:
        mount.check_mounting_known()
    mode = (operation.mode or native or _mode_by_build(mount)) if operation.on else op.Tracking.OFF
    if mode is op.Tracking.ALTAZ and mount.german and not mount.mounting_unknown:
        raise Unsupported("A German mount does not track in alt-az: it ignores that mode.")
    moves = mount.moving or mount.goto is not None or mount.suspended_mode is not None
    if moves and operation.on and native is not None and mode.equatorial != native.equatorial:
        raise Refused("The mount is moving: it can change between alt-az and equatorial tracking only at rest.")
    mount.parked = mount.parked and not operation.on
    mount.mode_checks_left, mount.was_woken = 0, False
    readable = operation.on and mount.suspended_mode is None and mount.supports("t") and mount.drive == "own"
    if readable and (yield from _read_mode(mount)) is mode and operation.code in (None, mount.mode_code):
        return
    mount.mode_code = mount.mode_code if operation.code is None else operation.code
    if mount.suspended_mode is not None:
        mount.suspended_mode = mode
        return
    yield from send_mode(mount, mode)


def suspend(mount: NexStar) -> Steps:
    """Before fast motion, note how the mount tracks and turn tracking off, unless that has been done already.

    Return the duration of the command in seconds; None if no command was sent.
    """
    if mount.suspended_mode is not None or not mount.supports("T"):
        return None
    if mount.supports("t"):
        yield from _read_mode(mount)
    mount.suspended_mode = mount.tracking or (_mode_by_build(mount) if mount.aligned else op.Tracking.OFF)
    if mount.suspended_mode is op.Tracking.OFF:
        return None
    began = mount.now()
    yield from _set_mode(mount, op.Tracking.OFF)
    mount.tracking, mount.suspended_at = op.Tracking.OFF, mount.sent_at
    return mount.now() - began


def resume(mount: NexStar) -> Steps:
    """After the last axis has stopped, resume suspended tracking; check it by ``t`` at once and a second later."""
    mode = mount.suspended_mode
    if mode is None or mode is op.Tracking.OFF:
        mount.suspended_mode = None
        return
    if mount.resume_needs_alignment and not (yield Send("J"))["aligned"]:
        mount.suspended_mode = None  # the mount has been switched off meanwhile and must not begin to track by itself
        return
    yield from send_mode(mount, mode)
    mount.resume_needs_alignment = False
    mount.suspended_mode = None  # not before ``T`` has succeeded: else the next call must try again
    mount.mode_checks_left = 1
    if mount.supports("t"):
        confirmed = False
        with contextlib.suppress(NoAnswer):  # the motion has ended, whatever becomes of this
            confirmed = (yield from _read_mode(mount)) is mode
        yield Schedule(VERIFY_DELAY, VerifyTracking(mode=mode.value, was_confirmed=confirmed))


def _read_mode(mount: NexStar) -> Steps:
    """Read ``t``; record and return the mode."""
    code: int = (yield Send("t"))["mode"]
    if code and mount.tracking in (None, op.Tracking.OFF) and mount.goto is None:
        mount.parked = False  # tracking was turned on at the mount itself
    _note_mode(mount, _mode_of(mount, code))
    mount.mode_code = code or mount.mode_code
    return mount.tracking


def resend_rate(mount: NexStar) -> Steps:
    """Send the drive rate again after motion at key 1 or 2, because the rate 0 that ends the motion ends this rate too.

    Needed if the rate is not the hand control's own, or if a variable rate has replaced tracking. Motors without codes
    for drive rates count quarters of an arcsecond: they track at the sidereal rate only after ``T``.
    """
    mode = mount.tracking or op.Tracking.OFF
    if mode.equatorial and mount.suspended_mode is None and (mount.drive != "own" or mount.rate.name != "sidereal"):
        yield from _send_drive_rate(mount)
        if mount.rate.name == "sidereal" and not mount.supports("fine_rate_pos"):
            yield from _set_mode(mount, mode)


class VerifyTracking(op.Operation, frozen=True):
    """Internal: check that ``T`` took effect, because a hand control may ignore it right after motion.

    ``was_confirmed``: ``t`` has shown the mode already, so whatever ``t`` shows now was chosen at the hand control.
    """

    survives_abort = True

    mode: str
    was_confirmed: bool = False


def verify_tracking(mount: NexStar, operation: VerifyTracking) -> Steps:
    """Read ``t``; send ``T`` again if ``t`` has never shown the wanted mode. In motion or parked, do nothing."""
    if mount.moving or mount.added_rates or mount.goto is not None or mount.mode_checks_left == 0 or mount.parked:
        return
    mount.mode_checks_left -= 1
    wanted = op.Tracking(operation.mode)
    if (yield from _read_mode(mount)) is not wanted and not operation.was_confirmed:
        yield from send_mode(mount, wanted)


def set_drive_rate(mount: NexStar, operation: op.TrackRate) -> Steps:
    """Set the drive rate: sidereal by ``T``, named rates by the motor's codes, others as finely as the motor allows.
    During a goto, and while tracking is off, the rate is only stored, and sent later. If the mode is not equatorial, or
    the hand control lacks motor rates, only the sidereal rate is accepted; any other raises Unsupported.
    """
    mode = native_mode(mount)
    if mode is None or not mode.equatorial or not mount.supports("rate_azm_pos"):
        if operation.name == "sidereal":
            mount.rate = operation
            return
        raise Unsupported("This mount tracks with both axes (alt-az), at the sidereal rate only.")
    mount.rate = operation
    if mount.goto is not None:
        return  # sent now it would end the goto of an axis; it is sent after the goto
    if mount.suspended_mode is not None or (mount.tracking or op.Tracking.OFF) is op.Tracking.OFF:
        return  # it is sent when tracking resumes
    if operation.name == "sidereal":
        yield from _set_mode(mount, mode)
    else:
        yield from _send_drive_rate(mount)


def drive_rate(mount: NexStar, _: op.DriveRate) -> Steps:
    """Return the drive rate as a multiple of sidereal: the last rate that was set; no hand control reports it."""
    yield from ()  # a generator like all others
    return abs(drive_speed(mount)) * 3600.0 / SIDEREAL_ARCSEC_PER_S


def drive_speed(mount: NexStar) -> float:
    """Return the speed of the right-ascension motor while tracking, degrees a second, signed as the motor counts."""
    arcseconds = _DRIVE_SPEEDS.get(mount.rate.name or "", SIDEREAL_ARCSEC_PER_S * (mount.rate.factor or 0.0))
    return (-arcseconds if mount.native_mode is op.Tracking.EQ_SOUTH else arcseconds) / 3600.0


def _send_drive_rate(mount: NexStar) -> Steps:
    sense = "neg" if mount.native_mode is op.Tracking.EQ_SOUTH else "pos"
    arcseconds = abs(drive_speed(mount)) * 3600.0
    if not mount.supports("fine_rate_pos"):  # nor does it have the codes
        yield Send(f"rate_azm_{sense}", {"rate": rate_code(arcseconds)})
        mount.drive = "special"
        return
    if mount.rate.name is not None:
        yield Send(f"rate_azm_{sense}", {"rate": DRIVE_CODES[mount.rate.name]})
        mount.drive = "special"
        return
    try:
        yield Send(f"fine_rate_{sense}", {"device": 16, "rate": round(arcseconds * 1024)})
    except NoDevice:
        yield Send(f"rate_azm_{sense}", {"rate": rate_code(arcseconds)})
    mount.drive = "special"


def rate_code(arcseconds: float) -> int:
    """Return the code, 16 bits, of a rate in arcseconds a second; at most 0xFFFC: higher codes mean tracking rates."""
    return min(round(arcseconds * 4), 0xFFFC)


def guide_rate(mount: NexStar, operation: op.GuideRate) -> Steps:
    """Return the autoguide rate of an axis as a fraction of sidereal (AUX 0x47)."""
    answer = yield Send("guide_rate", {"device": 15 + operation.axis})
    return answer["rate"] / 256.0


def set_guide_rate(mount: NexStar, operation: op.SetGuideRate) -> Steps:
    """Set the guide rate by AUX 0x46. Raises Unsupported if the motors keep none; the gateway's pulses use it then."""
    mount.guide_rates[operation.axis] = max(0.0, min(1.0, operation.rate))
    value = max(0, min(255, round(operation.rate * 256)))
    try:
        yield Send("set_guide_rate", {"device": 15 + operation.axis, "rate": value})
    except NoDevice as fault:
        raise Unsupported("The motors keep no guide rate; guiding through the gateway uses the new one.") from fault
