"""Whatever replies are made of outdates those that were made before, through the signal of whoever owns it."""

from __future__ import annotations

from collections.abc import Callable

from gateway.core import operations as op
from gateway.mount.controller import MountController
from gateway.mount.motion.wanted import Wanted
from gateway.mount.presence import NO_PROGRAM
from gateway.mount.site.readers import SiteView
from tests.support.each import each
from tests.support.in_process_gateway import Bridge

CHANGES: dict[str, Callable[[MountController], object]] = {
    "a reading came": lambda mount: mount.cache.put(op.Slewing, False, mount.now()),
    "a reading was forgotten": lambda mount: mount.cache.forget(op.PierSide),
    "something else is wanted": lambda mount: mount.reconciler.update(Wanted(stop_count=1)),
    "a clock was set": lambda mount: SiteView(mount.site_clock, NO_PROGRAM).store_clock(op.SetClock(0.0, 0.0)),
    "a site was set": lambda mount: SiteView(mount.site_clock, NO_PROGRAM).set_site_half(op.SetSite(latitude=10.0)),
    "an order was acknowledged": lambda mount: mount.reader.mark_outdated(),
}


@each("change", CHANGES)
async def test_stored_replies_expire_after_new_readings_or_settings(change: str) -> None:
    async with Bridge() as bridge:
        before = bridge.controller.answer_version
        CHANGES[change](bridge.controller)
        assert bridge.controller.answer_version > before
