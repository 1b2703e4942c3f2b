"""Finds mistakes in the rows of ``mappings``, each with its file, its row and the reason.

A gateway reads the tables at every start, and they do not change once they are in a package; so what a start needs not
know is examined here. A value of the wrong type and an unknown key raise MappingError when a file is read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Literal

import msgspec

from gateway.core import errors, operations
from gateway.core.errors import MappingError
from gateway.mount.policy import Limits
from gateway.protocols.base.spec import DriverSettings, ProtocolSpec, SurfaceSettings
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import HANDLER_PARAMETERS, CommandSet, parameter_names
from gateway.protocols.wireformat.rows import ANY_MOUNT, LACKS_PREFIX, PRESENTED_PREFIX, Implementation, SurfaceRow


class ModelRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What a row of ``models.toml`` of any protocol may hold; the top of each file explains its keys."""

    like: str = ""
    dialect: str = ""
    title: str = ""
    mount: Literal["fork", "german", "alt-az", "equatorial"] = "fork"
    commands: list[str] = []
    beyond: bool = False
    # nexstar
    id: int = 0
    ids: tuple[int, int] = (0, 0)
    either: list[int] = []
    rates: str = ""
    versions: list[str] = []
    shifted: list[str] = []
    restarts: str = ""
    motors: str = ""
    has: list[Literal["gps", "rtc", "pec", "home", "pier"]] = []
    starsense: bool = False
    maker: str = ""
    hand_control: str = ""
    index: float = 0.0
    equinox: Literal["jnow", "j2000"] = "jnow"
    alt_az: str = msgspec.field(default="", name="alt-az")
    # lx200
    product: str = ""
    names_begin: list[str] = []
    firmware: str = ""
    firmware_date: str = ""
    firmware_time: str = ""
    full_name: str = ""
    sync_text: str = ""
    date_text: str = ""
    date_blanks: int = 0
    bars_moving: str = ""
    bars_idle: str = ""
    find_text: str = ""
    object_text: str = ""
    names: int = 0
    first_site: Literal[0, 1] = 0
    max_rate: float = 0.0
    max_rates: tuple[float, float] = (0.0, 0.0)
    hertz: tuple[float, float] = (0.0, 0.0)
    reticle: int = 0
    help: bool = False
    utc_date: bool = False
    libraries: bool = False
    status: bool = False
    polar: bool = False
    fork: bool = False
    by_effect: bool = False


def mistakes(protocol: CommandSet) -> Iterator[str]:
    """Yield what is wrong in the files of a protocol. Raises MappingError for a value of the wrong type."""
    if protocol.dialect:
        files = {protocol.dialect: lambda protocol: chain(_commands(protocol), _driver(protocol))}
    else:
        files = {"commands": _commands, "models": _models, "surface": _surface, "own": _own, "driver": _driver}
    for file, look in files.items():
        for row, reason in look(protocol):
            yield str(MappingError(f"mappings/{protocol.name}/{file}.toml", row, reason))


def calls(spec: ProtocolSpec) -> Iterator[str]:
    """Yield the rows that call a function that a protocol does not have, or that takes what a surface does not give."""
    if spec.make_surface is not None:
        handlers = spec.make_surface(SurfaceSettings(None, None, None, None, Limits())).surface.handlers
        for name, row in spec.commands.surface_rows.items():
            file = f"mappings/{spec.name}/surface.toml"
            if row.call is not None and row.call not in handlers:
                yield str(MappingError(file, name, f"call: there is no function {row.call!r}"))
            elif row.call is not None and (
                other := set(parameter_names(handlers[row.call])).difference(HANDLER_PARAMETERS)
            ):
                given = ", ".join(HANDLER_PARAMETERS)
                reason = f"call: {row.call} takes {', '.join(sorted(other))}; it is given only {given}"
                yield str(MappingError(file, name, reason))
    if spec.make_driver is not None:
        handlers = spec.make_driver(DriverSettings(), float).driver.handlers
        for tables in (spec.commands, *map(spec.commands.in_dialect_of, spec.commands.dialect_by_model)):
            for name, ways in tables.driver_rows.items():
                for way in [way for way in ways if way.call not in handlers]:
                    file = f"mappings/{spec.name}/{tables.dialect or 'driver'}.toml"
                    yield str(MappingError(file, name, f"call: there is no function {way.call!r}"))


def traits(protocol: CommandSet) -> frozenset[str]:
    """Return the traits of all models, the words that rows may require."""
    return frozenset().union(*(protocol.traits(model, wedge) for model in protocol.models for wedge in (False, True)))


Found = Iterator[tuple[str, str]]
_NO_COMMAND = "commands.toml has no such command"


def _unknown(names: Iterable[str], known: Iterable[str]) -> str:
    return ", ".join(sorted(set(names).difference(known)))


def _commands(protocol: CommandSet) -> Found:
    for name, command in protocol.commands.items():
        for reason in filter(None, _facts(protocol, command)):
            yield name, reason


