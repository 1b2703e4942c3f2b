"""Tracking, drive rates, and what hangs on the mount: smart drive, backlash, focuser.

A drive rate has no reply, so the frequency that the telescope shows is read back; a guide rate cannot be. Tracking goes
off only where the telescope says what it does: elsewhere the letters that do it begin a new alignment.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.errors import Refused, Unsupported
from gateway.protocols.base.driver import Steps
from gateway.protocols.lx200.driver.ends import FOCUSER, begins, end
from gateway.protocols.lx200.driver.identify import native_mode, read_status
from gateway.protocols.lx200.driver.speeds import SIDEREAL_HERTZ
from gateway.protocols.lx200.driver.speeds import SIDEREAL_SHOWN as _SIDEREAL
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

_DRIVES = {"sidereal": "TQ", "solar": "TS", "lunar": "TL"}
#: Below what a telescope is taken to show the lunar rate, and from what on the sidereal one, hertz.
_LUNAR_BELOW, _LOOKS_SIDEREAL = 59.0, 60.0
#: Focuser speeds from here on are the fast one of a classic, which has two.
_FAST_FOCUS = 3


def set_tracking(mount: Lx200Driver, operation: op.SetTracking) -> Steps:
    """:AL and back, only on models that report :GW - elsewhere these letters destroy the alignment.

    What it does already is not sent, when it says so itself at this moment: somebody may have changed it at its keys,
    and in land mode it may tell T while it slews.
    """
    if (native_mode(mount) if operation.on else op.Tracking.OFF) is mount.tracking:
        yield from read_status(mount)
    wanted = native_mode(mount) if operation.on else op.Tracking.OFF
    if wanted is mount.tracking and not (operation.on and (mount.parked or mount.land)):
        return
    if not mount.tells_status:
        raise Unsupported("The mount keeps tracking: switching it off would destroy its alignment.")
    yield from ask(mount, "AL" if not operation.on else {"A": "AA", "P": "AP", "G": "AP"}[mount.home_letter])
    mount.tracking, mount.land = wanted, not operation.on


def rest(mount: Lx200Driver, _: op.Hibernate) -> Steps:
    """A telescope that cannot sleep: tracking off."""
    yield from set_tracking(mount, op.SetTracking(on=False))


def rise(mount: Lx200Driver, _: op.Wake) -> Steps:
    """A telescope that cannot sleep: tracking on."""
    yield from set_tracking(mount, op.SetTracking(on=True))


def track_rate(mount: Lx200Driver, operation: op.TrackRate) -> Steps:
    """:TQ :TS :TL, any other one in hertz: 60.1 to 60.2 is sidereal. Raises Refused beyond what the model drives at."""
    mount.driven = False
    hertz = round((operation.factor or 1.0) * SIDEREAL_HERTZ, 1)
    if operation.name is not None or _SIDEREAL[0] <= hertz <= _SIDEREAL[1]:
        mount.rate = operation
        yield from _named(mount, operation.name or "sidereal")
        return
    low, high = mount.facts["hertz"]
    if not low <= hertz <= high:
        raise Refused(f"The mount drives at {low} to {high} hertz: {hertz} is not done.")
    mount.rate = operation
    yield from drive_at(mount, hertz)


def drive_at(mount: Lx200Driver, hertz: float) -> Steps:
    """:ST, which a classic takes in manual mode only."""
    yield from ask(mount, "TM")
    yield from ask(mount, "ST", hertz=hertz)


def put_drive_back(mount: Lx200Driver) -> Steps:
    """The drive rate that was asked for last, when a motion in right ascension was done with another one."""
    if mount.driven:
        yield from track_rate(mount, mount.rate or op.TrackRate(name="sidereal"))


def drive_rate(mount: Lx200Driver, _: op.DriveRate) -> Steps:
    """-> float: what the telescope shows, a multiple of sidereal. Some show 60.0 for sidereal and solar alike."""
    shown: float = (yield from ask(mount, "GT"))["hertz"]
    solar = mount.rate is not None and mount.rate.name == "solar"
    return 1.0 if _LOOKS_SIDEREAL <= shown <= _SIDEREAL[1] and not solar else shown / SIDEREAL_HERTZ


def _named(mount: Lx200Driver, name: str) -> Steps:
    """Sent again once when the telescope does not show it: sidereal and solar look alike there, lunar does not."""
    for _ in range(2):
        yield from ask(mount, _DRIVES[name])
        shown = (yield from ask(mount, "GT"))["hertz"]
        if (shown < _LUNAR_BELOW) == (name == "lunar"):
            return
    raise Refused(f"The mount shows {shown} hertz instead of the {name} rate.")


def backlash(mount: Lx200Driver, operation: op.Backlash) -> Steps:
    """:$BA :$BZ on an LX200GPS."""
    yield from ask(mount, "$BZ" if operation.axis == 1 else "$BA", value=operation.value)


def periodic_error(mount: Lx200Driver, operation: op.PeriodicError) -> Steps:
    """:$QZ :$QA on an LX200GPS. A classic has one toggle for both axes, so what it does is remembered from power-on."""
    wanted = not mount.corrects if operation.on is None else operation.on
    if mount.supports("$QZ+"):
        for axis, letter in ((1, "Z"), (2, "A")):
            if operation.axis in (None, axis):
                yield from ask(mount, f"$Q{letter}{'+' if wanted else '-'}")
    elif wanted is not mount.corrects:
        yield from ask(mount, "$Q")
    mount.corrects = wanted


def focus(mount: Lx200Driver, operation: op.Focus) -> Steps:
    """:F, one of two speeds on a classic."""
    if operation.direction and mount.supports("F"):
        yield from ask(mount, "F", speed=operation.speed)
    elif operation.direction:
        yield from ask(mount, "FF" if operation.speed >= _FAST_FOCUS else "FS")
    if not operation.direction:
        moved, mount.focusing = mount.focusing, False
        yield from end(mount, "FQ", (FOCUSER,), moved)
        return
    begins(mount, FOCUSER)
    mount.focusing = True
    yield from ask(mount, {1: "F+", -1: "F-"}[operation.direction])
