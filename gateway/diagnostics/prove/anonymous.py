"""Makes a recording anonymous: nobody may find out from it where the mount stands, or whose it is.

Longitude and every clock are shifted together by some hours and minutes of sidereal time, so that the sky over the
mount stays as it was; the latitude is rounded to 5 degrees. Altitudes and azimuths are those of the same hour angle and
declination at that site. Only the check's own connections are kept, no name, path, address or note, and of a server's
values no text. A reply counts as that to the question before it, and loses its characters if it cannot be understood.
What cannot be hidden is refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import msgspec

from gateway.app.config import MountConfig, SurfaceConfig, parse_endpoint
from gateway.app.recording.format import FORMAT, MARK, RECORDER, Event, Recording, escape
from gateway.app.state.file import SavedState
from gateway.app.state.store import PreviousRun
from gateway.core import requests
from gateway.core.errors import UserError
from gateway.core.operations import Values
from gateway.core.wire_log import MOUNT, SKY_READY
from gateway.diagnostics.log.conversation import Heard
from gateway.diagnostics.prove.elsewhere import Elsewhere, configured, conversation
from gateway.diagnostics.prove.reads import ASKS_AGAIN, GARBLED
from gateway.diagnostics.prove.telescope import WHO
from gateway.protocols.registry import streams
from gateway.protocols.wireformat.command_set import load

#: Degrees or seconds: a change that every reply shows.
SEEN = 1.0 / 30.0
#: Fields of commands that would tell the site, the time or a name, and questions that are left out with their answers.
PRIVATE = frozenset(
    ("latitude", "longitude", "elevation", "date", "time", "hour", "month", "year", "offset", "unix", "name", "text")
)
LEFT_OUT = ("gps", "GM", "GN", "GO", "GP", "ED", "LI")
#: Settings of a mount that a bundle keeps.
KEPT = ("baud", "mode", "equinox", "site_time", "computer_clock", "lowest", "highest", "sync_limit", "guide_rate",
        "guide_directions", "unaligned", "sun", "hour_angle_limit", "dead_man", "dead_man_closed", "run_on", "rates",
        "speed")  # fmt: skip


def header(settings: dict[str, Any], there: Elsewhere) -> dict[str, Any]:
    """Return the settings of the anonymous recording: nothing that names a place, a computer or a file."""
    mount = settings["config"]["mount"]
    kept = {name: value for name, value in mount.items() if name.replace("-", "_") in KEPT}
    kept |= {"at": f"{str(parse_endpoint(mount['at'])).partition('@')[0]}@sim"}
    kept |= {"site": [there.latitude, there.longitude]} if configured(settings) else {}
    surfaces = [
        SurfaceConfig(at=f"{parse_endpoint(one['at']).protocol}@tcp://127.0.0.1:0")
        for one in settings["config"]["surface"]
    ]
    shown = {name: settings[name] for name in ("version", "commit", "rules", "python", "exchanges", "elapsed", "from")}
    shown |= {"began": settings["began"] - there.seconds, "past": PreviousRun(SavedState(1))}
    shown["config"] = {"mount": msgspec.convert(kept, MountConfig), "surface": surfaces}
    found: dict[str, Any] = msgspec.to_builtins(shown)
    return found


def anonymous(recording: Recording, there: Elsewhere, equatorial: bool, model: str) -> list[Event]:
    """Return the events of the anonymous recording. Raises UserError if something in it cannot be hidden."""
    protocol = parse_endpoint(recording.settings["config"]["mount"]["at"]).protocol
    hiding = _Hiding(protocol, model, there, equatorial)
    events = list(hiding.events(recording))
    hiding.check(events)
    return events


def written(settings: dict[str, Any], events: Iterable[Event]) -> bytes:
    """Return a recording as the bytes of its file."""
    lines = [f"{MARK}{FORMAT}", f"# {json.dumps(settings)}"]
    for event in events:
        text = escape(event.data) if event.arrow in "<>" else event.data.decode("latin-1")
        lines.append(f"{event.at:.6f} {event.side} {event.arrow} {text}".rstrip(" "))
    return ("\n".join(lines) + "\n").encode("latin-1")


class _Hiding:
    def __init__(self, protocol: str, model: str, there: Elsewhere, equatorial: bool) -> None:
        self._there = there
        self._protocol, self._model = protocol, model
        #: Whether it is a server, whose values are JSON.
        self._server = protocol not in streams()
        #: Whether azimuth and altitude are the axes of an equatorial mount, which tell no more than its position does.
        self._axes = equatorial and "axes_of" in load(protocol).extra("prove.toml").get("overhead", {})
        self._commands = load(protocol).of(model).commands
        #: Where it points, and its local time when the recording begins, as it has told them last, or will at first.
        self._now: Values = {}
        #: The replies that tell the site, and those that must not be found at their time any more.
        self._sites: set[bytes] = set()
        self._gone: set[tuple[float, bytes]] = set()

    def events(self, recording: Recording) -> Iterator[Event]:
        """Yield the anonymous events. Raises UserError if something cannot be hidden."""
        for event, said in conversation(recording, self._protocol, self._model):
            for heard in said if event.arrow == "<" else ():
                self._now = self._tells(heard, event.at) | self._now
                if {"latitude", "longitude"} & heard.fields.keys():
                    self._sites.add(heard.data)
        last = 0.0
        for event, said in conversation(recording, self._protocol, self._model):
            if event.data == ASKS_AGAIN.encode():
                break
            last = event.at
            if event.side == RECORDER:
                if event.arrow == "t":
                    yield event
            elif event.side == MOUNT:
                yield from self._of_mount(event, said)
            elif event.side.startswith("prove:") and event.arrow in "+-<>e":
                yield event
        yield Event(last, RECORDER, "!", b"ends here: the rest is left out")

    def check(self, events: Iterable[Event]) -> None:
        """Raise UserError if a reply that tells something private is in the bundle as the mount has sent it."""
        for event, said in conversation(events, self._protocol, self._model):
            if gone := [one.command for one in said if (event.at, one.data) in self._gone]:
                raise UserError(
                    f"the mount's answer to {gone[0]} was not hidden: please tell whoever gave you mount-gateway"
                )

    def _of_mount(self, event: Event, said: Sequence[Heard]) -> Iterator[Event]:
        match event.arrow:
            case ">":
                name = said[0].command
                command = self._commands.get(name)
                if command is not None and not command.question and PRIVATE & command.request.fields.keys():
                    raise UserError(f"somebody has set the mount's {command.help} meanwhile: check it again, alone")
                if name not in LEFT_OUT:
                    yield event
            case "<":
                replies = [one for one in said if one.command and one.command not in LEFT_OUT]
                if replies:
                    yield event._replace(data=b"".join(self._reply(one, event.at) for one in replies))
            case "k":
                yield event._replace(data=repr(float(event.data) - self._there.seconds).encode())
            case "g":
                number, _, failure = event.data.partition(b" ")
                yield event._replace(data=number + b" failed" * bool(failure))
            case "c":
                request = requests.decode(event.data.decode("latin-1"))
                if isinstance(request, requests.TellSite | requests.TellTime):
                    raise UserError("somebody has set the mount's site or time meanwhile: check it again, alone")
                if isinstance(request, requests.Base):
                    request = msgspec.structs.replace(request, who=WHO)
                yield event._replace(data=requests.encode(request).encode())
            case "l" | "w":
                yield event._replace(data=b"lost")
            case "!" if event.data == SKY_READY.encode():
                yield event
            case "b" | "s" | "q" | "d" | "o" | "h" | "u":
                yield event._replace(data=b"")

    def _tells(self, heard: Heard, at: float) -> Values:
        """Return what a reply tells of where the mount points, and of its local time when the recording begins."""
        told: Values = dict(heard.fields)
        time = {"time": told["time"] - at} if heard.command in ("GL", "Ga") and told else {}
        return {name: told[name] for name in ("az", "alt") if name in told} | time

    def _reply(self, heard: Heard, at: float) -> bytes:
        """Return a reply as it would be there; one that cannot be understood loses its characters."""
        command, data = heard.command, heard.data
        told: Values = dict(heard.fields)
        self._now |= self._tells(heard, at)
        words = any(isinstance(value, str) for value in told.values())
        if (heard.fails and GARBLED in heard.words.lower()) or (words and data in self._sites):
            return b"?" * (len(data) - 1) + data[-1:]
        if self._axes and "az" in told:
            return data
        if self._server and data.startswith(b'{"ErrorNumber"'):
            return _json(json.loads(data) | {"ErrorMessage": ""})
        if self._server and "value" in told:
            return _json(self._plain(command, told["value"], at))
        time = {"time": (self._now["time"] + at) % 86400} if "time" in self._now else {}
        moved = self._there.moved(command, told, self._now | time)
        if moved == told:
            return data
        if any(isinstance(value, float | int) and abs(value - told[name]) > SEEN for name, value in moved.items()):
            self._gone.add((at, data))
        forms = [form for _, form in self._commands[command].replies if form.fields.keys() == moved.keys()]
        if forms:
            hidden = [form.encode(moved) for form in forms]
            return next((one for one in hidden if len(one) == len(data)), hidden[0])
        raise UserError(f"the mount's answer to {command} cannot be hidden")

    def _plain(self, command: str, value: object, at: float) -> object:
        """Return a value of a server without any text, and the entries of its state as they would be there."""
        if command == "devicestate" and isinstance(value, list):
            state = {one["Name"]: _json(one["Value"]) for one in value if str(one["Name"]).lower() in self._commands}
            told = {name: self._commands[name.lower()].replies[0][1].decode(data) for name, data in state.items()}
            self._now |= {**told.get("Azimuth", {}), **told.get("Altitude", {})}
            heard = {name: Heard(data, "", name.lower(), fields=told[name]) for name, data in state.items()}
            return [{"Name": name, "Value": json.loads(self._reply(one, at))} for name, one in heard.items()]
        match value:
            case str():
                return ""
            case dict():
                return {key: self._plain("", one, at) for key, one in value.items()}
            case list():
                return [self._plain("", one, at) for one in value]
        return 0 if command == "siteelevation" else value


def _json(value: object) -> bytes:
    return json.dumps(value).encode() + b"\n"