def _facts(protocol: CommandSet, command: Command) -> Iterator[str]:
    """Yield what is wrong with the facts of a command, or empty texts."""
    if not command.requested and command.pushed is None:
        yield "it needs a request, or pushed"
    if command.is_query and command.answer_kind is None:
        yield "it asks for a value, so it needs answer"
    if command.answer_kind is not None and not command.is_query:
        yield "answer is for a command that asks for a value and does nothing else"
    if (command.urgent_values or command.discarded_commands) and command.urgent is None:
        yield "urgent_at and takes_back are for a command that is urgent"
    if unknown := _unknown(command.urgent_values, command.request.fields):
        yield f"urgent_at: the request has no field {unknown}"
    if unknown := _unknown(command.discarded_commands, protocol.commands):
        yield f"takes_back: there is no [{unknown}]"
    if unknown := _unknown(command.models or (), protocol.models):
        yield f"models: there is no {unknown}"
    for reply, _ in command.replies:
        if reply.fault is not None and not hasattr(errors, reply.fault):
            yield f"no fault is called {reply.fault}"


def _models(protocol: CommandSet) -> Found:
    forms = {reply.when for command in protocol.commands.values() for reply, _ in command.replies}
    for name, row in protocol.models.items():
        try:
            msgspec.convert(row, ModelRow)
        except msgspec.ValidationError as error:
            yield name, str(error)
        if row.get("like", name) not in protocol.models:
            yield name, f"like: there is no model {row['like']!r}"
        if unknown := _unknown(row.get("commands", ()), protocol.commands):
            yield name, f"commands: there is no {unknown}"
        spoken = row.get("dialect", "")
        if spoken and spoken not in forms and not (protocol.folder / f"{spoken}.toml").exists():
            yield name, f"dialect: there is no {spoken}.toml, and no reply for it in commands.toml"
        if (rates := row.get("rates")) and rates not in protocol.extra_table("rates.toml"):
            yield name, f"rates: rates.toml has no [{rates}]"


def _surface(protocol: CommandSet) -> Found:
    for name, row in protocol.surface_rows.items():
        reasons = _row(protocol, row, protocol.commands[name]) if name in protocol.commands else iter((_NO_COMMAND,))
        for reason in filter(None, reasons):
            yield name, reason


def _row(protocol: CommandSet, row: SurfaceRow, command: Command) -> Iterator[str]:
    """Yield what is wrong with a row of the surface, or empty texts."""
    if len(row.verbs) != 1:
        yield "one verb of ask, tell, say, call is needed"
    for name in row.operations:
        if operations.operation_class(name) is None:
            yield f"no operation is called {name!r}"
    asked = operations.operation_class(row.ask or "")
    if asked and (unknown := _unknown((*row.given, *command.request.fields), asked.__struct_fields__)):
        yield f"ask: {row.ask} has no field {unknown!r}"
    if row.given and row.ask is None:
        yield "given is only for a row with ask"
    if command.urgent in ("stop", "axis") and row.ask is None:
        yield "a command that ends a motion needs ask, which names the operation"
    if row.tell is not None or row.say is not None:
        yield from _reply(row, command)
    for kind in row.outcomes:
        for word in kind.split():
            if word.startswith(PRESENTED_PREFIX) and word.removeprefix(PRESENTED_PREFIX) not in traits(protocol):
                yield f"outcome: no model of models.toml is {word!r}"
            if word.startswith(LACKS_PREFIX) and operations.operation_class(word.removeprefix(LACKS_PREFIX)) is None:
                yield f"outcome: no operation is called {word.removeprefix(LACKS_PREFIX)!r}"
    if list(row.outcomes)[-1:] != [ANY_MOUNT]:
        yield f"the last kind of mount of an outcome is {ANY_MOUNT!r}"
    if "translated" in row.outcomes.values() and not row.operations:
        yield "what is translated needs ask, or call and asks"
    if "refused" in row.outcomes.values() and not row.why:
        yield "a refused row needs why"


def _reply(row: SurfaceRow, command: Command) -> Iterator[str]:
    """Check that a row that replies with values has those that its reply needs, and no others."""
    names = set(row.tell or row.say or ())
    templates = [template for reply, template in command.replies if reply.fault is None]
    forms = [set(template.fields) for template in templates]
    if forms and names not in forms:
        needed = ", ".join(sorted(forms[0])) or "no values"
        yield f"its reply has {needed}, not {', '.join(sorted(names)) or 'none'}"
        return
    if names and not forms:
        yield "the command has no reply"
    for template in templates if row.say else ():
        try:
            template.encode(row.say or {})
        except (ValueError, TypeError, KeyError) as error:
            yield f"say: {error!r}: its reply is {template.source!r}"


def _own(protocol: CommandSet) -> Found:
    yield from ((name, _NO_COMMAND) for name in protocol.own_rows if name not in protocol.commands)


def _driver(protocol: CommandSet) -> Found:
    for name, ways in protocol.driver_rows.items():
        if operations.operation_class(name) is None:
            yield name, "there is no operation of this name"
        for way in ways:
            for reason in filter(None, _way(protocol, name, way)):
                yield name, reason


def _way(protocol: CommandSet, name: str, way: Implementation) -> Iterator[str]:
    """Yield what is wrong with a row of the driver, or empty texts."""
    if name == "AbortMotion" and not way.ends:
        yield "it needs ends: its commands that end a motion and do nothing else"
    if unknown := _unknown((*way.commands, *way.ends), protocol.commands):
        yield f"commands.toml has no [{unknown}]"
    if way.part is not None and way.part not in traits(protocol):
        yield f"part: no model of models.toml has {way.part!r}"
