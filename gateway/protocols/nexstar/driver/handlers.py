"""The functions that rows of ``mappings/nexstar/driver.toml`` call, and the driver's own follow-ups."""

from __future__ import annotations

from gateway.protocols.base.driver import FollowUps, by_name
from gateway.protocols.nexstar.driver import goto, identify, motion, place, position, sleep, tracking

HANDLERS = by_name(
    identify.identity,
    position.position,
    position.horizontal_position,
    position.pier_side,
    position.sync,
    goto.goto,
    goto.goto_axes,
    goto.abort_slew,
    goto.slewing,
    goto.park,
    goto.home,
    goto.set_home,
    goto.home_state,
    goto.unpark,
    sleep.sleep,
    sleep.wake,
    motion.move,
    motion.move_axis,
    motion.stop_axis,
    motion.abort_motion,
    motion.pulse,
    motion.pulse_axis,
    motion.backlash,
    motion.periodic_error,
    motion.focus,
    tracking.status,
    tracking.set_tracking,
    tracking.track_rate,
    tracking.drive_rate,
    tracking.guide_rate,
    tracking.set_guide_rate,
    place.gps,
    place.get_site,
    place.set_site,
    place.get_clock,
    place.set_clock,
    place.clock_from_gps,
)
FOLLOW_UPS: FollowUps = {
    goto.Arrived: goto.arrived,
    sleep.Awake: sleep.awake,
    tracking.VerifyTracking: tracking.verify,
    motion.StepOn: motion.step_on,
}
