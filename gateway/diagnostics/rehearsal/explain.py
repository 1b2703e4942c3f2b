"""Explain a command: its meaning and the bytes on both sides, found by sending it through a complete gateway.

The mount is simulated, aligned and tracking, in virtual time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

from msgspec.structs import replace

from gateway.app.bindings import presents_mount
from gateway.app.config import Endpoint, parse_device
from gateway.app.recording.format import unescape
from gateway.astro.ephemeris.almanac import SHIPPED_FILE, decode
from gateway.astro.ephemeris.sky import Sky
from gateway.core.errors import UserError
from gateway.core.wire_log import printable
from gateway.diagnostics.command_outcomes import OUTCOME_MEANINGS, MountKind, choose_ways, outcome, remarks
from gateway.diagnostics.log.conversation import ConnectionDecoder
from gateway.diagnostics.log.words import format_fields
from gateway.diagnostics.rehearsal.play import (
    Prelude,
    Trace,
    Tracer,
    is_refused,
    may_change_mount,
    observation_time,
    set_up_gateway,
)
from gateway.diagnostics.rehearsal.samples import example_request
from gateway.diagnostics.virtual_time import run
from gateway.protocols.base.surface import ACKNOWLEDGED
from gateway.protocols.registry import PROTOCOLS, drivers
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet, load
from gateway.protocols.wireformat.rows import REUSE_DESCRIPTIONS, Model, SurfaceRow, Version

#: How long the gateway is idle before the command, seconds.
IDLE_TIME = 3.0
#: The outcome of a command if the mount is already in the wanted state.
NOTHING_TO_DO_OUTCOME = "nothing to do (the mount is as the command wants it)"
TABLES_HINT = "; mappings/README.md lists them all"
#: How many equal commands in a row are shown.
MAX_EQUAL_COMMANDS = 3


class Explanation(NamedTuple):
    """A command, explained as text. ``is_possible``: whether the presented model has the command, with valid values."""

    text: str
    is_possible: bool


def explain(surface: str, mount: str, typed_command: str) -> Explanation:
    """Explain a command. ``surface`` and ``mount`` are ``PROTOCOL[:MODEL[/VERSION]]``, or only a model. Raises
    UserError if one of them does not exist or cannot be used, or if the protocol does not have the command.
    """
    face, at = parse_device(surface), parse_device(mount, role="mount")
    if at.protocol not in drivers():
        raise UserError(f"{at.protocol} mounts cannot be driven; {' or '.join(drivers())} can")
    at = with_defaults(at)
    frame = unescape(typed_command)
    protocol, driven = load(face.protocol), load(at.protocol).in_dialect_of(at.model)
    match = protocol.find(frame)
    if match is None:
        hint = _unknown_command_hint(face.protocol, at.protocol, frame) or TABLES_HINT
        raise UserError(f"{face.protocol} has no command {typed_command!r}{hint}")
    command, picture = match
    row = protocol.surface_rows.get(command.name)
    lines = [f"{printable(frame)}  {command.help}"]
    if command.models is not None:
        lines.append(f"  by the manual only on {', '.join(sorted(command.models))}")
    version = PROTOCOLS[face.protocol].command_set_version(face.version) if face.version else None
    if face.model in command.lacking_models:
        lines.append(f"  a {face.model} does not have it: nothing is done")
        return Explanation("\n".join(lines), False)
    if not command.exists_on(None, version):
        lines.append(f"  a hand control of version {face.version} does not know it, and ignores it")
        return Explanation("\n".join(lines), False)
    valid = True
    if command.beyond:
        lines.append(f"  beyond the manual: {command.beyond}")
    try:
        if values := format_fields(face.protocol, command.name, picture.decode(frame)):
            lines.append(f"  {values}")
    except ValueError as error:
        lines.append(f"  not valid: {error}")
        valid = False
    play, observed, listed = rehearse_command(face, at, frame)
    if presents_mount(at, face):
        lines += _native_command_lines(protocol, command.name)
    elif not valid:
        lines.append(f"outcome: {_outcome_text('refused', play.reply)}")
    else:
        lines.append(f"outcome on {_name_with_article(at)} mount: {_outcome_text(observed, play.reply)}")
        if observed == "refused" != listed:
            lines.append(f"  with other values, or in another state: {listed}")
        for otherwise, changed in _circumstances(at):
            if (other := rehearse_command(face, at, frame, **changed)[1]) != observed:
                lines.append(f"  {otherwise}: {other}")
        ways = choose_ways(row, driven, MountKind(at.model or "", version_tuple(at)))
        lines += [f"  {remark}" for remark in remarks(row, ways)]
    first = f"after {' '.join((*row.after, *row.during))}, " if row and (row.after or row.during) else ""
    lines.append(f"for example, {first}with the Crab nebula as the target and an aligned mount that tracks:")
    return Explanation("\n".join([*lines, *format_trace(play, face.protocol, at)]), valid)


@cache
def rehearsal_sky() -> Sky:
    """Return a sky with the almanac of the rehearsals' days, which is in the package: astropy is not needed."""
    exact = Sky()
    exact.use(decode(SHIPPED_FILE.read_bytes()))
    return exact


