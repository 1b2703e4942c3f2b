"""A reply is believed when it can be its own; an order waits for older ones like it, but not for ever."""

from __future__ import annotations

import gc

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoAnswer, NoDevice
from gateway.mount.link.driver_runner import MAX_LAST_REPLIES
from gateway.mount.link.transaction import LateReplies
from tests.support.in_process_gateway import Bridge


async def test_setting_that_is_never_verified_fails_in_20_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(late: LateReplies, ask: object, now: float) -> float:
        return now + 1e6

    async with Bridge("cge") as bridge:
        monkeypatch.setattr(LateReplies, "unambiguous_from", never)
        began = bridge.controller.now()
        with pytest.raises(NoAnswer):
            await bridge.controller.perform(op.Backlash(1, 5))
        assert bridge.controller.now() - began < 20.0


async def test_missing_device_keeps_no_request_in_memory() -> None:
    """A fault that is raised holds on to everything it came through, as long as somebody holds on to the fault."""
    async with Bridge("6-8se", presented="nexstar", surface=None) as bridge:
        client = bridge.client()
        for device in range(20, 60):
            assert await client.ask(bytes((80, 1, device, 18, 0, 0, 0, 1)))  # has it found its switch?
        client.close()
        gc.collect()
        assert not [fault for fault in gc.get_objects() if isinstance(fault, NoDevice) and fault.__traceback__]


async def test_replies_kept_for_verification_are_limited_for_any_client() -> None:
    async with Bridge("6-8se", presented="nexstar", surface=None) as bridge:
        client = bridge.client()
        for device in range(256):
            await client.ask(bytes((80, 1, device, 18, 0, 0, 0, 1)))
        assert len(bridge.controller.verifier._last_replies) <= MAX_LAST_REPLIES
