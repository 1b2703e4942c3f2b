"""What does not fit together is said when the gateway starts, not only when something is refused."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.looks import notes


def said(mount: str = "cpc", driven: str = "nexstar", host_ahead: float = 0.0, **config: Any) -> list[str]:
    """The warnings of the first seconds."""
    found: list[list[str]] = []

    async def program() -> None:
        async with Bridge(mount, driven=driven, config=config, host_ahead=host_ahead) as bridge:
            await asyncio.sleep(2.0)
            found.append([note for note in notes(bridge) if note.startswith("WARNING")])

    run(program())
    return found[0]


def test_start_with_a_consistent_configuration_prints_no_warning() -> None:
    assert said() == said(lowest=10.0, site=(45.0, 10.0)) == said("cge") == said("autostar", "lx200") == []
    assert said(lowest=10.0, park=(90.0, 40.0)) == said("autostar", "lx200", lowest=10.0, park="mount") == []
    assert said("lx200", "lx200", lowest=10.0) == [], "a classic cannot be parked"


@pytest.mark.parametrize(
    ("mount", "driven", "config", "words"),
    [
        ("cpc", "nexstar", {"lowest": 10.0, "park": (90.0, 4.0)}, "it is parked there all the same"),
        ("cge", "nexstar", {"lowest": 50.0}, "parking is refused"),
        ("autostar", "lx200", {"lowest": 10.0}, "parking is refused"),
        (
            "cpc",
            "nexstar",
            {"site": (48.0, 11.0)},
            "the mount stands at 45.0 N 10.0 E, the configuration says 48.0 N 11.0",
        ),
        (
            "cge",
            "nexstar",
            {"host_ahead": 7200.0},
            "differ by 2.0 hours (2026-01-15 22:00 and 2026-01-16 00:00 UTC), so correct the one that is wrong",
        ),
    ],
)
def test_start_warns_of_contradictory_settings_in_one_line(
    mount: str, driven: str, config: dict[str, Any], words: str
) -> None:
    lines = said(mount, driven, **config)
    assert len(lines) == 1
    assert words in lines[0]