def with_defaults(mount: Endpoint) -> Endpoint:
    """Return the mount, with the protocol's default model and that model's last listed version where none is given."""
    model = mount.model or PROTOCOLS[mount.protocol].default_model or ""
    versions = load(mount.protocol).models[model].get("versions", [None])
    return replace(mount, model=model, version=mount.version or versions[-1])


def version_tuple(mount: Endpoint) -> Version | None:
    """Return the comparable version that decides which commands a mount knows; None without a version."""
    return PROTOCOLS[mount.protocol].command_set_version(mount.version) if mount.version else None


def presented_traits(surface: Endpoint, command: Command, facts: Model | None = None) -> frozenset[str]:
    """Return the traits of a presented model, as the tables name them; none if its version lacks the command (it never
    lacks one beyond the manual). ``facts``: the model as fitted to the mount, without the parts that the mount lacks.
    """
    spec = PROTOCOLS[surface.protocol]
    protocol, model = spec.commands, facts["name"] if facts else surface.model or spec.default_model or ""
    version = spec.command_set_version(surface.version) if surface.version else None
    return protocol.traits(model, facts=facts) if command.exists_on(None, version) or command.beyond else frozenset()


def commands_before(surface: Endpoint, row: SurfaceRow) -> Prelude:
    """Return the commands that a program sends before the command of ``row``: some are completed then, some not."""
    spec = PROTOCOLS[surface.protocol]
    completed = (*spec.required_requests, *spec.target_requests, *row.after)
    return Prelude(tuple(map(unescape, completed)), tuple(map(unescape, row.during)))


def rehearse_command(
    surface: Endpoint, mount: Endpoint, frame: bytes, *, aligned: bool = True, wedge: bool = False, missing: str = ""
) -> tuple[Trace, str, str]:
    """Send a frame through a new gateway, which presents the surface's model (if None, one that fits the mount).

    Return the trace and two outcomes, such as ``translated``: the observed one, and the one by the tables. These differ
    if the command is refused, or if the mount need not do anything.
    """
    protocol, driven = load(surface.protocol), load(mount.protocol).in_dialect_of(mount.model)
    match = protocol.find(frame)
    assert match is not None
    command, row = match[0], protocol.surface_rows.get(match[0].name)

    async def play() -> tuple[Trace, str, str]:
        async with set_up_gateway(
            surface, mount, rehearsal_sky(), aligned=aligned, wedge=wedge, missing=missing
        ) as whole_gateway:
            await whole_gateway.gateway.present_fitting_model()
            await asyncio.sleep(IDLE_TIME)  # readings in the cache expire, so that the mount is asked
            played = await Tracer(whole_gateway).trace(
                frame,
                Prelude() if row is None else commands_before(surface, row),
                observation_time(command, aligned and bool(command.replies)),
            )  # an arrow may be carried out in many steps
            presented = presented_traits(surface, command, dict(whole_gateway.binding.model))
            listed = outcome(row, driven, MountKind(mount.model or "", version_tuple(mount), aligned, wedge), presented)
            if is_refused(played, command, whole_gateway.binding.surface):
                return played, "refused", listed
            idle = (
                listed in ("translated", "refused")
                and not played.steps_of_kind("act")
                and row
                and any(map(may_change_mount, row.operations))
            )
            return played, NOTHING_TO_DO_OUTCOME if idle else listed, listed

    result: tuple[Trace, str, str] = run(play())
    return result


