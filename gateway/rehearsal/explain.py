"""What happens to one command: words and bytes on both sides, found by running it through the real surface and driver.

The mount is a stand-in that answers every question with something plausible and never moves.
"""

from __future__ import annotations

import time
from datetime import date
from typing import TYPE_CHECKING, Any

from gateway import operations as op
from gateway.codecs import Codec
from gateway.driver import Ask, Driver, Steps
from gateway.errors import Fault, UserError
from gateway.logline import meaning, show
from gateway.mount.site.astrometry import SiteAstrometry
from gateway.mount.site.ephemeris_reads import PLACES
from gateway.observatory import Observatory
from gateway.pairs import effective, outcome, taken
from gateway.recording import unescape
from gateway.sky import Sky
from gateway.surface import Again, Defer, Possible, Session, Speed, Start, Surface
from gateway.tables import load

if TYPE_CHECKING:
    from gateway.config import Endpoint

_SITE = op.Place(45.0, 10.0)
_PLACE = op.Equatorial(83.633, 22.0145)


def explain(surface: str, scope: str, typed: str) -> str:
    """Lines of text. ``surface`` and ``scope`` are ``PROTOCOL[:MODEL[/VERSION]]``.

    Raises UserError for one of them that does not exist, and for a command that the protocol does not have.
    """
    from gateway.config import parse_device

    face, at = parse_device(surface), parse_device(scope)
    client, mount = face.protocol, at.protocol
    frame = unescape(typed)
    protocol, driven = load(client), load(mount)
    version = effective(driven, at.model, at.version) if at.model and at.version else None
    found = protocol.find(frame)
    if found is None:
        raise UserError(f"{client} has no command {typed!r}{_hint(client, frame)}")
    command, picture = found
    row = protocol.surface.get(command.name)
    lines = [f"{show(frame)}  {command.help}"]
    if command.models is not None:
        lines.append(f"  by the manual only on {', '.join(sorted(command.models))}")
    if face.version and not command.known_to(None, effective(protocol, face.model or "", face.version)):
        lines.append(f"  a hand control of version {face.version} does not know it and passes over all of it")
        return "\n".join(lines)
    if command.beyond:
        lines.append(f"  beyond the manual: {command.beyond}")
    try:
        values = picture.decode(frame)
        lines += [f"  {name} = {value}" for name, value in values.items()]
    except ValueError as error:
        lines.append(f"  not valid: {error}")
    name = f"{at.model or mount}{f'/{at.version}' if at.version else ''}"
    lines.append(f"outcome on a {name} mount: {outcome(row, driven, at.model, version)}")
    if row is not None and row.why:
        lines.append(f"  {row.why}")
    if at.model:
        lines += [f"  {way.why}" for way in taken(row, driven, at.model, version) if way.why]
    if row is not None:
        lines += _run(face, at, frame)
    return "\n".join(lines)


def _hint(client: str, frame: bytes) -> str:
    """What may be wrong with it."""
    other = "nexstar" if client == "lx200" else "lx200"
    if load(other).find(frame) is not None:
        return f"; it is one of {other}: write explain {other} {client}"
    if client == "lx200" and not frame.endswith(b"#"):
        return "; its # is missing"
    return ""


