"""``ProtocolSpec``: all that the rest of the gateway uses of a protocol. The protocol's folder creates it.

``gateway/protocols/registry.py`` lists the specs. Every start of the gateway imports all of them, so they hold only
data and functions. A function imports the modules that it needs when it is called.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec import Struct

from gateway.protocols.wireformat.command_set import CommandSet, load
from gateway.protocols.wireformat.rows import Model, Version, parse_version

if TYPE_CHECKING:
    from gateway.protocols.base.driver import Driver, FollowUps
    from gateway.protocols.base.frames import Framer
    from gateway.protocols.base.reply_rules import ReplyRules
    from gateway.protocols.base.session import AltitudeLimits, ClientSettings
    from gateway.protocols.base.surface import Surface
    from gateway.protocols.mechanics.simulated import Simulated
    from gateway.transport.http_wire import HttpDialect
    from gateway.transport.web_server import WebProtocol


class SurfaceSettings(Struct, frozen=True):
    """What a user may configure for a surface. ``limits`` are the altitude limits, which no client can widen.

    ``equinox`` is that of the programs' coordinates, ``jnow`` or ``j2000``. ``degree`` is the degree character in text
    replies, ``*`` or ``0xDF``. None: not configured.
    """

    model: str | None
    version: str | None
    precision: str | None
    sync_text: str | None
    limits: AltitudeLimits
    equinox: str = "jnow"
    degree: str = "*"


class MadeSurface(Struct, frozen=True):
    """A surface, the constants of the model that it presents, and the settings with which its clients begin.

    ``fit_model(equatorial, german, gps)`` returns the model constants that suit the mount. It is None if the user has
    configured a model.
    """

    surface: Surface
    model: Model
    client_settings: ClientSettings
    fit_model: Callable[[bool, bool | None, bool], Model] | None = None


class DriverSettings(Struct, frozen=True):
    """The configuration of a mount for its driver. Fields have the names of keys of ``[mount]`` in the configuration
    file; None leaves the choice to the driver.
    """

    model: str | None = None
    version: str | None = None
    site: tuple[float, float] | None = None
    mode: str | None = None
    guide_rate: float | None = None
    park: tuple[float, float] | None = None
    aux_home: bool = False  # the home position is at the switches of the motors
    reversed_axes: str | None = None  # the axes that count the other way: none, first, second, both
    rates: tuple[float, ...] = ()  # the measured speeds of the nine rate keys, degrees a second
    lowest: float = 0.0  # the lowest altitude allowed, degrees; the default park position is not below it


class MadeDriver(NamedTuple):
    """A driver, the handlers of its scheduled operations, and the rules of requests and replies on its line."""

    driver: Driver
    scheduled_ops: FollowUps
    reply_rules: ReplyRules


class Probe(Struct, frozen=True):
    """A request that ``detect`` may send to an unknown device, and how it judges the answer."""

    #: Requests of all protocols are sent in the order of their ranks, those that are harmless to every mount first.
    rank: int
    request: bytes
    #: (bytes received since the request, seconds without further bytes) -> the protocol, another state, or None.
    judge: Callable[[bytes, float], str | None]
    opt_in: bool = False  # it is only sent to a port whose protocol the user has named
    slow: bool = False  # the answer may arrive after the next requests


class OfferedMount(Struct, frozen=True):
    """A mount that a server in the network offers."""

    url: str  # its URL, as an endpoint has it after the @
    product: str
    server_name: str  # the name that the server reports
    is_gateway: bool  # the server is a mount-gateway
    unique_id: str  # the same in every network
    seconds: float  # how long the server took to answer


class LogCommands(Struct, frozen=True):
    """The commands that ``report`` evaluates in the log of a night."""

    position_commands: frozenset[str] = frozenset()  # commands whose replies contain the position
    site_commands: frozenset[str] = frozenset()  # commands whose replies contain the site
    goto_commands: frozenset[str] = frozenset()  # commands that begin a goto
    lon_sign: int = 1  # 1 if longitudes are positive to the east, else -1


def lazy(module: str, name: str) -> Callable[..., Any]:
    """Return a function that calls ``name`` of a module and imports it only then, so that the gateway starts fast."""
    return lambda *given, **settings: getattr(import_module(f"gateway.protocols.{module}"), name)(*given, **settings)


def _checked_version(text: str) -> str:
    """Return the text unchanged. Raises ValueError if it is not a version."""
    parse_version(text)
    return text


class ProtocolSpec(Struct, frozen=True, kw_only=True):
    """One protocol. ``name`` is its name in the configuration, and that of its folders."""

    name: str
    title: str  # the protocol, in messages
    program_phrase: str  # a program that speaks it, in messages, with its article
    mount_phrase: str  # a mount that speaks it, in messages, with its article
    menu_entry: str  # such a mount in the menus of programs
    mounts_phrase: str  # such mounts, in the message that none was found
    #: The makers of the mounts, the best known first; and the words that may precede a model's name.
    makers: tuple[str, ...] = ()
    brands: tuple[str, ...] = ()
    #: The model that is simulated, driven and presented if the user names none.
    default_model: str | None = None
    #: The TCP port that programs use for it by default.
    usual_port: int = 4030
    #: The default equinox of its programs' coordinates: ``jnow`` or ``j2000``.
    equinox: str = "jnow"
    #: The default meaning of directions in its programs' guide pulses: those of the ``motor`` or on the ``sky``.
    guides_by: str = "motor"
    #: Whether its mounts report whether they are aligned; if not, they count as aligned.
    has_alignment: bool = True
    #: A simulated mount for ``demo``: its endpoint and its description.
    demo_mount: tuple[str, str] | None = None

    # --- its parts; None if it has no such part ---
    #: Makes the framer of a connection.
    new_framer: Callable[[], Framer]
    #: Regular expression for the bytes with which a program may begin a connection.
    opening_pattern: bytes
    #: Makes the rules of requests and replies, if mounts speak the protocol; takes the model if it is known.
    reply_rules: Callable[..., ReplyRules] | None = None
    make_surface: Callable[[SurfaceSettings], MadeSurface] | None = None
    #: If its programs speak HTTP: makes the converter from HTTP to lines.
    web: Callable[[], WebProtocol] | None = None
    make_driver: Callable[[DriverSettings, Callable[[], float]], MadeDriver] | None = None
    #: If its mounts are reached over HTTP: makes the converter from lines to HTTP for an address ``http://…``.
    make_http_dialect: Callable[[str], HttpDialect] | None = None
    #: Takes model, version; then ``clock``, ``site``, ``aligned``, ``speed`` and its own settings as keywords.
    make_simulator: Callable[..., Simulated] | None = None
    #: Flags of ``sim`` that only this simulated mount has -> their help texts.
    simulator_switches: Mapping[str, str] = {}
    #: Whether the mount is on a wedge -> the settings of the simulated mount in rehearsals.
    rehearsal_settings: Callable[[bool], dict[str, object]] = lambda wedge: {}

    # --- versions ---
    #: Version text -> the version of the manual whose commands such a mount has. Raises ValueError.
    command_set_version: Callable[[str], Version] = parse_version
    #: Normalises a version text. Raises ValueError if it is not a version, UserError if none was ever released.
    normalise_version: Callable[[str], str] = _checked_version
    #: A row of models.toml -> the versions of that model.
    versions_of: Callable[[Model], list[str]] = lambda row: list(row.get("versions", ()))
    #: A name that may stand for the model -> function from the version after it (None if there is none) to the version.
    version_aliases: Mapping[str, Callable[[str | None], str]] = {}
    #: The version that is presented to programs if the user names none.
    presented_version: str | None = None

    # --- recognising it ---
    #: The probability that these bytes of a client are in this protocol, 0 to 1.
    likelihood: Callable[[bytes], float] = lambda sent: 0.0
    #: The bytes with which its programs begin, if no other protocol has such a command: other surfaces refuse them.
    greeting: bytes = b""
    #: Whether its programs wait for data first: on a port for all protocols a silent client speaks this protocol.
    mount_speaks_first: bool = False
    #: Regular expression for first commands that programs of other protocols send too: on a port for all protocols they
    #: are answered, and the protocol stays undecided.
    shared_pattern: bytes | None = None
    probes: tuple[Probe, ...] = ()
    #: State of a device that speaks no protocol, as ``Probe.judge`` returns it -> its description for ``detect``.
    device_states: Mapping[str, str] = {}
    #: Returns the mounts that servers offer: those at these addresses, or all that answer in the network.
    find_mounts: Callable[[Sequence[str] | None], Awaitable[list[OfferedMount]]] | None = None
    log_commands: LogCommands = LogCommands()
    cable: str = ""  # where to plug in the cable, in words
    #: A warning of ``detect`` about mounts that may not answer its questions; ``{port}`` stands for the port.
    detect_warning: str = ""
    #: Default host or port of a device of this maker that the gateway does not support -> its kind, and what to do.
    unsupported_devices: Mapping[str, str] = {}
    #: The source, in messages, of the statement that mounts of some versions use J2000.
    j2000_source: str = "its maker"
    #: What the user should know of a mount of an unknown model, given its version.
    unknown_model_note: Callable[[str], str] = lambda version: ""

    # --- words and examples ---
    #: Whether the mount can only park at a position that is stored in the mount.
    park_is_stored: bool = False
    #: The slowest mount, and how many seconds its first answer may take: with its model configured, and without.
    slowest_mount: str = "a mount"
    first_answer_seconds: tuple[int, int] = (4, 4)
    #: Example requests with which a client sets a target.
    target_requests: tuple[str, ...] = ()
    #: Requests that a client must send before it is answered anything.
    required_requests: tuple[str, ...] = ()
    #: Unknown command -> what may be wrong with it; None: the gateway suggests a similar command.
    hint: Callable[[bytes], str] | None = None

    @property
    def commands(self) -> CommandSet:
        """The command set of this protocol. Raises MappingError."""
        return load(self.name)

    def endpoint_text(self, model: str | None, version: str | None) -> str:
        """Return ``PROTOCOL[:MODEL[/VERSION]]``, the first part of an endpoint."""
        if model is None and version is not None and version.partition("-")[0] in self.version_aliases:
            return f"{self.name}:{version.replace('-', '/')}"
        return f"{self.name}{f':{model}' if model else ''}{f'/{version}' if version else ''}"
