"""NexStar codecs and tables against the Celestron manual, typed by hand."""

from __future__ import annotations

from collections.abc import Callable

from gateway.protocols.nexstar.driver.tracking import rate_code
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.fields import codec
from gateway.protocols.wireformat.rows import parse_version
from tests.support.each import each
from tests.support.manual_files import raw, rows

NEXSTAR = load("nexstar")
_CODECS = {"zone": "s8", "rate16": "u16", "rate24": "u24", "year8": "u8", "year16": "u16", "guide_rate": "u8"}
#: What a driver makes of a value before the codec sees it.
_NUMBERS: dict[str, Callable[[float], int]] = {
    "zone": round,
    "rate16": rate_code,
    "rate24": lambda value: round(value * 1024),
    "year8": lambda value: round(value) - 2000,
    "year16": round,
    "guide_rate": lambda percent: min(255, round(percent * 2.56)),
}


def test_all_23_opcodes_and_21_pass_through_rows_of_the_celestron_manual_have_a_row() -> None:
    forms = [row for row in rows("nexstar_forms.txt") if not row[0].startswith("no_response")]
    assert len(forms) == 44
    assert sum(len(name) == 1 for name, *_ in forms) == 23
    for name, request, since, _ in forms:
        found = NEXSTAR.find(raw(request))
        assert found is not None, name
        if name == "P":  # the opcode itself is any of its rows
            continue
        assert found[0].name == name
        assert found[0].first_version == parse_version(since), name
        assert found[0].beyond is None


@each("way, form, data, value, tolerance", rows("nexstar_fields.txt"))
def test_nexstar_number_is_coded_as_the_manual_writes(
    way: str, form: str, data: str, value: str, tolerance: str
) -> None:
    field, number = codec(_CODECS.get(form, form)), _NUMBERS.get(form)
    wire = raw(data)
    if way in ("both", "in"):
        decoded = field.decode(wire)
        if number is None:
            near = max(float(tolerance), 1e-9)
            assert abs(decoded - float(value)) <= near or abs(abs(decoded - float(value)) - 360.0) <= near
        else:
            assert decoded == number(float(value))
    if way in ("both", "out"):
        assert field.encode(float(value) if number is None else number(float(value))) == wire


@each("command", NEXSTAR.commands.values())
def test_nexstar_commands_with_the_same_first_byte_have_the_same_length(command: object) -> None:
    name = command.request.prefix[:1]  # type: ignore[attr-defined]
    lengths = {c.request.length for c in NEXSTAR.commands.values() if c.request.prefix[:1] == name}
    assert len(lengths) == 1
    assert None not in lengths
