"""A whole gateway on virtual time: the product's rehearsal stage with state files, a kill and a check of all frames."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gateway.app.state.file import MarkerContent
from gateway.app.state.motion_marker import InThread
from gateway.app.state.store import StateStore
from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from gateway.protocols.wireformat.command_set import load
from tests.support.sent_forms import malformed

__all__ = ["EVENING", "Bridge", "RehearsalClient", "here"]

#: 2026-01-15 22:00 UTC
EVENING = 1768514400.0


async def here(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call the function at once instead of in a thread: threads do not run on virtual time."""
    return function(*arguments)


class Bridge(RehearsalGateway):
    """``sim`` is the simulated mount, ``controller`` the gateway's mount controller, ``client()`` a new connection."""

    store: StateStore | None = None

    def __init__(
        self,
        mount: str = "6-8se",
        version: str | None = None,
        *,
        surface: str | None = "autostar",
        start: float = EVENING,
        driven: str = "nexstar",
        presented: str = "lx200",
        state: Path | None = None,
        in_thread: InThread | None = None,
        **settings: Any,
    ) -> None:
        """``state`` is the folder of the state files; the other settings are those of a stage."""
        self._state, self._in_thread = state, in_thread
        self._driven, self._hands_on = driven, presented == driven == "nexstar"
        dialect = load(driven).in_dialect_of(mount).dialect_rows
        self._spoken = mount if dialect is not None else driven
        self.warned: list[str] = []
        super().__init__(mount, version, surface=surface, start=start, driven=driven, presented=presented, **settings)

    def open_state_store(self) -> None:
        if self._state is not None:
            marked, folder = MarkerContent(f"{self._driven}@bridge", 9600), str(self._state)
            in_thread = self._in_thread or here
            self.store = StateStore(self._driven, "bridge", marked, folder, self.warned.append, in_thread)
            self.gateway.store = self.store

    async def __aexit__(self, failed: object = None, *_: object) -> None:
        await super().__aexit__()
        if self.store is not None:
            await self.store.close()
        if failed is None and not self._hands_on:  # these commands are the program's own
            assert not (wrong := malformed(self._spoken, self.sent_requests())), f"not a form of the manual: {wrong}"

    async def kill(self) -> None:
        """End like a killed process: send and write nothing more, and only release the lock."""
        assert self.store is not None
        tasks = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in tasks:
            task.cancel()
        self.controller.reconciler.close()
        await asyncio.gather(*tasks, return_exceptions=True)
        self.store._lock.release()
