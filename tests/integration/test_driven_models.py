"""Every driven model and version, every operation: it does it, or says by name why not. Never a silent nothing.

The tables are typed by hand: what is not in them must be done, and seen in the simulator. The suite runs one mount of a
kind, ``pytest --whole`` all of them.
"""

from __future__ import annotations

from typing import Any

import pytest

from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.mount.site.places import POSITION_FUNCTIONS
from gateway.protocols.nexstar.versions import versions_of
from gateway.protocols.wireformat.command_set import load
from tests.support import sampling
from tests.support.operations_matrix import CHECKS, outcomes

Refusals = dict[str, str]

# --- Meade ------------------------------------------------------------------------------------------------------------

_NO_SIDES: Refusals = {"PierSide": "Unsupported"}
_NO_QUESTIONS: Refusals = {"GuideRate": "Unsupported"}
_ONLY_GPS: Refusals = {
    "GetGps": "Unsupported",
    "ClockFromGps": "Unsupported",
    "SetGuideRate": "Unsupported",
    "Backlash": "Unsupported",
}
_NO_SWITCHES: Refusals = {"SetHome": "Unsupported", "Home": "Unsupported"}
#: Where :GW is not known, the letters that switch tracking off would cost the alignment.
_ALWAYS_TRACKS: Refusals = {"SetTracking": "Unsupported", "Hibernate": "Unsupported"}

#: What is not done alike by all that speak LX200.
_NOT_ALIKE = ("Park", "Home", "HomeState", "SetTracking", "Hibernate", "Wake", "SetGuideRate")
_OTHERS: Refusals = _NO_QUESTIONS | {
    "GetGps": "Unsupported",
    "ClockFromGps": "Unsupported",
    "Backlash": "Unsupported",
    "PeriodicError": "Unsupported",
    "Focus": "Unsupported",
    "SetHome": "Unsupported",
}

MEADE: dict[str, Refusals] = {
    "autostar": _NO_SIDES | _NO_QUESTIONS | _ONLY_GPS | _NO_SWITCHES | {"PeriodicError": "Unsupported"},
    "lx200": _NO_SIDES
    | _NO_QUESTIONS
    | _ONLY_GPS
    | _NO_SWITCHES
    | _ALWAYS_TRACKS
    | {"HomeState": "Unsupported", "Park": "Unsupported"},
    "lx200-16": _NO_SIDES
    | _NO_QUESTIONS
    | _ONLY_GPS
    | _ALWAYS_TRACKS
    | {"Unpark": "Unsupported", "Wake": "Unsupported"},
    "lx200gps": _NO_SIDES | _NO_QUESTIONS,
    # these tell the side of the pier, and switch tracking on and off; home is declared, which nobody may do unasked
    "onstep": _OTHERS,
    "teenastro": _OTHERS | {"SetGuideRate": "Unsupported", "SetSite": "Refused"},
    "other": _OTHERS | dict.fromkeys(_NOT_ALIKE, "Unsupported"),
}

# --- NexStar ----------------------------------------------------------------------------------------------------------

_NO_GPS: Refusals = {"GetGps": "NoDevice", "ClockFromGps": "NoDevice"}
_NO_PEC: Refusals = {"PeriodicError": "Unsupported"}
#: In alt-az both axes follow the sky, at the sidereal rate alone.
_FORK: Refusals = {"TrackRate": "Unsupported"}
#: Motors before 6.12, on forks: variable rates on both axes do for a pulse on the sky, not for a motor's own.
_NO_PULSES: Refusals = {"PulseAxis": "Unsupported"}
#: Before 2.3: neither site nor clock.
_OLD: Refusals = {"SetSite": "ClientState", "SetClock": "ClientState"}
#: Before 1.6: no pass-through to motors and GPS unit.
_ANCIENT: Refusals = _OLD | {
    "SetTracking": "Unsupported",
    "Park": "KeepsTracking",
    "Hibernate": "Unsupported",
    "Wake": "Unsupported",
    "GetGps": "Unsupported",
    "ClockFromGps": "Unsupported",
    "GuideRate": "Unsupported",
    "SetGuideRate": "Unsupported",
    "Backlash": "Unsupported",
    "Focus": "Unsupported",
    "Pulse": "Unsupported",
}
_SE: Refusals = _NO_GPS | _NO_PEC | _FORK
_SE_OLD_MOTORS: Refusals = _SE | _NO_PULSES
_GERMAN: Refusals = _NO_GPS
_GERMAN_BARE: Refusals = _NO_GPS | _NO_PEC
#: Sky-Watcher's hand control passes motion on to its motors, and nothing else.
_SYNSCAN: Refusals = {
    "GetGps": "Unsupported",
    "ClockFromGps": "Unsupported",
    "GuideRate": "Unsupported",
    "SetGuideRate": "Unsupported",
    "Backlash": "Unsupported",
    "PeriodicError": "Unsupported",
    "Focus": "Unsupported",
}

