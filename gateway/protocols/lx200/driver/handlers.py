"""The functions that rows of ``mappings/lx200/driver.toml`` call, and the driver's own follow-ups."""

from __future__ import annotations

from gateway.protocols.base.driver import FollowUps, by_name
from gateway.protocols.lx200.driver import drive, ends, home, identify, library, motion, pier, place, pointing, put_back

HANDLERS = by_name(
    identify.contact,
    identify.identity,
    identify.status,
    pointing.position,
    pointing.horizontal_position,
    pointing.slewing,
    pointing.goto,
    pointing.goto_axes,
    pointing.abort_slew,
    pointing.sync,
    pier.pier_side,
    home.park,
    home.home,
    home.set_home,
    home.home_state,
    home.unpark,
    home.sleep,
    home.wake,
    motion.move,
    motion.move_axis,
    motion.stop_axis,
    motion.abort_motion,
    motion.pulse,
    motion.pulse_axis,
    motion.set_guide_rate,
    library.choose,
    drive.set_tracking,
    drive.rest,
    drive.rise,
    drive.track_rate,
    drive.drive_rate,
    drive.backlash,
    drive.periodic_error,
    drive.focus,
    place.gps,
    place.get_site,
    place.set_site,
    place.get_clock,
    place.set_clock,
    place.clock_from_gps,
)
FOLLOW_UPS: FollowUps = {home.SeekOn: home.seek_on, ends.EndAgain: ends.end_again, put_back.PutBack: put_back.put_back}
