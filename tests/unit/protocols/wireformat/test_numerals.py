"""Numbers, truths, times and JSON as programming languages write them."""

from __future__ import annotations

from typing import Any

import pytest

from gateway.protocols.wireformat.fields import codec
from tests.support.each import each


@each(
    ("form", "raw", "value"),
    [
        ("number", b"1.5", 1.5), ("number", b"-3", -3.0), ("number", b"1e-3", 0.001), ("number", b"+7", 7.0),
        ("hours", b"6", 90.0), ("hours", b"-1", -15.0), ("hours", b"23.5", 352.5),
        ("whole", b"-12", -12), ("whole", b"+3", 3), ("whole", b"007", 7), ("whole", b"-2147483648", -(2**31)),
        ("truth", b"True", True), ("truth", b"fALSE", False),
        ("moment", b"1970-01-01T00:00:10.5Z", 10.5), ("moment", b"1970-01-01T01:00:00+01:00", 0.0),
        ("moment", b"1970-01-01T00:00:01%2B00:00", 1.0), ("moment", b"1970-01-02", 86400.0),
        ("quoted", b"a%20b%0Ac", "a b\nc"), ("json", b'{"a":[1,true]}', {"a": [1, True]}),
    ],
)  # fmt: skip
def test_number_boolean_time_or_json_text_is_parsed(form: str, raw: bytes, value: object) -> None:
    assert codec(form).decode(raw) == value


@each(
    ("form", "raw"),
    [
        ("number", b""), ("number", b"inf"), ("number", b"nan"), ("number", b"1_0"), ("number", b"1,5"),
        ("number", b"\xb2"), ("whole", b"1.0"), ("whole", b""), ("whole", b"-"), ("whole", b"9" * 13),
        ("whole", b"2147483648"),
        ("whole", b"-2147483649"),
        ("truth", b"1"), ("truth", b""), ("moment", b"yesterday"), ("moment", b""), ("json", b"{"),
        ("moment", b"0001-01-01T00:00:00+23:59x"),
    ],
)  # fmt: skip
def test_invalid_number_boolean_time_or_json_text_is_rejected(form: str, raw: bytes) -> None:
    with pytest.raises(ValueError):
        codec(form).decode(raw)


@each(
    ("form", "value", "raw"),
    [
        ("number", 0.1 + 0.2, b"0.30000000000000004"), ("number", 3, b"3.0"), ("hours", 360.0, b"0.0"),
        ("hours", 359.9999999999999, b"0.0"), ("hours", 90.0, b"6.0"), ("whole", -5, b"-5"), ("truth", True, b"true"),
        ("moment", 1769634000.0006, b"2026-01-28T21:00:00.001Z"), ("moment", -1e15, b"0001-01-01T00:00:00.000Z"),
        ("moment", 1e15, b"9999-12-31T23:59:59.000Z"), ("quoted", "a b\n", b"a%20b%0A"),
        ("json", {"a": None}, b'{"a":null}'),
    ],
)  # fmt: skip
def test_number_boolean_time_or_json_is_written_as_text(form: str, value: Any, raw: bytes) -> None:
    assert codec(form).encode(value) == raw
