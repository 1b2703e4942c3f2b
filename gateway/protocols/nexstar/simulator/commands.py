"""The hand control's own commands, one function each: position, goto, sync, tracking, and who it is.

A handler gives the values of the reply, if it has any; most are a bare ``#`` whatever was done. Like the real one,
an impossible request is acknowledged and not carried out, and without an alignment only motor positions mean
anything.
"""

from __future__ import annotations

from gateway.astro.axes import Build
from gateway.astro.spherical import wrap180
from gateway.core.operations import Values
from gateway.protocols.nexstar.simulator.mount import ALTAZ, EQ_NORTH, EQ_SOUTH, OFF, Handler, SimulatedMount
from gateway.protocols.nexstar.versions import NEXSTAR_VARIANT, STARSENSE_VARIANT
from gateway.protocols.wireformat.rows import Version

#: Slew limits of a fork, degrees of altitude.
LOWEST, HIGHEST = -5.0, 90.0
#: Up to this version ``p`` tells the side in the northern way, also in the southern hemisphere.
NORTHERN_LETTERS: Version = (5, 24)


def position(sim: SimulatedMount, _: Values) -> Values:
    """``E`` ``e``."""
    ra, dec = sim.mechanics.believed(sim.now)
    return {"ra": ra, "dec": dec}


def axes(sim: SimulatedMount, _: Values) -> Values:
    """``Z`` ``z``: azimuth and altitude, on polar mounts the motor axes."""
    az, alt = sim.encoders()
    return {"az": az, "alt": alt}


def goto(sim: SimulatedMount, values: Values) -> None:
    """``R`` ``r``: nothing without an alignment, nothing beyond a fork's slew limits."""
    if sim.aligned:
        hour_angle = wrap180(sim.mechanics.sky.sidereal(sim.now) - values["ra"])
        if _allowed(sim, sim.mechanics.geometry.axes(hour_angle, values["dec"], flipped=False)[1]):
            sim.mechanics.goto_sky(sim.now, values["ra"], values["dec"])


def goto_axes(sim: SimulatedMount, values: Values) -> None:
    """``B`` ``b``: works without an alignment too, from where the mount was powered on."""
    if _allowed(sim, values["alt"]):
        first, second = sim.encoder_offset
        sim.mechanics.goto_axes(sim.now, values["az"] - first, values["alt"] - second)


def _allowed(sim: SimulatedMount, altitude: float) -> bool:
    return sim.mechanics.build is not Build.ALTAZ or LOWEST <= altitude <= HIGHEST


def sync(sim: SimulatedMount, values: Values) -> None:
    """``S`` ``s``: from now on RA/Dec is read and sought relative to this; the motor positions stay."""
    if sim.aligned:
        sim.mechanics.sync(sim.now, values["ra"], values["dec"])


def undo_sync(sim: SimulatedMount, _: Values) -> None:
    """``u``: back to the alignment itself."""
    if sim.aligned:
        sim.mechanics.correct(sim.now, (0.0, 0.0))


def cancel(sim: SimulatedMount, _: Values) -> None:
    """``M``: a goto ends; hand motion does not."""
    sim.mechanics.cancel(sim.now)


def get_mode(sim: SimulatedMount, _: Values) -> Values:
    """``t``."""
    return {"mode": sim.mode - 1 if sim.shifted and sim.mode else sim.mode}


def set_mode(sim: SimulatedMount, values: Values) -> None:
    """``T``: EQ modes put a fork on its wedge; a German mount has no alt-az tracking."""
    mode = values["mode"]
    mode = mode + 1 if sim.shifted and mode else mode
    possible = (OFF, EQ_NORTH, EQ_SOUTH) if sim.german else (OFF, ALTAZ, EQ_NORTH, EQ_SOUTH)
    if sim.aligned and mode in possible:
        sim.track(mode)


def pier_side(sim: SimulatedMount, _: Values) -> Values:
    """``p``: by the hour angle of the last goto; a fork is always E."""
    west = sim.german and sim.mechanics.flipped
    if sim.german and sim.mechanics.geometry.pole < 0 and sim.version > NORTHERN_LETTERS:
        west = not west
    return {"side": "W" if west else "E"}


def hibernate(sim: SimulatedMount, _: Values) -> None:
    """``x``: everything stops; only ``y``, ``K`` and ``V`` are answered until waking."""
    sim.mechanics.cancel(sim.now)
    sim.mechanics.track(sim.now, on=False)
    sim.asleep = True


def wake(sim: SimulatedMount, _: Values) -> None:
    """``y``: tracking comes back in its mode."""
    if sim.asleep:
        sim.asleep = False
        sim.track(sim.mode)


COMMANDS: dict[str, Handler] = {
    "E": position,
    "e": position,
    "Z": axes,
    "z": axes,
    "R": goto,
    "r": goto,
    "B": goto_axes,
    "b": goto_axes,
    "S": sync,
    "s": sync,
    "u": undo_sync,
    "M": cancel,
    "t": get_mode,
    "T": set_mode,
    "p": pier_side,
    "x": hibernate,
    "y": wake,
    "L": lambda sim, _: {"slewing": "1" if sim.mechanics.slewing(sim.now) else "0"},
    "J": lambda sim, _: {"aligned": int(sim.aligned)},
    "K": lambda sim, values: values,
    "V": lambda sim, _: {"major": sim.shown_version[0], "minor": sim.shown_version[1]},
    "v": lambda sim, _: {"variant": STARSENSE_VARIANT if sim.starsense else NEXSTAR_VARIANT},
    "m": lambda sim, _: {"model": sim.row["id"]},
}
