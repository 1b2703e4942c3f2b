"""A virtual loop in which no timer is due: bytes that have arrived wake it; if nothing ever will, it says so."""

from __future__ import annotations

import asyncio
import socket

import pytest

from gateway.diagnostics.virtual_time import run


def test_virtual_loop_without_timers_says_that_nothing_will_happen() -> None:
    async def waits_for_ever() -> None:
        await asyncio.Event().wait()

    with pytest.raises(RuntimeError, match="nothing"):
        run(waits_for_ever())


def test_virtual_loop_without_timers_reads_bytes_that_have_arrived() -> None:
    async def reads() -> bytes:
        near, far = socket.socketpair()
        with near, far:
            far.send(b":GR#")
            readable = asyncio.Event()
            loop = asyncio.get_running_loop()
            loop.add_reader(near, readable.set)
            await readable.wait()
            loop.remove_reader(near)
            return near.recv(4)

    assert run(reads()) == b":GR#"
