"""Metrics of a running gateway for Prometheus: exchanges, faults by kind, durations of replies and stops.

They are counted by subscribing to each mount's signals; nothing is sent to a mount. The text is generated on request,
and prometheus-client is imported at the first request, on a thread of its own.
"""

from __future__ import annotations

import asyncio
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from importlib.util import find_spec
from itertools import accumulate
from typing import Any

from gateway.app.gateway import Gateway
from gateway.app.mount_state import MountState
from gateway.core.about import short_commit, version
from gateway.core.errors import Fault
from gateway.mount.controller import MountController
from gateway.mount.motion.wanted import Wanted
from gateway.system.own_commands import install_instruction

#: Upper bounds of the histogram's buckets, seconds.
BUCKET_BOUNDS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.5, 5.0)
NAME_PREFIX = "mount_gateway"


class Histogram:
    """Counts values by upper bound; the last count is for values above all bounds."""

    def __init__(self, bounds: Sequence[float] = BUCKET_BOUNDS) -> None:
        self.bucket_bounds, self.counts, self.sum = bounds, [0] * (len(bounds) + 1), 0.0

    def add(self, value: float) -> None:
        """Count a value."""
        self.counts[bisect_left(self.bucket_bounds, value)] += 1
        self.sum += value

    def buckets(self) -> list[tuple[str, float]]:
        """Return Prometheus' cumulative buckets: every bound with the number of values up to it."""
        bounds, totals = (*map(str, self.bucket_bounds), "+Inf"), map(float, accumulate(self.counts))
        return list(zip(bounds, totals, strict=True))


class MountCounts:
    """Counts the events of a mount until it is closed. ``stop_count`` counts requested stops; ``stop_times`` are
    the seconds from a request until the mount has acknowledged the stop.
    """

    def __init__(self, controller: MountController) -> None:
        self._controller = controller
        self.fault_counts: Counter[str] = Counter()
        self.answer_times, self.stop_times = Histogram(), Histogram()
        self.exchanges = self.stop_count = 0
        self._last_stop_count = controller.stop_count
        self._stop_began_at: float | None = None
        controller.line.exchanged.connect(self._on_exchange)
        controller.wanted.changed.connect(self._on_wanted_changed)
        controller.reconciler.stop_acknowledged.connect(self._on_stop_acknowledged)

    def close(self) -> None:
        """Stop counting."""
        controller = self._controller
        controller.line.exchanged.disconnect(self._on_exchange)
        controller.wanted.changed.disconnect(self._on_wanted_changed)
        controller.reconciler.stop_acknowledged.disconnect(self._on_stop_acknowledged)

    def _on_exchange(self, reply: dict[str, Any] | Fault) -> None:
        self.exchanges += 1
        if isinstance(reply, Fault):
            self.fault_counts[type(reply).__name__] += 1
        else:
            self.answer_times.add(self._controller.line.transaction.times.last_rtt)

    def _on_wanted_changed(self, wanted: Wanted) -> None:
        if wanted.stop_count != self._last_stop_count:
            self.stop_count += wanted.stop_count - self._last_stop_count
            self._last_stop_count = wanted.stop_count
            if wanted.stop_owed and self._stop_began_at is None:
                self._stop_began_at = self._controller.now()

    def _on_stop_acknowledged(self, _: None) -> None:
        if self._stop_began_at is not None:
            self.stop_times.add(self._controller.now() - self._stop_began_at)
            self._stop_began_at = None


#: Name, help text, and how to get the value from the state of a mount and its counts.
Row = tuple[str, str, Callable[[MountState, MountCounts], float]]
COUNTERS: tuple[Row, ...] = (
    ("exchanges", "Commands that were sent to the mount and answered, or not.", lambda _, counts: counts.exchanges),
    ("stops", "Stops that were requested, by any client or by the gateway.", lambda _, counts: counts.stop_count),
    ("refusals", "Commands and orders that were refused.", lambda state, _: state.refusals),
)
GAUGES: tuple[Row, ...] = (
    ("up", "Whether the mount answers (1) or not (0).", lambda state, _: float(state.look.online)),
    ("clients", "Programs that are connected.", lambda state, _: len(state.programs)),
)
HISTOGRAMS: tuple[tuple[str, str, Callable[[MountCounts], Histogram]], ...] = (
    ("answer_seconds", "How long the mount took to answer.", lambda counts: counts.answer_times),
    ("stop_seconds", "From asking for a stop until the mount had acknowledged it.", lambda counts: counts.stop_times),
)


class Metrics:
    """The metrics of all mounts. Without prometheus-client nothing is counted, and ``text`` returns None."""

    def __init__(self, gateways: Sequence[Gateway]) -> None:
        installed = find_spec("prometheus_client") is not None
        self._mounts = [(gateway, MountCounts(gateway.controller)) for gateway in gateways if installed]
        self._registry: Any = None

    async def text(self) -> bytes | None:
        """Return the metrics in the text format of Prometheus; None without prometheus-client."""
        if not self._mounts:
            return None
        client: Any = await asyncio.to_thread(import_module, "prometheus_client")  # stops must not wait for the import
        if self._registry is None:
            self._registry = client.CollectorRegistry()
            self._registry.register(self)
            client.ProcessCollector(registry=self._registry)
        return bytes(client.generate_latest(self._registry))

    def collect(self) -> Iterator[Any]:
        """Yield the metric families; prometheus-client calls this."""
        from prometheus_client.core import (
            CounterMetricFamily,
            GaugeMetricFamily,
            HistogramMetricFamily,
            InfoMetricFamily,
        )

        mounts = [(gateway.config.name or "mount", gateway.state(), counts) for gateway, counts in self._mounts]
        yield InfoMetricFamily(
            NAME_PREFIX, "The version of this gateway.", {"version": version(), "commit": short_commit()}
        )
        for kind, rows in ((CounterMetricFamily, COUNTERS), (GaugeMetricFamily, GAUGES)):
            for name, text, value in rows:
                family = kind(f"{NAME_PREFIX}_{name}", text, labels=["mount"])
                for mount, state, counts in mounts:
                    family.add_metric([mount], value(state, counts))
                yield family
        faults = CounterMetricFamily(f"{NAME_PREFIX}_faults", "Exchanges that failed.", labels=["mount", "kind"])
        for mount, _, counts in mounts:
            for fault, count in sorted(counts.fault_counts.items()):
                faults.add_metric([mount, fault], count)
        yield faults
        for name, text, histogram in HISTOGRAMS:
            times = HistogramMetricFamily(f"{NAME_PREFIX}_{name}", text, labels=["mount"])
            for mount, _, counts in mounts:
                times.add_metric([mount], histogram(counts).buckets(), histogram(counts).sum)
            yield times

    def close(self) -> None:
        """Stop counting."""
        for _, counts in self._mounts:
            counts.close()


def missing_package_text() -> str:
    """Say what to do if prometheus-client is not installed."""
    return f"for this page prometheus-client is needed; to install it, {install_instruction('metrics')}"
