"""A gateway on virtual time whose one surface accepts every protocol."""

from __future__ import annotations

from typing import Any

from gateway.app.bindings import AcceptorFactory
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.protocols.registry import ANY
from gateway.transport.web_server import WebServer
from tests.support.in_memory_connections import Caller
from tests.support.in_process_gateway import Bridge

PLACE = "tcp://127.0.0.1:0"


class AnyBridge(Bridge):
    """``call`` opens a new connection; ``keys`` are the configuration keys of the surface."""

    def __init__(
        self, *arguments: Any, web: WebServer | None = None, keys: dict[str, Any] | None = None, **others: Any
    ):
        super().__init__(*arguments, **others)
        made = AcceptorFactory(
            self.controller,
            Endpoint(self._driven, "sim"),
            self.gateway.config,
            self.shared_state,
            self.clock,
            self.controller.astrometry.sky,
            self.warned.append,
            web or WebServer(),
        )
        surface = SurfaceConfig(at=f"{ANY}@{PLACE}", **(keys or {}))
        self.any: Any = made.make(1, Endpoint(ANY, PLACE), surface)
        self._number = 50000

    def call(self, host: str = "127.0.0.1") -> Caller:
        self._number += 1
        return Caller(self.any, host=host, number=self._number)

    def recognised(self) -> list[str]:
        """Return the notes on which protocol each connection was recognised to speak."""
        return [entry.note for entry in self.entries if entry.arrow == "~"]