NEXSTAR: dict[str, dict[str, Refusals]] = {
    "nexstar-gps": {
        "1.2": _ANCIENT | _FORK | _NO_PULSES | _NO_PEC,
        "1.6": _OLD | _FORK | _NO_PULSES | _NO_PEC,
        "2.2": _OLD | _FORK | _NO_PULSES,
        "4.21": _FORK | _NO_PULSES,
    },
    "nexstar-gps-sa": {
        "1.6": _OLD | _FORK | _NO_PULSES | _NO_PEC,
        "2.2": _OLD | _FORK | _NO_PULSES,
        "4.21": _FORK | _NO_PULSES,
    },
    "i-series": {"1.6": _OLD | _SE_OLD_MOTORS, "2.2": _OLD | _SE_OLD_MOTORS, "4.21": _SE_OLD_MOTORS},
    "i-series-se": {"2.2": _OLD | _SE_OLD_MOTORS, "2.3": _SE_OLD_MOTORS, "4.21": _SE_OLD_MOTORS},
    "cge": dict.fromkeys(("2.3", "3.01", "3.02", "3.04", "4.10", "4.21"), _GERMAN),
    "advanced-gt": dict.fromkeys(("3.01", "3.04", "4.10", "4.21"), _GERMAN_BARE),
    "slt": dict.fromkeys(("4.03", "4.10", "4.21"), _SE_OLD_MOTORS),
    "cpc": dict.fromkeys(("4.03", "4.10", "4.21"), _FORK | _NO_PULSES),
    "gt": {"101.0": _ANCIENT | _FORK | _NO_PULSES | _NO_PEC, "104.0": _SE_OLD_MOTORS},
    "4-5se": dict.fromkeys(("4.10", "4.21"), _SE_OLD_MOTORS),
    "6-8se": dict.fromkeys(("4.10", "4.21"), _SE_OLD_MOTORS),
    "cge-pro": dict.fromkeys(("4.21", "5.31"), _GERMAN),
    "cgem": dict.fromkeys(("4.21", "5.31"), _GERMAN),
    "lcm": dict.fromkeys(("4.21", "5.31"), _SE),
    "skyprodigy": {"4.21": _SE},
    "cpc-deluxe": dict.fromkeys(("4.21", "5.31"), _FORK),
    "gt16": {"4.21": _SE},
    "starseeker": {"4.21": _SE},
    "avx": dict.fromkeys(("4.21", "5.31"), _GERMAN),
    "cosmos": {"5.31": _SE},
    "evolution": dict.fromkeys(("4.21", "5.31"), _NO_GPS | _FORK),
    "cgx": dict.fromkeys(("4.22", "5.31"), _GERMAN),
    "cgx-l": dict.fromkeys(("4.22", "5.31"), _GERMAN),
    "astro-fi": {"5.31": _SE},
    "skywatcher": {"4.21": _GERMAN_BARE},
    "synscan": dict.fromkeys(("3.36", "3.38", "4.38.06", "4.39.05"), _SYNSCAN),
    "synscan-az": dict.fromkeys(("3.36", "3.38", "4.38.06", "4.39.05"), _SYNSCAN | _FORK | _NO_PULSES),
}

