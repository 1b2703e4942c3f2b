"""The specification of Meade's LX200 protocol for the registry."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gateway.core.errors import UserError
from gateway.core.wire_log import printable
from gateway.protocols.base.spec import (
    DriverSettings,
    LogCommands,
    MadeDriver,
    MadeSurface,
    Probe,
    ProtocolSpec,
    SurfaceSettings,
    lazy,
)
from gateway.protocols.wireformat.command_set import functions_of, load, surface_functions

if TYPE_CHECKING:
    from gateway.protocols.base.driver import FollowUps
    from gateway.protocols.lx200.simulator.server import SimulatedLx200

NAME, DEFAULT_MODEL = "lx200", "autostar"
ACK, POSITION = b"\x06", b"#:GR#"
#: ACK to an unknown device: the # ends what it may have read before, because some answer ACK outside a command only.
HASH_ACK = b"#\x06"
#: A single letter is an answer to ACK only if nothing follows it for this many seconds.
ACK_QUIET_PERIOD = 0.1
#: The degree character as the tables write it.
_DEGREES = re.compile(rb"(\d)\*(?=\d\d|#)")
_POSITION = rb"\d\d:\d\d(\.\d|:\d\d)#"
#: What a program for a Meade may begin a connection with: bytes that are ignored, and whole commands.
OPENING = rb"(?s)(?:[#\r\n\0 ?]|\x06|:[^#]*#|\$Q#)*"


def _make_surface(settings: SurfaceSettings) -> MadeSurface:
    from gateway.protocols.base.session import ClientSettings
    from gateway.protocols.base.surface import Surface
    from gateway.protocols.lx200.session import LxSession
    from gateway.protocols.lx200.surface import accessories, clock, motion, objects, site, target

    protocol = load(NAME)
    name = settings.model or DEFAULT_MODEL
    if name not in protocol.presented_models:
        raise UserError(f"a surface cannot present {name}: write {' or '.join(protocol.presented_models)}, or no model")
    handlers = surface_functions(accessories, clock, motion, objects, site, target)
    surface = Surface(protocol, handlers)
    surface.contradicts_client, surface.session_type = clock.contradicts_client, LxSession
    if settings.degree != "*":
        surface.to_mount_form = lambda name, reply: _DEGREES.sub(b"\\1\xdf", reply)
    return MadeSurface(
        surface,
        {**protocol.models[name], "name": name},
        ClientSettings(settings.limits, settings.precision or "high", settings.sync_text),
    )


def _make_driver(settings: DriverSettings, now: Callable[[], float]) -> MadeDriver:
    from gateway.protocols.lx200.driver import dialect, drive, ends, home, identify, motion, place, pointing
    from gateway.protocols.lx200.driver.state import Lx200Driver
    from gateway.protocols.lx200.reply_rules import Lx200ReplyRules

    handlers = functions_of(drive, home, identify, motion, place, pointing)
    driver = Lx200Driver(now, settings, handlers)
    follow_ups: FollowUps = {
        home.CheckHomeSearch: home.check_home_search,
        ends.RepeatEnd: ends.repeat_end,
        ends.RestoreRates: ends.restore_rates,
        dialect.CheckArrow: dialect.check_arrow_motion,
    }
    return MadeDriver(driver, follow_ups, Lx200ReplyRules(settings.model, driver))


def _make_simulator(model: str | None, version: str | None, **settings: Any) -> SimulatedLx200:
    from gateway.protocols.lx200.simulator.controllers import SimulatedController
    from gateway.protocols.lx200.simulator.server import SimulatedLx200

    other = load(NAME).in_dialect_of(model).dialect_rows
    made = SimulatedController if other is not None and other.facts else SimulatedLx200
    return made(model or DEFAULT_MODEL, **settings)


def _lx200_confidence(sent: bytes) -> float:
    """Return 1.0 if the bytes begin (after any #) with a colon, ACK or ``$`` and contain a colon or ACK; else 0.0."""
    begins = sent.lstrip(b"#")[:1] in (b":", ACK, b"$")
    return 1.0 if begins and (b":" in sent or ACK in sent) else 0.0


def _protocol_by_ack(received: bytes, quiet_seconds: float) -> str | None:
    """Return the protocol that the answer to ACK shows, or None. A Meade sends a letter, a D if it waits for firmware.
    An OnStep takes the bytes before ACK for a command: it sends a 0, which refuses that command, before its letter.
    """
    received = received.removeprefix(b"0").strip().removesuffix(b"#")
    if len(received) != 1 or quiet_seconds < ACK_QUIET_PERIOD:
        return None
    return NAME if received in b"APLG" else "downloader" if received == b"D" else None


def _hint_text(frame: bytes) -> str:
    """Return a text that suggests the command with the missing colon or hash sign; empty if no command fits."""
    whole = b":" + frame.strip(b":#") + b"#"
    if load(NAME).find(whole) is None:
        return ""
    forgotten = "Its # is missing" if frame[:1] == b":" else "Its : is missing"
    return f"did you mean '{printable(whole)}'? {forgotten}"


SPEC = ProtocolSpec(
    name=NAME,
    title="LX200",
    program_phrase="an LX200",
    mount_phrase="a Meade",
    menu_entry="Meade LX200 GPS",
    mounts_phrase="Meade LX200",
    makers=("meade",),
    default_model=DEFAULT_MODEL,
    demo_mount=("lx200:lx200gps", "LX200GPS"),
    new_framer=lazy("lx200.framing", "Lx200Framer"),
    opening_pattern=OPENING,
    reply_rules=lazy("lx200.reply_rules", "Lx200ReplyRules"),
    make_surface=_make_surface,
    make_driver=_make_driver,
    make_simulator=_make_simulator,
    simulator_switches={
        "land_tells_altaz": "in land mode :GW# replies AN1 also on a wedge, where it otherwise replies PN1",
        "tolerant": "accepts arguments in every notation that programs send, not only the manual's",
    },
    likelihood=_lx200_confidence,
    probes=(
        Probe(2, HASH_ACK, _protocol_by_ack),
        Probe(3, POSITION, lambda heard, still: NAME if re.fullmatch(_POSITION, heard.strip()) else None, opt_in=True),
    ),
    device_states={"downloader": "a Meade that waits for new firmware: switch it off and on to use it"},
    log_commands=LogCommands(frozenset({"GR", "GD"}), frozenset({"Gt", "Gg"}), frozenset({"MS", "MA"}), lon_sign=-1),
    cable="into the port marked RS-232 on the panel, or into the Autostar's own",
    detect_warning="an old classic LX200 may not answer these questions; try: mount-gateway detect lx200@{port}",
    park_is_stored=True,
    slowest_mount="a classic LX200",
    first_answer_seconds=(4, 9),
    target_requests=(":Sr05:34:32#", ":Sd+22*00:52#", ":Sa+50*00#", ":Sz200*00#"),
    hint=_hint_text,
)
