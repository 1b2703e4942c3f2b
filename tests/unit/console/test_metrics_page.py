"""``/metrics``: what Prometheus reads of a gateway, as its own library takes it apart."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from gateway.core.about import short_commit, version
from gateway.core.errors import NoAnswer
from gateway.diagnostics import metrics
from tests.support.fake_broker import until
from tests.unit.console.test_server import Open, opened, play

parser = pytest.importorskip("prometheus_client.parser")


async def figures(there: Open) -> tuple[str, dict[tuple[str, ...], float]]:
    """The text, and every sample by its name and the values of its labels."""
    async with there.http.get(f"{there.where}metrics") as response:
        assert response.status == 200 and response.content_type == "text/plain"
        text = await response.text()
    samples = [sample for family in parser.text_string_to_metric_families(text) for sample in family.samples]
    return text, {(sample.name, *sample.labels.values()): sample.value for sample in samples}


def test_prometheus_parses_the_metrics_page(tmp_path: Path) -> None:
    async def work() -> None:
        async with opened(tmp_path, name="pier") as there:
            _, before = await figures(there)
            assert before["mount_gateway_up", "pier"] == 1.0
            assert before["mount_gateway_info", short_commit(), version()] == 1.0
            assert before["mount_gateway_stops_total", "pier"] == 0.0
            await there.gateway.controller.stop()
            there.gateway.wire_log.log_refusal("a program", "no")
            async with there.page():
                await until(lambda: there.gateway.controller and there.gateway.controller.line.times.reply_count)
            text, after = await figures(there)
            assert after["mount_gateway_stops_total", "pier"] == 1.0
            assert after["mount_gateway_refusals_total", "pier"] == 1.0
            assert after["mount_gateway_stop_seconds_count", "pier"] == 1.0
            assert 0.0 < after["mount_gateway_stop_seconds_sum", "pier"] < 5.0
            exchanges = after["mount_gateway_exchanges_total", "pier"]
            assert exchanges > before["mount_gateway_exchanges_total", "pier"]
            assert after["mount_gateway_answer_seconds_count", "pier"] <= exchanges
            assert after["mount_gateway_clients", "pier"] == 0.0 and after["process_resident_memory_bytes",] > 1e6
            if promtool := shutil.which("promtool"):
                subprocess.run([promtool, "check", "metrics"], input=text.encode(), check=True, timeout=60)

    play(work())


def test_metrics_count_faults_by_kind(tmp_path: Path) -> None:
    async def work() -> None:
        async with opened(tmp_path) as there:
            await figures(there)
            for _ in range(3):
                there.gateway.controller.line.exchanged.emit(NoAnswer("no"))
            assert (await figures(there))[1]["mount_gateway_faults_total", "NoAnswer", "mount"] == 3.0

    play(work())


def test_metrics_without_the_extra_say_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metrics, "find_spec", lambda name: None)

    async def work() -> None:
        async with opened(tmp_path) as there, there.http.get(f"{there.where}metrics") as response:
            assert response.status == 501
            assert "prometheus-client is needed" in await response.text()

    play(work())


@pytest.mark.parametrize("headers", [{"Host": "evil.example"}, {"Sec-Fetch-Site": "cross-site"}])
def test_metrics_are_refused_to_a_foreign_page(tmp_path: Path, headers: dict[str, str]) -> None:
    async def work() -> None:
        async with opened(tmp_path) as there:
            where = f"{there.where}metrics"
            async with there.http.get(where, headers=headers) as response:
                assert response.status == 403

    play(work())
