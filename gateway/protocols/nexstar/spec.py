"""The registry entry of Celestron's NexStar protocol: its names, constants, and factory functions.

The factories import the modules they need when they are called, so that listing the protocols stays fast.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from gateway.core.errors import UserError
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
from gateway.protocols.nexstar import versions
from gateway.protocols.nexstar.versions import STARSENSE, is_starsense, parse
from gateway.protocols.wireformat.command_set import functions_of, load, surface_functions
from gateway.protocols.wireformat.rows import format_version, parse_version

if TYPE_CHECKING:
    from gateway.protocols.nexstar.simulator.hand_control import SimulatedHandControl

NAME, DEFAULT_MODEL = "nexstar", "6-8se"
#: Versions are at least ``OLDEST`` and below ``TOO_NEW``; those of a GT begin at ``GT``; a StarSense has its own.
OLDEST, TOO_NEW, GT = (1, 2), (6, 0), 100
#: An echo request; it is no command of a Meade.
ECHO = b"Kx"
#: Echo requests with any byte: Stellarium Mobile begins with them, whichever protocol it uses afterwards.
ANY_ECHO = rb"(?s)(?:K.)+"
#: Confidence (0 to 1) that bytes are NexStar: low, because nearly every byte can be a command of it.
NEXSTAR_CONFIDENCE = 0.1
#: How a client of a hand control may begin a connection: ignored bytes and well-formed commands of any version.
#: Well formed means an existing tracking mode, hex digits and a comma, a possible time of day. Anything else, such as
#: the first two bytes of TRACE, is not from such a client.
OPENING = rb"""(?sx)
    (?:
        [\#\r\n\0\ ?] | [EeZzVvJLMmtwhiplxyu] | K. | T[\0-\3]
      | [RBS] [0-9A-Fa-f]{4},[0-9A-Fa-f]{4} | [rbs] [0-9A-Fa-f]{8},[0-9A-Fa-f]{8}
      | P [\1-\10] .{6}
      | W [\0-\x5a][\0-\x3b][\0-\x3b][\0-\1] [\0-\xb4][\0-\x3b][\0-\x3b][\0-\1]
      | [HI] [\0-\x17][\0-\x3b][\0-\x3b] [\1-\x0c][\1-\x1f]. .[\0-\1]
    )*
    """


def _make_surface(settings: SurfaceSettings) -> MadeSurface:
    from gateway.protocols.base.session import ClientSettings
    from gateway.protocols.base.surface import Surface
    from gateway.protocols.nexstar.session import NexStarSession
    from gateway.protocols.nexstar.surface import devices, motion, place, pointing, presented

    protocol, version = load(NAME), settings.version
    handlers = surface_functions(devices, motion, place, pointing, presented)
    surface = Surface(protocol, handlers, devices.no_response)
    surface.may_pass_on, surface.lacking_reason = devices.may_be_passed_on, presented.missing_command_text
    surface.contradicts_client = presented.contradicts_client
    surface.session_type = NexStarSession
    fit = presented.make_chooser(settings.model, version)
    return MadeSurface(surface, presented.build_model(settings.model, version), ClientSettings(settings.limits), fit)


def _make_driver(settings: DriverSettings, now: Callable[[], float]) -> MadeDriver:
    from gateway.protocols.nexstar.driver import home, identify, motion, place, pointing, tracking
    from gateway.protocols.nexstar.driver.state import NexStar
    from gateway.protocols.nexstar.reply_rules import NexStarReplyRules

    handlers = functions_of(home, identify, motion, place, pointing, tracking)
    return MadeDriver(
        NexStar(now, settings, handlers),
        {
            pointing.AfterGoto: pointing.finish_goto,
            home.TrackAfterWake: home.track_after_wake,
            tracking.VerifyTracking: tracking.verify_tracking,
            motion.NextSmallGoto: motion.send_small_goto,
        },
        NexStarReplyRules(),
    )


def _make_simulator(model: str | None, version: str | None, **settings: object) -> SimulatedHandControl:
    from gateway.protocols.nexstar.simulator.hand_control import SimulatedHandControl

    return SimulatedHandControl(model or DEFAULT_MODEL, version, **settings)


def _normalise_version(text: str) -> str:
    """Return the version in its usual spelling. Raises UserError if none was ever released, ValueError if invalid."""
    oldest, newest = format_version(versions.STARSENSE_OLDEST), format_version(versions.STARSENSE_NEWEST)
    if is_starsense(text):
        try:
            return parse(text).text
        except ValueError:
            raise UserError(
                f"{text!r}: a StarSense has versions from {oldest} on; write it like {STARSENSE}-{newest}"
            ) from None
    version = parse_version(text)
    if not (OLDEST <= version < TOO_NEW or version[0] >= GT):
        raise UserError(
            f"{text!r}: hand controls have versions from 1.2 to 5.x, a GT from 100.0 on, a StarSense "
            f"from {STARSENSE}-{oldest} on"
        )
    return text


def _unknown_model_hint(version: str) -> str:
    if parse_version(version) < (2, 2):
        return "if it is a NexStar GPS, write nexstar:nexstar-gps@ instead of nexstar@"
    return "an unknown model is driven as an alt-az fork"


AUX_UNSUPPORTED = (
    "port 2000 and the address 1.2.3.4 are those of Celestron's Wi-Fi adapters, which speak Celestron's AUX protocol: "
    "that is not supported; use the cable in the base of the hand control"
)

SPEC = ProtocolSpec(
    name=NAME,
    title="NexStar",
    program_phrase="a NexStar",
    mount_phrase="a NexStar",
    menu_entry="Celestron NexStar",
    mounts_phrase="NexStar",
    makers=("celestron", "orion", "skywatcher"),
    brands=("nexstar",),
    default_model=DEFAULT_MODEL,
    demo_mount=("nexstar", "NexStar 6/8 SE"),
    new_framer=lazy("nexstar.framing", "NexStarFramer"),
    opening_pattern=OPENING,
    reply_rules=lazy("nexstar.reply_rules", "NexStarReplyRules"),
    make_surface=_make_surface,
    make_driver=_make_driver,
    make_simulator=_make_simulator,
    rehearsal_settings=lambda wedge: {"focuser": True, "wedge": wedge},
    command_set_version=lambda text: parse(text).counts_as,
    normalise_version=_normalise_version,
    versions_of=versions.versions_of,
    version_aliases={STARSENSE: lambda version: STARSENSE if version is None else f"{STARSENSE}-{version}"},
    presented_version="4.21",
    likelihood=lambda sent: NEXSTAR_CONFIDENCE,
    shared_pattern=ANY_ECHO,
    probes=(Probe(1, ECHO, lambda heard, still: NAME if heard.endswith(ECHO[1:] + b"#") else None, slow=True),),
    log_commands=LogCommands(frozenset({"E", "e"}), frozenset({"w"}), frozenset({"R", "r", "B", "b"})),
    cable="plug the cable into the base of the hand control, not into the port marked PC on the mount",
    unsupported_devices=dict.fromkeys(("2000", "1.2.3.4"), AUX_UNSUPPORTED),
    j2000_source="Celestron's own driver",
    unknown_model_note=_unknown_model_hint,
    slowest_mount="a hand control",
)