def _circumstances(mount: Endpoint) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield other circumstances (not aligned, on a wedge, without a part): as text, and as settings to try."""
    driven, spec = load(mount.protocol).in_dialect_of(mount.model), PROTOCOLS[mount.protocol]
    yield "before the alignment", {"aligned": False}
    if driven.traits(mount.model or "") != driven.traits(mount.model or "", on_wedge=True):
        yield "on a wedge", {"wedge": True}
    for part in (name for name, has in spec.rehearsal_settings(False).items() if has):
        yield f"without a {part}", {"missing": part}


def _name_with_article(endpoint: Endpoint) -> str:
    model = str(endpoint.model)
    return f"{'an' if model[0] in 'aeilo' else 'a'} {model}{f'/{endpoint.version}' if endpoint.version else ''}"


def _outcome_text(outcome: str, reply: bytes) -> str:
    """Return an outcome with its meaning; for a refusal, whether the client or only the log receives it."""
    if outcome != "refused":
        return f"{outcome} ({OUTCOME_MEANINGS[outcome]})" if outcome in OUTCOME_MEANINGS else outcome
    if not reply:
        return "refused (this command has no reply: only the log says so)"
    if reply == ACKNOWLEDGED:
        return "refused (the reply is # all the same, because this protocol has no other: only the log says so)"
    return "refused (the reply says so)"


def _native_command_lines(protocol: CommandSet, name: str) -> list[str]:
    """Return lines on who answers a command if client and mount speak the same protocol."""
    row = protocol.own_rows.get(name)
    who = f"the mount itself, {REUSE_DESCRIPTIONS[row.keep]}" if row is not None and row.keep else "the gateway"
    return [f"answered by {who}", *([f"  {row.why}"] if row is not None and row.why else [])]


def _unknown_command_hint(client: str, mount: str, frame: bytes) -> str:
    driven = client if client in drivers() else mount
    for other, spec in PROTOCOLS.items():
        if other != client and spec.commands.find(frame) is not None:
            return f"; it is one of {other}: write explain {other} {driven}"
    if (hint := PROTOCOLS[client].hint) is not None:
        return f"; {advice}" if (advice := hint(frame)) else ""
    alike = [command for command in load(client).commands.values() if command.request.prefix[:1] == frame[:1]]
    return f"; {alike[0].help} is written like '{printable(example_request(alike[0]))}'" if alike else ""


def format_trace(trace: Trace, surface_protocol: str, mount: Endpoint) -> list[str]:
    """Format a trace: meaning, notes, commands to the mount until the reply, later ones that change it, the reply."""
    program, driven = ConnectionDecoder(surface_protocol), ConnectionDecoder(mount.protocol, mount.model)
    lines: list[str] = []
    answered, last, again = False, "", 0
    for event in trace.events:
        line = ""
        if event.kind == "reply":
            answered = True
        elif event.kind == "means":
            line = f"  the gateway understands: {event.text}"
        elif event.kind == "act" or (event.kind == "look" and not answered):
            heard = driven.describe_command(event.data)
            line = f"    to the mount: {printable(event.data)}  {heard.text}"
            again = again + 1 if heard.command == last else 0
            last = heard.command
            if again == MAX_EQUAL_COMMANDS:
                line = "    to the mount: and so on"
            elif again > MAX_EQUAL_COMMANDS:
                continue
        elif event.kind == "note":
            line = f"    {event.text}"
        elif event.kind == "baud":
            line = f"  a serial port goes on at {event.text} baud"
        if line and line not in lines[-1:]:
            lines.append(line)
    program.describe_command(trace.frame)
    meaning = program.describe_reply_to_last(trace.reply).text.partition(": ")[2] if trace.reply else ""
    same = meaning.strip('"') == printable(trace.reply).removesuffix("#")  # a name needs no explanation
    about = "" if same or meaning in ("", "accepted") else f"  ({meaning})"
    return [*lines, f"reply: {printable(trace.reply) if trace.reply else 'none'}{about}"]
