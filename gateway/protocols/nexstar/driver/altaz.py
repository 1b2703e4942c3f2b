"""Slow motion of an alt-az mount on top of its tracking: arrows below 0.1 degrees a second, and guiding.

Any rate that a motor is given takes the place of tracking, and of both axes at once. So tracking is put off, each axis
gets the sum of its tracking rate and of what is to be added (``NexStar.riding``, one share an order) as a variable
rate, and tracking comes back with the last share. The tracking rates are those of the moment, by azimuth and altitude
as the mount tells them and the latitude: below 80 degrees of altitude they change by less than a tenth in a minute.
"""

from __future__ import annotations

from gateway.astro.spherical import following, northwards
from gateway.core.errors import Busy, Refused, Unsupported
from gateway.core.operations import Direction, Move, Pulse, Pulsed, Tracking
from gateway.protocols.base.driver import SLEWING, Send, Steps
from gateway.protocols.nexstar.counting import SIDEREAL
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.pointing import axis_readings, stop_current_motion
from gateway.protocols.nexstar.driver.state import AXES, NexStar, rest

Pair = tuple[float, float]

#: From here on, degrees a second, tracking is no part of a motion that anybody could see.
SLOW = 0.1
#: Seconds for which the line waits after an acknowledgement; the most that two motors are taken to be told apart, and
#: what they are where nothing was told that could show it.
BETWEEN, FARTHEST, UNKNOWN = 0.03, 0.5, 0.1


def stands(mount: NexStar) -> bool:
    """Whether it follows the sky by both axes, and takes variable rates (hand controls from 1.6 on do)."""
    return tracking.native_mode(mount) is Tracking.ALTAZ and not mount.german and mount.supports("rate_azm_pos")


def carries(mount: NexStar, operation: Move) -> bool:
    """Whether this arrow moves on top of tracking. Without a latitude it moves as on a mount that does not track."""
    return stands(mount) and mount.site is not None and mount.speed(operation.rate) < SLOW


def move(mount: NexStar, operation: Move) -> Steps:
    """-> whether it was done: while tracking is off there is nothing to move on top of."""
    axis, sign = operation.axis, operation.sense
    if mount.goto is not None:
        yield from stop_current_motion(mount)
    mount.parked = False
    yield from _look(mount)
    yield from tracking.suspend(mount)
    if mount.suspended is not Tracking.ALTAZ:
        return False
    speed = mount.speed(operation.rate)
    mount.moving[axis] = max(speed, mount.moving.get(axis, 0.0))  # until it has taken the new rate
    yield from _add(mount, axis, _share(axis, sign * speed))
    mount.moving[axis] = speed
    return True


def pulse(mount: NexStar, operation: Pulse) -> Steps:
    """-> Pulsed: by the motors, or in right ascension and declination with both; it has to be ended.

    What tracking misses until each motor has its rate is made up for within the pulse. One that is shorter than it
    takes to begin and to end it is longer and slower.
    """
    direction = operation.direction
    if mount.goto is not None:
        raise Refused(SLEWING)
    if mount.moving:
        raise Refused("An arrow is held down: the guide pulse is dropped.")
    if mount.site is None:
        raise Unsupported("This mount is guided on top of its tracking, which takes the latitude: --site tells it.")
    where = yield from _look(mount)
    rested = mount.suspended is None
    took = yield from tracking.suspend(mount)
    apart = mount.apart
    if apart is None:  # the motors take as long as that order did, and the wait after it
        apart = UNKNOWN if took is None else min(FARTHEST, took + BETWEEN)
    lasts = max(operation.ms / 1000.0, 2.0 * apart)
    rate = direction.sense * mount.guide_rates[direction.axis] * SIDEREAL * operation.ms / 1000.0 / lasts
    share = _share(direction.axis, rate)
    if mount.settings.guide_directions == "sky":
        first, second = _on_the_sky(direction, where, mount)
        share = rate * first, rate * second
    late = apart / lasts if rested else 0.0
    mount.pulsing.add(direction.axis)
    heard = yield from _add(mount, direction.axis, share, (late, 2.0 * late))
    return Pulsed(max(0.0, lasts - (mount.now() - heard) - max(0.0, (mount.apart or 0.0) - BETWEEN)), ends=False)


def stop_axis(mount: NexStar, axis: int) -> Steps:
    """Take one share away. What is left goes on; an arrow's end is rate 0, a pulse's the bare tracking rate."""
    pulsed = axis in mount.pulsing
    mount.riding.pop(axis)
    mount.pulsing.discard(axis)
    mount.moving.pop(axis, None)
    if mount.riding or mount.moving or pulsed:
        yield from go_on(mount, axis)
    if mount.riding or mount.moving:
        return
    if not pulsed:
        for number in (axis, 3 - axis):
            yield rest(number)
    yield from tracking.resume(mount)


def go_on(mount: NexStar, first: int) -> Steps:
    """The axes that no fast arrow turns get what they are to do now, in the order in which they were told before."""
    for axis in (first, 3 - first):
        if axis not in mount.moving or axis in mount.riding:
            yield _rate(mount, axis, (0.0, 0.0), prompt=False)


def _look(mount: NexStar) -> Steps:
    """-> azimuth and altitude; how fast each axis follows the sky there is noted."""
    answer = yield axis_readings(mount)
    where = answer["az"], answer["alt"]
    assert mount.site is not None
    first, second = following(*where, mount.site.latitude)
    mount.following = first * SIDEREAL, second * SIDEREAL
    return where


def _on_the_sky(direction: Direction, where: Pair, mount: NexStar) -> Pair:
    """What both axes do for a degree of hour angle, or of declination."""
    assert mount.site is not None
    return (following if direction.axis == 1 else northwards)(*where, mount.site.latitude)


def _share(axis: int, rate: float) -> Pair:
    return (rate, 0.0) if axis == 1 else (0.0, rate)


def _add(mount: NexStar, axis: int, share: Pair, late: Pair = (0.0, 0.0)) -> Steps:
    """One more share -> when the first motor acknowledged it. ``late``: by which part of its rate tracking makes up."""
    before = mount.riding.get(axis)
    mount.riding[axis] = share
    heard: list[float] = []
    try:
        for number in (axis, 3 - axis):
            if number not in mount.moving or number in mount.riding:
                yield _rate(mount, number, late if number == axis else late[::-1], prompt=True)
                heard.append(mount.now())
    except Busy:  # it was never sent
        if before is None:
            del mount.riding[axis]
            mount.moving.pop(axis, None)
            mount.pulsing.discard(axis)
        if not mount.riding and not mount.moving:
            yield from tracking.resume(mount)
        raise
    if len(heard) > 1:
        mount.apart = min(FARTHEST, heard[1] - heard[0])
    return heard[0]


def _rate(mount: NexStar, axis: int, late: Pair, prompt: bool) -> Send:
    """The sum for one axis: tracking, where it was on, and every share."""
    tracks = mount.following[axis - 1] if mount.suspended is Tracking.ALTAZ else 0.0
    total = tracks * (1.0 + late[0]) + sum(share[axis - 1] for share in mount.riding.values())
    fastest = float(mount.rates["fastest"])
    code = tracking.rate_code(min(abs(total), fastest) * 3600.0)
    return Send(f"rate_{AXES[axis]}_{'pos' if total >= 0.0 else 'neg'}", {"rate": code}, prompt=prompt)
