"""What is said at the start of what was found and does not fit, and at the end of how the mount was left."""

from __future__ import annotations

import asyncio
import signal
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from gateway.app.control.user_messages import first_messages, last_message
from gateway.core.operations import AbortMotion
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.process import Running, ask


def said(bridge: Any, model: str | None = None, version: str | None = None) -> tuple[list[str], list[str]]:
    """What is told and what is warned of."""
    lines = list(first_messages(bridge.controller, model, version))
    return [line.text for line in lines if not line.is_warning], [line.text for line in lines if line.is_warning]


def at_the_start(**settings: Any) -> tuple[list[str], list[str]]:
    named = {name: settings.pop(name) for name in ("named_model", "named_version") if name in settings}

    async def program() -> tuple[list[str], list[str]]:
        async with Bridge(**settings) as bridge:
            return said(bridge, named.get("named_model"), named.get("named_version"))

    result: tuple[list[str], list[str]] = run(program())
    return result


@pytest.mark.parametrize(
    ("model", "told"), [("lx200gps", "Meade LX200GPS, lx200gps, version 4.2l"), ("lx200", "Meade LX200 Classic, lx200")]
)
def test_start_message_calls_a_meade_by_its_common_name(model: str, told: str) -> None:
    """It calls itself LX2001, or nothing."""
    assert at_the_start(mount=model, driven="lx200", presented="nexstar", surface="cge")[0][0] == f"found {told}"


def test_start_message_names_the_site_flag_where_no_site_is_known() -> None:
    told, warned = at_the_start(mount="6-8se", version="2.2")
    assert told[1].startswith("site not known (--site LAT,LON")
    assert any("a program that asks for it or for the" in words for words in warned)


def test_start_message_shows_the_mount_its_site_and_its_clock() -> None:
    (model, facts), warned = at_the_start()
    assert "6-8se, version 4.21" in model and not warned
    assert "45.0 N 10.0 E, from the mount" in facts and "2026-01-15 22:00:01 UTC, from the" in facts


def test_start_message_warns_of_a_german_mount_without_an_hour_angle_limit() -> None:
    for mount, config, told in (("cge", {}, 1), ("cge", {"hour_angle_limit": 0.5}, 0), ("cpc", {}, 0)):
        lines, _ = at_the_start(mount=mount, config=config)
        assert sum(line.startswith("hour-angle-limit is not set") for line in lines) == told, mount


def test_start_message_warns_of_an_unaligned_mount() -> None:
    for driven, mount in (("nexstar", "cpc"), ("lx200", "lx200gps")):
        surface = "lx200" if driven == "nexstar" else "nexstar"
        _, warned = at_the_start(
            driven=driven,
            mount=mount,
            presented=surface,
            surface="autostar" if surface == "lx200" else None,
            aligned=False,
        )
        assert [words for words in warned if words.startswith("the mount is not aligned")], driven


@pytest.mark.parametrize(("driven", "mount", "named", "told"), [
    ("nexstar", "6-8se", "cge", "6-8se"),
    ("nexstar", "cpc", "6-8se", "cpc"),
    ("lx200", "autostar", "lx200gps", "autostar"),
    ("lx200", "lx200gps", "autostar", "lx200gps"),
    ("lx200", "lx200-16", "lx200gps", None),
])  # fmt: skip
def test_start_message_warns_of_another_model_than_configured(
    driven: str, mount: str, named: str, told: str | None
) -> None:
    surface = "lx200" if driven == "nexstar" else "nexstar"
    _, warned = at_the_start(
        driven=driven,
        mount=mount,
        presented=surface,
        named_model=named,
        surface="autostar" if surface == "lx200" else None,
    )
    words = [f"you named the mount {named}, and it reports {told}: leave the model out, or write {told}"]
    assert [line for line in warned if "named" in line] == (words if told else [])


def test_start_message_does_not_warn_of_the_configured_model() -> None:
    for driven, mount in (
        ("nexstar", "6-8se"),
        ("nexstar", "cge"),
        ("lx200", "autostar"),
        ("lx200", "lx200gps"),
        ("lx200", "lx200"),
        ("lx200", "lx200-16"),
    ):
        surface = "lx200" if driven == "nexstar" else "nexstar"
        _, warned = at_the_start(
            driven=driven,
            mount=mount,
            presented=surface,
            named_model=mount,
            named=True,
            surface="autostar" if surface == "lx200" else None,
        )
        assert not [line for line in warned if "named" in line], mount


