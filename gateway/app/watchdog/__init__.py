"""The watchdog: a second, small process that stops the mount when its gateway dies or hangs while something moves."""

from __future__ import annotations

from gateway.app.watchdog.client import Watchdog, WatchedMount

__all__ = ["Watchdog", "WatchedMount"]
