"""A hand control is asked at the start what its version knows, and nothing else: what it does not know it leaves
unanswered, and the line is dead for seconds then, while programs wait.
"""

from __future__ import annotations

import asyncio

import pytest

from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command_set import load
from tests.support.in_process_gateway import Bridge
from tests.support.lossy_line import LossyLine

NEXSTAR = load("nexstar")
MOUNTS = [(model, version) for model, row in NEXSTAR.models.items() for version in row.get("versions", [])]


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize(("model", "version"), MOUNTS)
async def test_hand_control_is_sent_only_commands_that_its_version_knows(model: str, version: str, named: bool) -> None:
    async with Bridge(model, version, named=named) as bridge:
        client = bridge.client()
        await asyncio.sleep(1.0)
        assert (await client.ask(b":GA#", 3.0)).endswith(b"#")
        counted = PROTOCOLS["nexstar"].command_set_version(version)
        for sent in bridge.sent_requests():
            found = NEXSTAR.find(sent)
            assert found is not None and (found[0].exists_on(model, counted) or found[0].name in ("V", "K")), sent


@pytest.mark.parametrize(("model", "version"), [("nexstar-gps", "2.2"), ("cge", "4.21"), ("avx", "5.31")])
async def test_hand_control_is_identified_though_it_waits_long_for_a_missing_focuser(model: str, version: str) -> None:
    """It takes 3.5 s to say so, as the manual allows (``tests/support/lossy_line.py``), and the line takes more."""
    bridge = Bridge(model, version, latency=0.3)
    LossyLine(bridge, 0.3)
    bridge.controller.start()
    try:
        async with asyncio.timeout(40.0):
            await bridge.controller.site_read.wait()
        await asyncio.sleep(10.0)
        assert bridge.controller.line.usable
        assert await bridge.client().ask(b":GA#", 3.0, ending=b"#")
    finally:
        await bridge.controller.close()
