"""The number of every refusal, typed from ASCOM's text: a program decides by it what the telescope cannot do."""

from __future__ import annotations

from gateway.core import errors
from gateway.protocols.alpaca.tables import error_number, number_by_fault

#: 0x400 not implemented, 0x401 invalid value, 0x402 value not set, 0x407 not connected, 0x408 parked, 0x40B not now.
ASCOM = {
    0x400: {"Unsupported"},
    0x401: {"Invalid"},
    0x402: {"NoTarget"},
    0x407: {"NotConnected"},
    0x408: {"Parked"},
    0x40B: {
        "BelowHorizon", "TooHigh", "NearSun", "Contradicted", "PastMeridian", "NotAligned", "SyncTooFar", "Stopped",
        "Busy", "Refused", "Held", "ReadOnly", "NotFromNetwork",
    },
    0x500: {"Fault", "NoAnswer"},
    0x501: {"Garbled"},
    0x502: {"Asleep"},
    0x503: {"NoDevice"},
    0x504: {"Silence"},
}  # fmt: skip


def test_every_refusal_has_the_error_number_of_ascom() -> None:
    assert number_by_fault() == {name: told for told, names in ASCOM.items() for name in names}


def test_temporary_alpaca_refusal_is_not_reported_as_not_implemented() -> None:
    assert error_number(errors.Held()) == 0x40B
    assert error_number(errors.NearSun()) == 0x40B
    assert error_number(errors.NoAnswer()) == 0x500
