"""An example of every command, with ordinary values for the time and site of a rehearsal.

The value of a field comes from the list by command and field, else from the list by field name; else it is the first
fallback value that the format accepts. So a new command needs no entry in this file.
"""

from __future__ import annotations

from datetime import UTC, date, datetime

from gateway.core.errors import MappingError
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.fields import Codec

#: 2026-01-28 21:00 UTC: a night with the Moon, the Crab nebula and Jupiter well up at the simulated mount's site.
START_TIME = 1769634000.0
_NOW = datetime.fromtimestamp(START_TIME + 60.0, UTC)
#: The Crab nebula.
TARGET_POSITION = (83.633, 22.0145)
#: Values of fields by name, for any command.
_FIELD_VALUES: dict[str, object] = {
    "ra": TARGET_POSITION[0], "dec": TARGET_POSITION[1], "az": 200.0, "alt": 50.0, "latitude": 44.5, "longitude": 11.0,
    "date": _NOW.date(), "time": _NOW.hour * 3600.0 + _NOW.minute * 60.0, "offset": -1.0, "hertz": 60.0, "limit": 20.0,
    "number": 42, "site": 2, "direction": "n", "ms": 500, "name": "HOM", "types": "GPDCO",
    "stamp": _NOW.strftime("%y%m%d%H%M%S"), "hour": _NOW.hour, "minute": _NOW.minute, "second": 0, "month": _NOW.month,
    "day": _NOW.day, "quarters": 0, "zone": 0, "dst": 0, "device": 16, "position": 30.0, "mode": 0, "ticks": 50,
    "on": 1, "echo": 120,
}  # fmt: skip
#: Values by command and field.
_COMMAND_FIELD_VALUES: dict[tuple[str, str], object] = {
    ("H", "year"): _NOW.year % 100, ("I", "year"): _NOW.year % 100, ("rtc_set_year", "year"): _NOW.year,
    ("SE", "latitude"): 17.0, ("Se", "longitude"): 59.0, ("Lo", "catalog"): 1, ("Ls", "catalog"): 3,
    ("LS", "number"): 32349, ("move_pos", "device"): 18, ("move_neg", "device"): 18, ("RA", "rate"): 2.0,
    ("RE", "rate"): 2.0, ("Rg", "rate"): 7.5, ("Sw", "rate"): 4, ("F", "speed"): 3, ("set_guide_rate", "rate"): 64,
    ("axis_goto", "device"): 17, ("axis_goto_slow", "device"): 17,
    ("fine_rate_pos", "rate"): 153600, ("fine_rate_neg", "rate"): 153600,
    ("moveaxis", "axis"): 0, ("moveaxis", "rate"): 2.0, ("axisrates", "axis"): 0, ("canmoveaxis", "axis"): 0,
    ("action", "action"): "GotoEndedShort", ("pulseguide", "direction"): 0,
    ("set_tracking", "on"): False, ("set_trackingrate", "rate"): 1,
    ("set_guideratedeclination", "rate"): 0.001, ("set_guideraterightascension", "rate"): 0.001,
    **{(f"rate_{axis}_{sense}", "rate"): 600 for axis in ("azm", "alt") for sense in ("pos", "neg")},
}  # fmt: skip
_FALLBACK_VALUES = (5, 7.5, 1, "A", "text", *"SEWTP0", "12", "n", date(2026, 1, 28))


def example_request(command: Command) -> bytes:
    """Return a request of this command. Raises MappingError if no value fits a field."""
    values = {name: sample_value(command, name, field) for name, field in command.request.fields.items()}
    return command.request.encode(values)


def sample_value(command: Command, name: str, field: Codec) -> object:
    """Return an example value that this field can encode and decode. Raises MappingError if none is found."""
    choices = field.pattern.decode("latin-1").replace("\\", "").removeprefix("(?:").removesuffix(")").split("|")
    wanted = (_COMMAND_FIELD_VALUES.get((command.name, name)), _FIELD_VALUES.get(name), *_FALLBACK_VALUES, *choices)
    for value in (value for value in wanted if value is not None):
        try:
            field.decode(field.encode(value))
        except (ValueError, TypeError, AttributeError):
            continue
        return value
    raise MappingError("commands.toml", command.name, f"no example of its field {name!r} can be written")
