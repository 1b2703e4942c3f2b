"""The registry entry of Celestron's NexStar protocol: its names, constants, and factory functions.

The factories import the modules they need when they are called, so that listing the protocols stays fast.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from gateway.core.errors import UserError
from gateway.protocols.base.spec import (
    DriverSettings,
    MadeDriver,
    MadeSurface,
    NightRows,
    ProtocolSpec,
    Question,
    SurfaceSettings,
    part,
)
from gateway.protocols.nexstar import versions
from gateway.protocols.nexstar.versions import STARSENSE, is_starsense, numbered
from gateway.protocols.wireformat.command_set import functions, load, surface_functions
from gateway.protocols.wireformat.rows import parse_version, show_version

if TYPE_CHECKING:
    from gateway.protocols.nexstar.simulator.hand_control import SimulatedHandControl

NAME, DEFAULT_MODEL = "nexstar", "6-8se"
#: Versions are at least ``OLDEST`` and below ``NEWEST``; those of a GT begin at ``GT``; a StarSense has its own.
OLDEST, NEWEST, GT = (1, 2), (6, 0), 100
#: An echo request; it is no command of a Meade.
ECHO = b"Kx"
#: Echo requests with any byte: Stellarium Mobile begins with them, whichever protocol it uses afterwards.
ANY_ECHO = rb"(?s)(?:K.)+"
#: Confidence (0 to 1) that bytes are NexStar: low, because nearly every byte can be a command of it.
UNMARKED = 0.1
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
    surface.passes, surface.lacks = devices.passes, presented.lacks
    surface.contradicts_client = presented.contradicts_client
    surface.session = NexStarSession
    fit = presented.fitter(settings.model, version)
    return MadeSurface(surface, presented.presented(settings.model, version), ClientSettings(settings.limits), fit)


def _make_driver(settings: DriverSettings, now: Callable[[], float]) -> MadeDriver:
    from gateway.protocols.nexstar.driver import home, identify, motion, place, pointing, tracking
    from gateway.protocols.nexstar.driver.state import NexStar
    from gateway.protocols.nexstar.reply_rules import NexStarReplyRules

    handlers = functions(home, identify, motion, place, pointing, tracking)
    return MadeDriver(
        NexStar(now, settings, handlers),
        {
            pointing.Arrived: pointing.arrived,
            home.Awake: home.awake,
            tracking.VerifyTracking: tracking.verify,
            motion.StepOn: motion.step_on,
        },
        NexStarReplyRules(),
    )


def _make_simulator(model: str | None, version: str | None, **settings: object) -> SimulatedHandControl:
    from gateway.protocols.nexstar.simulator.hand_control import SimulatedHandControl

    return SimulatedHandControl(model or DEFAULT_MODEL, version, **settings)


def _check_version(text: str) -> str:
    """Return the version in its usual spelling. Raises UserError for a version that never existed."""
    oldest, newest = show_version(versions.STARSENSE_OLDEST), show_version(versions.STARSENSE_NEWEST)
    if is_starsense(text):
        try:
            return numbered(text).written
        except ValueError:
            raise UserError(
                f"{text!r}: a StarSense has versions from {oldest} on; write it like {STARSENSE}-{newest}"
            ) from None
    version = parse_version(text)
    if not (OLDEST <= version < NEWEST or version[0] >= GT):
        raise UserError(
            f"{text!r}: hand controls have versions from 1.2 to 5.x, a GT from 100.0 on, a StarSense "
            f"from {STARSENSE}-{oldest} on"
        )
    return text


def _unknown_model(version: str) -> str:
    if parse_version(version) < (2, 2):
        return "if it is a NexStar GPS, write nexstar:nexstar-gps@ instead of nexstar@"
    return "an unknown model is driven as an alt-az fork"


AUX = (
    "port 2000 and the address 1.2.3.4 are those of Celestron's Wi-Fi adapters, which speak Celestron's AUX protocol: "
    "that is not supported; use the cable in the base of the hand control"
)

SPEC = ProtocolSpec(
    name=NAME,
    title="NexStar",
    a_program="a NexStar",
    a_mount="a NexStar",
    preset="Celestron NexStar",
    mounts="NexStar",
    makers=("celestron", "orion", "skywatcher"),
    brands=("nexstar",),
    default_model=DEFAULT_MODEL,
    demo=("nexstar", "NexStar 6/8 SE"),
    framing=part("nexstar.framing", "NexStarFramer"),
    opening=OPENING,
    reply_rules=part("nexstar.reply_rules", "NexStarReplyRules"),
    make_surface=_make_surface,
    make_driver=_make_driver,
    make_simulator=_make_simulator,
    rehearsal_settings=lambda wedge: {"focuser": True, "wedge": wedge},
    counts_as=lambda text: numbered(text).counts_as,
    check_version=_check_version,
    versions_of=versions.made_with,
    version_names={STARSENSE: lambda version: STARSENSE if version is None else f"{STARSENSE}-{version}"},
    presented_version="4.21",
    recognises=lambda sent: UNMARKED,
    shared_openings=ANY_ECHO,
    questions=(Question(1, ECHO, lambda heard, still: NAME if heard.endswith(ECHO[1:] + b"#") else None, late=True),),
    night=NightRows(frozenset({"E", "e"}), frozenset({"w"}), frozenset({"R", "r", "B", "b"})),
    cable="plug the cable into the base of the hand control, not into the port marked PC on the mount",
    unsupported_at=dict.fromkeys(("2000", "1.2.3.4"), AUX),
    j2000_by="Celestron's own driver",
    unknown_model=_unknown_model,
    slowest="a hand control",
)
