"""How the manual writes the arguments of its commands, and nothing else, for a simulated telescope that is as strict.

Other telescopes that speak this protocol refuse what the manual does not write, and keep what they had: a driver that
is tested against a lenient one never learns of it. Alone the degree sign may be ``*``, the byte 0xDF or a colon, which
programs have sent to real telescopes for decades. Commands beyond the manual are not looked at.
"""

from __future__ import annotations

import re

_DEGREE, _MINUTES = rb"[*\xdf:]", rb"[0-5]\d"
_SECONDS = rb"(?:[:']" + _MINUTES + rb")?"
_NINETY = rb"[+-](?:[0-8]\d" + _DEGREE + _MINUTES + _SECONDS + rb"|90" + _DEGREE + rb"00(?:[:']00)?)"
_TURN = rb"(?:[0-2]\d\d|3[0-5]\d)" + _DEGREE + _MINUTES
_TIME = rb"(?:[01]\d|2[0-3]):" + _MINUTES + rb":" + _MINUTES
_FORMS = {
    "$BA": rb"\d\d", "$BZ": rb"\d\d", "B": rb"\d", "BD": rb"\d|1[0-5]", "F": rb"[1-4]",
    "LC": rb"\d{1,4}", "LM": rb"\d{1,4}", "LS": rb"\d{1,6}", "Lo": rb"\d", "Ls": rb"\d",
    "RA": rb"\d\d[.]\d", "RE": rb"\d\d[.]\d", "Rg": rb"\d\d[.]\d",
    "Sa": _NINETY, "Sd": _NINETY, "SE": _NINETY,
    "St": rb"[+-](?:[0-8]\d" + _DEGREE + _MINUTES + rb"|90" + _DEGREE + rb"00)",
    "Se": rb"[+-](?:0\d\d|1[0-7]\d)" + _DEGREE + _MINUTES + rb"|[+-]180" + _DEGREE + rb"00",
    "Sb": rb"[+-]\d\d[.]\d", "Sf": rb"[+-]\d\d[.]\d", "SB": rb"[1-9]", "SC": rb"\d\d/\d\d/\d\d",
    "SF": rb"\d{3}", "Sl": rb"\d{3}", "Ss": rb"\d{3}", "Sg": _TURN, "SG": rb"[+-]\d\d[.]\d", "Sh": rb"\d\d",
    "So": rb"\d\d[*\xdf]", "SL": _TIME, "SS": _TIME,
    "Sr": rb"(?:[01]\d|2[0-3]):" + _MINUTES + rb"(?::" + _MINUTES + rb"|[.]\d)",
    "ST": rb"\d{3}[.]\d", "Sw": rb"[2-8]", "Sz": _TURN + _SECONDS, "T": rb"\d{3}[.]\d{3}", "W": rb"\d",
}  # fmt: skip
_CHECKS = {name: re.compile(b":" + re.escape(name.encode()) + b"(?:" + form + b")#") for name, form in _FORMS.items()}


def well_formed(name: str, frame: bytes) -> bool:
    """Whether a whole command is written as the manual writes it."""
    check = _CHECKS.get(name)
    return check is None or check.fullmatch(frame) is not None
