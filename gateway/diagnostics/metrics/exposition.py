"""The figures as the text that Prometheus reads, for all mounts of a gateway.

prometheus-client is loaded when somebody asks for the first time, on a thread of its own.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from gateway.app.gateway import Gateway
from gateway.core.about import VERSION
from gateway.diagnostics.metrics.counting import Counts, Histogram
from gateway.system.own_commands import how_to_add

NAME = "mount_gateway"
#: Name, what it says, how it is read off a gateway and its counts.
Row = tuple[str, str, Callable[[Gateway, Counts], float]]
COUNTERS: tuple[Row, ...] = (
    ("exchanges", "Commands that were sent to the mount and answered, or not.", lambda _, counts: counts.exchanges),
    ("stops", "Stops that were asked for, by whomever.", lambda _, counts: counts.stops),
    ("refusals", "Commands and orders that were refused.", lambda gateway, _: gateway.wire_log.refusals),
)
GAUGES: tuple[Row, ...] = (
    ("up", "Whether the mount answers (1) or not (0).", lambda gateway, _: float(_answers(gateway))),
    ("clients", "Programs that are connected.", lambda gateway, _: len(gateway.programs())),
)
HISTOGRAMS: tuple[tuple[str, str, Callable[[Counts], Histogram]], ...] = (
    ("answer_seconds", "How long the mount took to answer.", lambda counts: counts.answering),
    ("stop_seconds", "From asking for a stop until the mount had acknowledged it.", lambda counts: counts.stopping),
)


class Metrics:
    """Counts from when it is made. ``text`` is None, and nothing is counted, where prometheus-client is missing."""

    def __init__(self, gateways: Sequence[Gateway]) -> None:
        there = find_spec("prometheus_client") is not None
        self._mounts = [(one, Counts(one.controller)) for one in gateways if one.controller is not None and there]
        self._registry: Any = None

    async def text(self) -> bytes | None:
        """What Prometheus reads."""
        if not self._mounts:
            return None
        client: Any = await asyncio.to_thread(import_module, "prometheus_client")  # a stop is not to wait for that
        if self._registry is None:
            self._registry = client.CollectorRegistry()
            self._registry.register(self)
            client.ProcessCollector(registry=self._registry)
        return bytes(client.generate_latest(self._registry))

    def collect(self) -> Iterator[Any]:
        """What prometheus-client calls."""
        from prometheus_client.core import (
            CounterMetricFamily,
            GaugeMetricFamily,
            HistogramMetricFamily,
            InfoMetricFamily,
        )

        yield InfoMetricFamily(NAME, "The version of this gateway.", {"version": VERSION})
        for kind, rows in ((CounterMetricFamily, COUNTERS), (GaugeMetricFamily, GAUGES)):
            for name, words, value in rows:
                family = kind(f"{NAME}_{name}", words, labels=["mount"])
                for gateway, counts in self._mounts:
                    family.add_metric([_called(gateway)], value(gateway, counts))
                yield family
        faults = CounterMetricFamily(f"{NAME}_faults", "Exchanges that failed.", labels=["mount", "kind"])
        for gateway, counts in self._mounts:
            for fault, count in sorted(counts.faults.items()):
                faults.add_metric([_called(gateway), fault], count)
        yield faults
        for name, words, histogram in HISTOGRAMS:
            times = HistogramMetricFamily(f"{NAME}_{name}", words, labels=["mount"])
            for gateway, counts in self._mounts:
                times.add_metric([_called(gateway)], histogram(counts).buckets(), histogram(counts).sum)
            yield times

    def close(self) -> None:
        """Nothing is counted any more."""
        for _, counts in self._mounts:
            counts.close()


def missing() -> str:
    """What to do where there are no figures."""
    return f"for this page prometheus-client is needed; to install it, {how_to_add('metrics')}"


def _called(gateway: Gateway) -> str:
    return gateway.config.name or "mount"


def _answers(gateway: Gateway) -> bool:
    return gateway.controller is not None and gateway.controller.line.state in ("up", "busy")