#: A StarSense in the place of a mount's own hand control; once it is aligned it is told neither site nor time.
_STARSENSE: Refusals = {"SetSite": "ClientState", "SetClock": "ClientState"}
for _model in (
    "advanced-gt",
    "slt",
    "cpc",
    "4-5se",
    "6-8se",
    "cge-pro",
    "cgem",
    "lcm",
    "cpc-deluxe",
    "avx",
    "evolution",
    "cgx",
    "cgx-l",
):
    NEXSTAR[_model] = NEXSTAR[_model] | {"starsense-1.20": [*NEXSTAR[_model].values()][-1] | _STARSENSE}

#: One of each kind for the suite.
KINDS = [
    ("nexstar-gps", "1.2"), ("nexstar-gps", "2.2"), ("cge", "3.01"), ("6-8se", "4.21"), ("evolution", "5.31"),
    ("cgx", "5.31"), ("cpc", "starsense-1.20"), ("avx", "starsense-1.20"), ("synscan", "3.36"),
    ("synscan", "4.39.05"), ("synscan-az", "4.39.05"),
]  # fmt: skip


def wrong(found: dict[str, str], refusals: Refusals) -> dict[str, tuple[str, str]]:
    """Operation name -> (what was seen, what the table says), where the two differ."""
    return {
        name: (outcome, refusals.get(name, "does"))
        for name, outcome in found.items()
        if outcome != refusals.get(name, "does")
    }


# --- Alpaca telescopes -----------------------------------------------------------------------------------------------

#: ASCOM's telescope interface has no words for these.
_ALPACA: Refusals = dict.fromkeys(
    ("GetGps", "ClockFromGps", "Backlash", "PeriodicError", "Focus", "SetHome"), "Unsupported"
)
ALPACA: dict[str, Refusals] = {
    "german": _ALPACA,
    "polar": _ALPACA | _NO_SIDES,
    "altaz": _ALPACA | _NO_SIDES | {"Pulse": "Unsupported", "PulseAxis": "Unsupported"},
}


@pytest.mark.parametrize("model", ALPACA)
def test_alpaca_telescope_does_each_operation_or_gives_a_reason(model: str) -> None:
    assert wrong(run(outcomes("alpaca", model)), ALPACA[model]) == {}


@pytest.mark.parametrize("model", MEADE)
def test_meade_does_each_operation_or_gives_a_reason(model: str) -> None:
    assert wrong(run(outcomes("lx200", model)), MEADE[model]) == {}


@pytest.mark.parametrize(
    ("model", "version"),
    [(model, version) for model, rows in NEXSTAR.items() for version in rows] if sampling.WHOLE else KINDS,
)
def test_hand_control_does_each_operation_or_gives_a_reason(model: str, version: str) -> None:
    assert wrong(run(outcomes("nexstar", model, version)), NEXSTAR[model][version]) == {}


def test_driven_models_are_tried_with_every_operation_model_and_version() -> None:
    def below(kind: type[Any]) -> set[type[Any]]:
        return {kind}.union(*(below(one) for one in kind.__subclasses__()))

    operations = {kind for kind in below(op.Operation) if kind.__module__.startswith(op.__name__)}
    for_its_kind = {op.PassThrough, op.NativeRequest, op.Choose}  # tests/integration/sharing/test_transparent.py
    own = {
        *POSITION_FUNCTIONS,
        op.GetActivity,
        op.GetAbilities,
        op.TubeSide,
        op.SetZone,
    }  # what the gateway answers by itself
    assert operations - {op.Operation, op.Read} - for_its_kind - own == set(CHECKS)
    assert set(MEADE) == set(load("lx200").models)
    assert set(ALPACA) == set(load("alpaca").models)
    assert {model: list(rows) for model, rows in NEXSTAR.items()} == {
        model: versions_of(row) for model, row in load("nexstar").models.items()
    }
