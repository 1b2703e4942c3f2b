"""Tracking, drive rates, and accessories: smart drive (PEC), backlash, focuser.

Commands for drive rates have no reply, so the displayed frequency is read back; a guide rate cannot be read back.
Tracking is only turned off on telescopes that report it (:GW#): on others the command begins a new alignment.
"""

from __future__ import annotations

import math
from contextlib import suppress

from gateway.core import operations as op
from gateway.core.errors import Fault, Refused, Unsupported
from gateway.protocols.base.driver import Steps, Wait
from gateway.protocols.lx200.driver.ends import FOCUSER_AXIS, count_motion, end_motion
from gateway.protocols.lx200.driver.identify import native_mode, read_status
from gateway.protocols.lx200.driver.speeds import DRIVE_RATES, SIDEREAL_HERTZ
from gateway.protocols.lx200.driver.speeds import SIDEREAL_HERTZ_RANGE as _SIDEREAL
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

_COMMAND_BY_DRIVE_RATE = {"sidereal": "TQ", "solar": "TS", "lunar": "TL"}
#: Hertz: a displayed frequency below the first is the lunar rate, from the second on it is the sidereal rate.
_LUNAR_MAX_HERTZ, _SIDEREAL_MIN_HERTZ = 59.0, 60.0
#: Hertz: the lunar rate, and how far a displayed frequency may be from the rate that it means.
_LUNAR, _HZ_TOL = 57.9, 0.2
#: Seconds until a drive rate is read again before a motion replaces it.
_DRIVE_RATE_MAX_AGE = 60.0
_CANNOT_STOP_TRACKING = "The mount keeps tracking: switching it off would destroy its alignment."
#: At most how often the status is read until it shows that tracking was turned on or off, and the seconds between.
_STATUS_READS, _STATUS_READ_INTERVAL = 3, 0.5
#: From this focuser speed on, a classic uses the faster of its two speeds.
_FAST_FOCUS_MIN = 3


def set_tracking(mount: Lx200Driver, operation: op.SetTracking) -> Steps:
    """Turn tracking off (:AL) or on (:AA, :AP); another maker's mount has commands of its own.

    Raises Unsupported if the telescope reports no status (:GW): these commands would destroy its alignment. Nothing is
    sent if it already reports the requested state, which the user may have set on the hand control. In land mode that
    report is not trusted: it may be T during a slew. Raises Refused if the operation asks for confirmation (``heard``)
    and the reported state does not change.
    """
    if (native_mode(mount) if operation.on else op.Tracking.OFF) is mount.tracking:
        yield from read_status(mount)
    wanted = native_mode(mount) if operation.on else op.Tracking.OFF
    if wanted is mount.tracking and not (operation.on and (mount.parked or mount.in_land_mode)):
        return
    if not mount.has_status:
        raise Unsupported(_CANNOT_STOP_TRACKING)
    meade = {"on": {"A": "AA", "P": "AP", "G": "AP"}[mount.mounting], "off": "AL"}
    yield from ask(mount, mount.dialect.get("switch", meade)["on" if operation.on else "off"])
    mount.tracking, mount.in_land_mode = wanted, not operation.on
    for _ in range(_STATUS_READS if operation.heard else 0):
        yield from read_status(mount)
        if mount.tracking is wanted:
            return
        yield Wait(_STATUS_READ_INTERVAL)
    if operation.heard:
        state = "on" if operation.on else "off"
        raise Refused(f"The mount did not turn tracking {state}: it reports the same as before.")


def emulate_sleep(mount: Lx200Driver, _: op.Hibernate) -> Steps:
    """Turn tracking off instead of hibernating. Raises Unsupported, even if parked, for a mount without a status."""
    if not mount.has_status:
        raise Unsupported(_CANNOT_STOP_TRACKING)
    yield from set_tracking(mount, op.SetTracking(on=False))


def emulate_wake(mount: Lx200Driver, _: op.Wake) -> Steps:
    """Turn tracking on: the telescope cannot sleep, so ``emulate_sleep`` has only turned tracking off."""
    yield from set_tracking(mount, op.SetTracking(on=True))


def set_drive_rate(mount: Lx200Driver, operation: op.TrackRate) -> Steps:
    """Set the drive rate by :TQ :TS :TL, or in hertz (60.1-60.2: sidereal). Raises Refused beyond the model's range."""
    mount.drive_hertz_shown, mount.drive_rate_read_at = None, -math.inf
    yield from _send_drive_rate(mount, operation)


def _send_drive_rate(mount: Lx200Driver, operation: op.TrackRate) -> Steps:
    mount.drive_rate_changed = False
    hertz = round((operation.factor or 1.0) * SIDEREAL_HERTZ, 1)
    if operation.name is not None or _SIDEREAL[0] <= hertz <= _SIDEREAL[1]:
        mount.drive_rate = operation
        yield from _set_named_rate(mount, operation.name or "sidereal")
        return
    low, high = mount.facts["hertz"]
    if not low <= hertz <= high:
        raise Refused(f"The mount tracks at {low} to {high} hertz: {hertz} hertz is refused.")
    mount.drive_rate = operation
    yield from set_drive_hertz(mount, hertz)


