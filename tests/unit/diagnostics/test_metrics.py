"""What is counted of a mount, on virtual time: exchanges, faults by kind, answers, stops and how long they took."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.errors import Fault
from gateway.diagnostics.metrics import Histogram, MountCounts
from tests.support.in_process_gateway import Bridge


def test_histogram_bucket_counts_values_up_to_its_bound() -> None:
    histogram = Histogram((0.1, 1.0))
    for value in (0.05, 0.1, 0.5, 7.0):
        histogram.add(value)
    assert histogram.buckets() == [("0.1", 2.0), ("1.0", 3.0), ("+Inf", 4.0)] and histogram.sum == pytest.approx(7.65)


async def test_metrics_count_exchanges_and_reply_times() -> None:
    async with Bridge() as bridge:
        counts = MountCounts(bridge.controller)
        before = bridge.controller.line.times.reply_count
        await bridge.client().ask(b":Sr05:34:32#:Sd+22*00:52#:MS#", ending=b"0")
        assert counts.exchanges >= bridge.controller.line.times.reply_count - before > 0
        assert sum(counts.answer_times.counts) == counts.exchanges - sum(counts.fault_counts.values())
        counts.close()
        seen = counts.exchanges
        await bridge.client().ask(b":Q#:GR#", ending=b"#")
        assert counts.exchanges == seen and counts.stop_count == 0


async def test_metrics_count_stops_with_their_time_to_acknowledgement() -> None:
    async with Bridge() as bridge:
        counts = MountCounts(bridge.controller)
        await bridge.controller.stop()
        await asyncio.sleep(100.0)
        await bridge.controller.stop()
        assert counts.stop_count == 2 and sum(counts.stop_times.counts) == 2
        assert 0.0 < counts.stop_times.sum < 2.0


async def test_metrics_count_link_faults_by_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    async with Bridge() as bridge:
        counts = MountCounts(bridge.controller)
        with monkeypatch.context() as patch:
            patch.setattr(bridge.controller.line.wire, "write", lambda data: None)
            with pytest.raises(Fault):
                await bridge.controller.stop()
        assert counts.fault_counts["NoAnswer"] >= 1 and counts.stop_count == 1 and not sum(counts.stop_times.counts)


async def test_metrics_count_every_refusal_once() -> None:
    async with Bridge() as bridge:
        client, log = bridge.client(), bridge.wire_log
        assert await client.ask(b":Sr25:00:00#") == b"0" and log.refusal_count == 1  # the value
        assert await client.ask(b":Sr25:00:00#" * 3, ending=b"000") == b"000" and log.refusal_count == 4
        assert (await client.ask(b":MS#")).startswith(b"1") and log.refusal_count == 5  # no target
        said = await client.ask(b":Sr05:34:32#:Sd-80*00:00#:MS#", ending=b"#")
        assert said.startswith(b"111") and log.refusal_count == 6  # the limits
        client.send(b":F9#")  # without a reply
        await asyncio.sleep(1.0)
        assert log.refusal_count == 7
        assert await client.ask(b":Sr05:34:32#") == b"1" and await client.ask(b":GR#", ending=b"#")
        assert log.refusal_count == 7
