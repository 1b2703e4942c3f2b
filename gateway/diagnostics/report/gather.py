"""Read a recording once and collect what the report shows.

Bytes are decoded as by ``mount-gateway decode``. Each protocol names its commands for a position, a site and a goto.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from gateway.app.recording.format import RECORDER_SIDE, Event, Recording
from gateway.astro.spherical import separation, wrap180
from gateway.core.about import full_version
from gateway.core.errors import UserError
from gateway.core.wire_log import MOUNT_SIDE
from gateway.diagnostics.log.conversation import ConnectionDecoder, DecodedMessage
from gateway.diagnostics.recorded_sides import ConnectionProtocols
from gateway.diagnostics.report.night import Incident, Night, Pointing, ProgramConnections, SiteOfNight
from gateway.protocols.registry import PROTOCOLS

#: A position is stored if the last one is so many seconds old, or if the tube has moved by so many degrees since.
PERIOD, STEP = 10.0, 0.3
#: Right ascension and declination reported within so many seconds of each other belong together.
COORDINATE_PAIR_WINDOW = 3.0
#: The greatest number of unanswered requests that are remembered.
MAX_UNANSWERED = 64
#: The greatest number of remarks, and of refusals, that are stored.
MAX_REMARKS = 10_000


def gather_night(recording: Recording) -> Night:
    """Collect the data of a whole recording. Raises UserError if a line is invalid or nothing was recorded."""
    gathering = _NightCollector(recording)
    for event in gathering.protocols.protocol_lines_first(recording):
        gathering.process(event)
    night = gathering.night
    night.cut_reason = recording.incomplete_reason
    if not gathering.entry_count:
        raise UserError(f"{recording.parts[0]}: nothing happened in this recording, so there is nothing to report")
    return night


class _NightCollector:
    def __init__(self, recording: Recording) -> None:
        config = recording.settings["config"]
        self.protocols = ConnectionProtocols(recording)
        self._start_time = recording.settings["began"]
        mount = config["mount"]
        self.night = Night(
            mount["at"], [surface["at"] for surface in config["surface"]],
            self._start_time + recording.settings["from"],
            equinox=mount.get("equinox") or "jnow", lowest_alt=mount.get("lowest") or 0.0,
            highest_alt=90.0 if mount.get("highest") is None else mount["highest"],
        )  # fmt: skip
        self.night.ended = self.night.began
        by = recording.settings
        self.night.recorded_by = full_version(by.get("version", ""), by.get("commit", ""))
        if mount.get("site"):
            self.night.site = SiteOfNight(float(mount["site"][0]), float(mount["site"][1]), "the settings")
        self.entry_count = 0
        protocol = PROTOCOLS[self.protocols.protocol(MOUNT_SIDE)]
        self._command_names = protocol.log_commands
        self._answered_commands = {name for name, command in protocol.commands.commands.items() if command.replies}
        self._connection_decoders: dict[str, ConnectionDecoder] = {}
        self._programs: dict[str, ProgramConnections] = {}
        self._open_requests: deque[tuple[float, str]] = deque(maxlen=MAX_UNANSWERED)
        self._last_coordinates: dict[str, tuple[float, float]] = {}

    def process(self, event: Event) -> None:
        """Process a line of the recording."""
        time = self._start_time + event.time
        self.night.ended = max(self.night.ended, time)
        if event.side == RECORDER_SIDE:
            return
        self.entry_count += 1
        if event.side == MOUNT_SIDE:
            self._on_mount_event(event, time)
        else:
            self._on_program_event(event, time)

    # --- the mount's line -------------------------------------------------------------------------------------------

    def _on_mount_event(self, event: Event, time: float) -> None:
        if event.arrow in "!v^":
            text = event.data.decode("latin-1")
            if event.arrow == "v":
                text = f"the mount's port was lost: {text}" if text else "the mount's port was lost"
                self._count_unanswered(len(self._open_requests))
                self._connection_decoders.pop(MOUNT_SIDE, None)
            if text and len(self.night.remarks) < MAX_REMARKS:
                self.night.remarks.append(Incident(time, MOUNT_SIDE, text))
            return
        side = self._decoder(MOUNT_SIDE)
        if event.arrow == ">":
            for heard in side.decode_commands(event.data, event.time):
                if heard.command in self._answered_commands:
                    self._open_requests.append((event.time, heard.command))
                self.night.goto_count += heard.command in self._command_names.goto_commands
        else:
            for heard in side.decode_replies(event.data):
                self._match_reply(heard, event.time)

    def _match_reply(self, message: DecodedMessage, time: float) -> None:
        """Match a reply to the newest request of its command, count all older requests as unanswered, store values."""
        waiting = [place for place, (_, name) in enumerate(self._open_requests) if name == message.command]
        if waiting:
            self._count_unanswered(waiting[-1])
            asked, _ = self._open_requests.popleft()
            self.night.request_times.append(self._start_time + asked)
            self.night.reply_times.append(time - asked)
        if message.command in self._command_names.position_commands and not message.fails:
            self._add_pointing(message.fields, self._start_time + time)
        if message.command in self._command_names.site_commands and not message.fails:
            self._set_site(message.fields, self._start_time + time)

    def _count_unanswered(self, number: int) -> None:
        """Count this many of the oldest requests as unanswered."""
        for _ in range(number):
            self._open_requests.popleft()
        self.night.unanswered_count += number

    def _add_pointing(self, fields: Mapping[str, Any], time: float) -> None:
        self._last_coordinates |= {name: (time, fields[name]) for name in ("ra", "dec") if name in fields}
        if not {"ra", "dec"} <= set(self._last_coordinates) or "dec" not in fields:
            return
        (asked, ra), (_, dec) = self._last_coordinates["ra"], self._last_coordinates["dec"]
        if time - asked > COORDINATE_PAIR_WINDOW or not -90.0 <= dec <= 90.0:
            return
        places = self.night.pointings
        if not places or time - places[-1].time >= PERIOD or separation(places[-1].ra, places[-1].dec, ra, dec) > STEP:
            places.append(Pointing(time, ra, dec))

    def _set_site(self, fields: Mapping[str, Any], time: float) -> None:
        self._last_coordinates |= {name: (time, fields[name]) for name in ("latitude", "longitude") if name in fields}
        values = [self._last_coordinates.get(name) for name in ("latitude", "longitude")]
        if None in values or (self.night.site is not None and self.night.site.source != "the mount"):
            return
        latitude, longitude = (value[1] for value in values if value is not None)
        if abs(latitude) <= 90.0:
            self.night.site = SiteOfNight(latitude, wrap180(longitude * self._command_names.lon_sign), "the mount")

    # --- programs ---------------------------------------------------------------------------------------------------

    def _on_program_event(self, event: Event, time: float) -> None:
        if event.arrow == "+":
            self._connection_opened(event, time)
            return
        if event.arrow == "~":
            self._connection_decoders.pop(event.side, None)
            return
        program = self._programs.get(event.side)
        if event.arrow == "-":
            self._connection_decoders.pop(event.side, None)
            self._programs.pop(event.side, None)
        elif event.arrow == "!":
            if program is not None:
                program.refusal_count += 1
            if len(self.night.refusals) < MAX_REMARKS:
                who = event.side if program is None else program.host
                self.night.refusals.append(Incident(time, who, event.data.decode("latin-1")))
        elif event.arrow == ">":
            if program is None:
                program = self._add_program(event.side, event.side, self.protocols.protocol(event.side), time)
            for heard in self._decoder(event.side).decode_commands(event.data, event.time):
                program.commands[heard.command or "not understood"] += 1
                program.last_time = time

    def _connection_opened(self, event: Event, time: float) -> None:
        number = self.protocols.surface_numbers[event.side]
        host = event.data.decode("latin-1").rpartition("host ")[2]
        self._connection_decoders.pop(event.side, None)
        program = self._add_program(event.side, host, self.night.surfaces[number - 1], time)
        program.connection_count += 1

    def _add_program(self, side: str, host: str, surface: str, time: float) -> ProgramConnections:
        program = self.night.programs.setdefault((host, surface), ProgramConnections(host, surface, time, time))
        self._programs[side] = program
        return program

    def _decoder(self, side: str) -> ConnectionDecoder:
        if side not in self._connection_decoders:
            self._connection_decoders[side] = self.protocols.decoder(side)
        return self._connection_decoders[side]