def set_drive_hertz(mount: Lx200Driver, hertz: float) -> Steps:
    """Set the drive rate by :ST, on a Meade after :TM (manual mode). Tracking stays off if it was off."""
    if not mount.dialect:
        yield from ask(mount, "TM")
    yield from ask(mount, "ST", hertz=hertz)
    if mount.dialect and mount.tracking is op.Tracking.OFF:
        yield from ask(mount, mount.dialect["switch"]["off"])


def note_drive_rate(mount: Lx200Driver) -> Steps:
    """:GT - read the drive rate that a motion is about to replace, once a minute at most."""
    if mount.drive_rate_changed or mount.now() - mount.drive_rate_read_at < _DRIVE_RATE_MAX_AGE:
        return
    mount.drive_rate_read_at = mount.now()
    with suppress(Fault):
        mount.drive_hertz_shown = (yield from ask(mount, "GT"))["hertz"]


def restore_drive_rate(mount: Lx200Driver) -> Steps:
    """Restore the drive rate, if a motion in right ascension has changed it: to the last requested rate, or to the rate
    that the telescope showed before the motion if that was set at the hand control.
    """
    if not mount.drive_rate_changed:
        return
    asked, shown = mount.drive_rate or op.TrackRate(name="sidereal"), mount.drive_hertz_shown
    if shown is not None and not _hertz_fits_rate(shown, asked):
        name = next((name for name in _COMMAND_BY_DRIVE_RATE if _hertz_fits_rate(shown, op.TrackRate(name=name))), None)
        asked = op.TrackRate(name=name, factor=None if name else shown / SIDEREAL_HERTZ)
    yield from _send_drive_rate(mount, asked)


def _hertz_fits_rate(hertz: float, rate: op.TrackRate) -> bool:
    """Whether a telescope that tracks at this rate may display this frequency: some show sidereal and solar alike."""
    if rate.name is None:
        return abs(hertz - (rate.factor or 1.0) * SIDEREAL_HERTZ) < _HZ_TOL
    low, high = (_LUNAR - _HZ_TOL, _LUNAR + _HZ_TOL) if rate.name == "lunar" else (_SIDEREAL_MIN_HERTZ, _SIDEREAL[1])
    return low <= hertz <= high


def drive_rate(mount: Lx200Driver, _: op.DriveRate) -> Steps:
    """:GT - return the displayed rate as a multiple of sidereal; 60.0 is sidereal, unless solar was requested."""
    shown: float = (yield from ask(mount, "GT"))["hertz"]
    asked = mount.drive_rate or op.TrackRate(name="sidereal")
    if not shown:  # another maker's that does not track
        return asked.factor or DRIVE_RATES[asked.name or "sidereal"]
    solar = asked.name == "solar"
    return 1.0 if _SIDEREAL_MIN_HERTZ <= shown <= _SIDEREAL[1] and not solar else shown / SIDEREAL_HERTZ


def _set_named_rate(mount: Lx200Driver, rate_name: str) -> Steps:
    """Set a named rate and read it back, which only shows lunar or another. Raises Refused if it differs twice."""
    for _ in range(2):
        yield from ask(mount, _COMMAND_BY_DRIVE_RATE[rate_name])
        shown = (yield from ask(mount, "GT"))["hertz"]
        if not shown or (shown < _LUNAR_MAX_HERTZ) == (rate_name == "lunar"):
            return
    raise Refused(f"The mount shows {shown} hertz instead of the {rate_name} rate.")


def set_backlash(mount: Lx200Driver, operation: op.Backlash) -> Steps:
    """Set the backlash compensation of an axis by :$BA or :$BZ, which an LX200GPS has."""
    yield from ask(mount, "$BZ" if operation.axis == 1 else "$BA", value=operation.value)


def switch_pec(mount: Lx200Driver, operation: op.PeriodicError) -> Steps:
    """Turn PEC on or off by :$QZ :$QA. A classic can only toggle it (:$Q): its PEC is assumed to be off at power-on."""
    wanted = not mount.pec_axes if operation.on is None else operation.on
    axes = (1, 2) if operation.axis is None or not mount.supports("$QZ+") else (operation.axis,)
    if mount.supports("$QZ+"):
        for axis in axes:
            yield from ask(mount, f"$Q{'Z' if axis == 1 else 'A'}{'+' if wanted else '-'}")
    elif wanted is not bool(mount.pec_axes):
        yield from ask(mount, "$Q")
    mount.pec_axes = mount.pec_axes | set(axes) if wanted else mount.pec_axes - set(axes)


def focus(mount: Lx200Driver, operation: op.Focus) -> Steps:
    """Move or stop the focuser by :F+ :F- :FQ, after the command for its speed: :F, or on a classic :FF or :FS."""
    if operation.direction and mount.supports("F"):
        yield from ask(mount, "F", speed=operation.speed)
    elif operation.direction:
        yield from ask(mount, "FF" if operation.speed >= _FAST_FOCUS_MIN else "FS")
    if not operation.direction:
        was_moving, mount.focusing = mount.focusing, False
        yield from end_motion(mount, "FQ", (FOCUSER_AXIS,), was_moving)
        return
    count_motion(mount, FOCUSER_AXIS)
    mount.focusing = True
    yield from ask(mount, {1: "F+", -1: "F-"}[operation.direction])
