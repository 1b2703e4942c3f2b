"""A German mount passes over the tracking mode of alt-az mounts, and nobody takes it for one afterwards."""

from __future__ import annotations

import asyncio

import pytest

from tests.support.in_process_gateway import Bridge


@pytest.mark.parametrize(("model", "version"), [("avx", "5.31"), ("cge", "4.21")])
async def test_german_mount_ignores_the_alt_az_tracking_mode(model: str, version: str) -> None:
    """Celestron: ``T`` 1 is alt-az, 2 EQ North; ``z`` tells the axes."""
    async with Bridge(model, version, presented="nexstar", surface=None) as bridge:
        client = bridge.client()
        before = await client.ask(b"z", ending=b"#")
        await client.ask(b"T\x00", ending=b"#")
        client.send(b"T\x01")
        await asyncio.sleep(5)
        assert b"T\x01" not in bridge.sent_requests()
        told = await bridge.client("10.0.0.2").ask(b"z", ending=b"#")
        assert all(
            abs(int(a, 16) - int(b, 16)) < 0x400000
            for a, b in zip(before[:-1].split(b","), told[:-1].split(b","), strict=True)
        )
        assert await client.ask(b"t", ending=b"#") == b"\x00#"
        assert await client.ask(b"T\x02", ending=b"#") == b"#"
        assert await client.ask(b"t", ending=b"#") == b"\x02#"
