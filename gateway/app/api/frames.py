"""Decode frames of both protocols to named values, and encode named values as frames.

Commands and their fields have the names of ``mappings/PROTOCOL/commands.toml``, which follow the manufacturers'
manuals. Angles are in degrees, also right ascension and sidereal time; times of day are seconds since midnight;
longitudes in LX200 frames are positive to the west, as Meade defines them. Nothing here opens a port or keeps state
between calls, except ``Splitter``, which buffers an incomplete command.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from math import isfinite
from numbers import Real

from msgspec import Struct

from gateway.core.errors import GatewayError
from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command import Command, FrameTemplate
from gateway.protocols.wireformat.command_set import load


class FrameError(GatewayError, ValueError):
    """The bytes are not a valid frame, or the values do not fit into a frame; the text says which and why."""


class Frame(Struct, frozen=True):
    """A command of a program, or a reply of a mount.

    ``name`` is the row of ``commands.toml``, ``values`` are its fields in the order of the bytes, and ``help`` says
    what the command is for. In a reply that refuses the command, ``fault`` is the error's name (``BelowHorizon``).
    """

    protocol: str
    name: str
    values: Mapping[str, object] = {}
    help: str = ""
    fault: str | None = None


def decode(protocol: str, frame: bytes, /) -> Frame:
    """Decode one whole command, such as ``b":Sr05:34:32#"``. Raises FrameError if it is unknown or invalid.

    >>> decode("lx200", b":Sr05:34:32#").values
    {'ra': 83.63333333333334}
    """
    match = load(_checked_protocol(protocol)).find(frame)
    if match is None:
        raise FrameError(f"{frame!r} is not a command of the {protocol} protocol")
    command, template = match
    try:
        return Frame(protocol, command.name, template.decode(frame), command.help)
    except ValueError as error:
        raise FrameError(f"{command.name} ({command.help}): {error}") from None


def encode(protocol: str, name: str, /, **values: object) -> bytes:
    """Encode a command as the gateway sends it. Raises FrameError for an unknown command, and values that do not fit.

    >>> encode("lx200", "Sr", ra=83.6333)
    b':Sr05:34:32#'
    >>> encode("nexstar", "e")
    b'e'
    """
    command = _find_command(protocol, name)
    if strange := sorted(values.keys() - command.request.fields.keys()):
        raise FrameError(f"{name} ({command.help}) has no {strange[0]}; it has {_join(command.request.fields)}")
    return _encode_frame(command, command.request, values)


def decode_reply(protocol: str, name: str, reply: bytes, /) -> Frame:
    """Decode a whole reply to the command of this name; a refusal sets ``fault``. Raises FrameError for other bytes.

    >>> decode_reply("lx200", "GD", b"+22*00:52#").values
    {'dec': 22.014444444444443}
    >>> decode_reply("lx200", "MS", b"1Object Below Horizon.#").fault
    'BelowHorizon'
    """
    command = _find_command(protocol, name)
    why = f"{name} ({command.help}) has no reply"
    for form, template in command.replies:
        try:
            return Frame(protocol, name, template.decode(reply), command.help, form.fault)
        except ValueError as error:
            why = f"{reply!r} is not a reply to {name} ({command.help}): {error}"
    raise FrameError(why)


def encode_reply(protocol: str, name: str, /, *, precision: str = "high", **values: object) -> bytes:
    """Encode the reply with these values to a command. Raises FrameError if the command or such a reply is unknown.

    ``precision`` is ``high`` or ``low``: an LX200 has two forms of reply for most angles.

    >>> encode_reply("lx200", "GR", ra=83.6333, precision="low")
    b'05:34.5#'
    """
    command = _find_command(protocol, name)
    for form, template in command.replies:
        if form.fault is None and form.when in (None, precision) and values.keys() == template.fields.keys():
            return _encode_frame(command, template, values)
    forms = [_join(template.fields) for form, template in command.replies if form.fault is None]
    raise FrameError(f"{name} ({command.help}) has no reply with {_join(values)}; {' or '.join(forms) or 'none'}")


class Splitter:
    """Splits the bytes that a program sends into whole commands, whatever pieces they arrive in.

    Damaged and unknown bytes are dropped by the rules of the protocol: an LX200 command ends with ``#``, a NexStar
    command at its length, and a pause discards an incomplete command. ``now`` returns the seconds of a monotonic clock.
    """

    def __init__(self, protocol: str, now: Callable[[], float] = time.monotonic) -> None:
        self._framer, self._clock = PROTOCOLS[_checked_protocol(protocol)].new_framer(), now

    def feed(self, data: bytes) -> list[bytes]:
        """Take received bytes and return the commands that are now complete, in order, each ready for ``decode``."""
        return self._framer.feed(data, self._clock())


def _checked_protocol(protocol: str) -> str:
    """Return ``protocol``. Raises FrameError if the registry does not have it."""
    if protocol not in PROTOCOLS:
        raise FrameError(f"{protocol!r} is not a protocol; there are {_join(PROTOCOLS)}")
    return protocol


def _find_command(protocol: str, name: str) -> Command:
    command = load(_checked_protocol(protocol)).commands.get(name)
    if command is None:
        raise FrameError(
            f"the {protocol} protocol has no command called {name!r}; see mappings/{protocol}/commands.toml"
        )
    return command


def _encode_frame(command: Command, template: FrameTemplate, values: Mapping[str, object]) -> bytes:
    """Encode a template with values. Raises FrameError that names the value that is missing or does not fit."""
    try:
        return template.encode(values)
    except KeyError as missing:
        raise FrameError(f"{command.name} ({command.help}) needs {missing.args[0]}") from None
    except (AttributeError, OverflowError, TypeError, ValueError) as error:
        raise FrameError(f"{command.name} ({command.help}): {_mismatch_text(template, values) or error}") from None


def _mismatch_text(template: FrameTemplate, values: Mapping[str, object]) -> str:
    """Return which value does not fit, and why if a codec says so (Python's texts are left out); empty if all fit."""
    for field, codec in template.fields.items():
        value = values[field]
        try:
            codec.encode(value)
        except (AttributeError, OverflowError, TypeError, ValueError) as error:
            from_codec = type(error) is ValueError and isinstance(value, Real) and isfinite(value)
            return f"{field} cannot be {value!r}" + (f": {error}" if from_codec else "")
    return ""


def _join(names: Iterable[str]) -> str:
    return ", ".join(names) or "no values"