def _run(surface_at: Endpoint, mount_at: Endpoint, frame: bytes) -> list[str]:
    """The command carried out on a mount that only answers."""
    from gateway.assembly import DRIVERS, FACES
    from gateway.config import MountConfig, SurfaceConfig
    from gateway.mount.safety.limits import Limits

    face = FACES[surface_at.protocol](surface_at, SurfaceConfig(at="-"), Limits())
    driver, _, dialogue = DRIVERS[mount_at.protocol](mount_at, MountConfig(at="-"), time.monotonic)
    surface: Surface = face.surface
    session = Session(face.model, face.settings, time.time, {"sites": {}})
    session.kept.update(ra=_PLACE.ra, dec=_PLACE.dec, az=180.0, alt=45.0)
    lines: list[str] = ["  for example, with the Crab nebula as the target and an aligned mount that tracks:"]
    stand_in = _StandIn(driver, dialogue, lines)
    steps = surface.handle(session, frame)
    answer: Any = None
    fault: Fault | None = None
    try:
        while True:
            wanted = steps.send(answer) if fault is None else steps.throw(fault)
            answer, fault = None, None
            if isinstance(wanted, Speed):
                lines.append(f"  a serial port goes on at {wanted.baud} baud")
                continue
            if isinstance(wanted, Defer | Possible):
                continue
            operation = wanted.operation if isinstance(wanted, Start | Again) else wanted
            lines.append(f"  means {_words(operation)}")
            try:
                answer = stand_in.perform(operation)
            except Fault as error:
                fault = error if not isinstance(wanted, Start) else None
                lines.append(f"    {error}")
    except StopIteration as end:
        reply = end.value
    lines.append(f"reply: {show(reply) if reply else 'none'}")
    return lines


def _words(operation: op.Operation) -> str:
    fields = ", ".join(f"{f}={getattr(operation, f)!r}" for f in operation.__struct_fields__
                       if getattr(operation, f) is not None)
    return f"{type(operation).__name__}({fields})"


class _StandIn:
    """Performs operations on a driver whose mount answers each command with the emptiest true-looking reply."""

    def __init__(self, driver: Driver, dialogue: Any, lines: list[str]) -> None:
        self.driver, self.dialogue, self.lines = driver, dialogue, lines
        self.derived = SiteAstrometry(Sky(), Observatory(time.monotonic, time.time, _SITE), "jnow")

    def perform(self, operation: op.Operation) -> Any:
        if isinstance(operation, op.SiderealTime):
            return self.derived.sidereal_time()
        if type(operation) in PLACES:
            self.derived.sky.load()
            return PLACES[type(operation)](self.derived, operation)
        if isinstance(operation, op.SetSite):
            operation = op.SetSite(operation.latitude if operation.latitude is not None else _SITE.latitude,
                                   operation.longitude if operation.longitude is not None else _SITE.longitude)
        if isinstance(operation, op.GotoHorizontal):
            operation = op.GotoAxes(operation.az, operation.alt)
        answer = self._drive(self.driver.perform(operation))
        if isinstance(operation, op.HorizontalPosition) and answer is None:  # the axes of an equatorial mount are none
            return self.derived.horizon(_PLACE)
        return answer

    def _drive(self, steps: Steps) -> Any:
        answer: Any = None
        try:
            while True:
                step = steps.send(answer)
                answer = None
                if isinstance(step, Ask):
                    request = self.dialogue.encode(step)
                    answer = self._answer(step)
                    words = meaning(self.driver.protocol.name, request)
                    self.lines.append(f"    to the mount: {show(request)}  {words}")
        except StopIteration as end:
            return end.value

    def _answer(self, ask: Ask) -> dict[str, Any]:
        """Something plausible for every field of the reply."""
        command = self.driver.protocol.commands[ask.command]
        if not command.replies:
            return {}
        picture = command.replies[0][1]
        fields = {name: _plausible(name, field) for name, field in picture.fields.items()}
        return {**fields, "length": len(picture.encode(fields))}


_KNOWN: dict[str, Any] = {
    "ra": _PLACE.ra, "dec": _PLACE.dec, "az": 180.0, "alt": 45.0, "aligned": 1, "mode": 1, "slewing": "0",
    "latitude": _SITE.latitude, "longitude": _SITE.longitude, "month": 1, "day": 1, "year": 26, "side": "E",
    "linked": 1, "echo": 120, "major": 4, "minor": 21, "model": 12,
}  # fmt: skip


def _plausible(name: str, field: Codec) -> Any:
    """What is known by this name, else whatever such a field can carry: letters of modes, a number, a text, a date."""
    for value in (_KNOWN.get(name, 0), "A", "T", "1", date(2026, 1, 1)):
        try:
            return field.decode(field.encode(value))
        except (ValueError, TypeError, AttributeError):
            continue
    return 0