def test_start_message_warns_of_another_version_than_configured() -> None:
    [warned] = at_the_start(named_model="6-8se", named_version="3.0")[1]
    assert "hand control version 3.0" in warned and "4.21" in warned
    assert at_the_start(mount="cge", version="4.21", named_model="cge", named_version="4.21")[1] == []


@pytest.mark.parametrize(
    ("site", "hint"),
    [
        ((45.0, -10.0), "the sign of a longitude looks wrong"),
        ((-45.0, 10.0), "the sign of a latitude looks wrong"),
        ((-45.0, -10.0), "both signs look wrong"),
        ((10.0, 45.0), "latitude and longitude look swapped"),
        ((30.0, 20.0), ""),
    ],
)
def test_start_message_warns_of_a_suspicious_site(site: tuple[float, float], hint: str) -> None:
    _, [warned] = at_the_start(config={"site": site})
    assert "45.0 N 10.0 E" in warned and "configuration" in warned
    assert hint in warned
    assert "look" in warned or not hint


async def test_end_message_says_whether_tracking_is_on() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        await client.ask(b":RS#:Mn#:GVP#")
        await asyncio.sleep(2)
        moved = bridge.controller.reconciler.busy
        await bridge.controller.close()
        told = last_message(bridge.controller, moved)
        assert told is not None
        assert (told.text, told.is_warning) == ("stopped the mount; tracking is on", False)
        await asyncio.sleep(100)
        told = last_message(bridge.controller, False)
        assert told is not None
        assert "tracking was on" in told.text


async def test_end_message_reports_a_stop_that_the_mount_did_not_hear() -> None:
    async with Bridge() as bridge:
        reconciler = bridge.controller.reconciler
        reconciler.update(replace(reconciler.wanted, stop_owed=True))
        told = last_message(bridge.controller, True)
        assert told is not None
        assert told.is_warning
        assert "not acknowledged" in told.text
        await bridge.controller.perform(AbortMotion())


def test_run_prints_its_start_and_end_messages_on_stdout(tmp_path: Path, started: list[Running]) -> None:
    """Before the ready line; and Ctrl-C is answered."""
    simulator = Running("sim", "nexstar:cpc", "--at", f"pty:{tmp_path}/mount", "--unaligned")
    started.append(simulator)
    simulator.ready()
    mount, where = f"nexstar:cge@{tmp_path}/mount", ("--surface", "lx200@tcp://127.0.0.1:0", "--state", str(tmp_path))
    gateway = Running("run", "--mount", mount, *where, "--sun", "0", "--no-watchdog")
    assert gateway.process.stdout is not None
    assert "cpc, version 4.21" in gateway.process.stdout.readline()
    assert gateway.process.stdout.readline().startswith("site ")
    address = gateway.ready()
    ask(address, b":RS#:Mn#:GVP#")
    told = gateway.finish(signal.SIGINT)
    assert (told.returncode, told.stdout.startswith("stopped the mount; tracking is o")) == (0, True)
    warnings = [line for line in told.stderr.splitlines() if "waiting for the mount's first answer" not in line]
    assert "named the mount cge" in warnings[0] and "write cpc" in warnings[0] and "not aligned" in warnings[1]


def test_run_reports_a_baud_rate_at_which_the_mount_does_not_answer(tmp_path: Path, started: list[Running]) -> None:
    simulator = Running("sim", "nexstar:cpc", "--at", f"pty:{tmp_path}/mount", "--baud", "9600")
    started.append(simulator)
    simulator.ready()
    where = ("--surface", "lx200@tcp://127.0.0.1:0", "--state", str(tmp_path))
    told = Running("run", "--mount", f"nexstar@{tmp_path}/mount", "--baud", "19200", *where).finish()
    words = f"nexstar@{tmp_path}/mount: the mount answers at 9600 baud, and not at 19200: leave --baud out"
    assert (told.returncode, told.stderr.splitlines()[-1]) == (2, f"mount-gateway: {words}")
