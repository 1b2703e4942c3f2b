"""What the rest of the gateway knows of a protocol: a ``ProtocolSpec``, created in the protocol's folder.

``gateway/protocols/registry.py`` lists them. Every start imports all of them, so they hold only data and functions; a
function imports what it needs when it is called.
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
    from gateway.transport.web_server import Web


class SurfaceSettings(Struct, frozen=True):
    """What a user may configure for a surface. ``limits`` are the altitude limits, which no client can widen.

    ``equinox`` is that of the programs' coordinates, ``jnow`` or ``j2000``: they are converted, and programs may ask.
    ``degree`` is the degree character in replies that are text, ``*`` or ``0xDF``.
    """

    model: str | None
    version: str | None
    precision: str | None
    sync_text: str | None
    limits: AltitudeLimits
    equinox: str = "jnow"
    degree: str = "*"


class MadeSurface(Struct, frozen=True):
    """A surface, and the constants of the model that it presents.

    ``fit(equatorial, german, gps)`` returns the model constants that suit a mount; None if the user has named a model.
    """

    surface: Surface
    model: Model
    settings: ClientSettings
    fit: Callable[[bool, bool | None, bool], Model] | None = None


class DriverSettings(Struct, frozen=True):
    """The configuration of a mount that concerns its driver; a default of None leaves the choice to the driver. A field
    with the name of a key of ``[mount]`` has its value."""

    model: str | None = None
    version: str | None = None
    site: tuple[float, float] | None = None
    mode: str | None = None
    guide_rate: float | None = None
    park: tuple[float, float] | None = None
    aux_home: bool = False  # home is at the motors' own switches
    reversed_axes: str | None = None  # those that count the other way: none, first, second, both
    rates: tuple[float, ...] = ()  # of the nine keys, as measured, degrees a second
    lowest: float = 0.0  # the default park position is not below this altitude, degrees


class MadeDriver(NamedTuple):
    """A driver, the handlers of its scheduled operations, and the rules of requests and replies on its line."""

    driver: Driver
    follow_ups: FollowUps
    reply_rules: ReplyRules


class Question(Struct, frozen=True):
    """What ``detect`` may send to an unknown device, and how it judges the answer.

    rank    its place among the questions of all protocols: what is harmless to every mount is sent first
    judge   (bytes since then, seconds without further ones) -> the protocol's name, another state, or None
    named   only sent to a port whose protocol the user has named
    late    the answer may arrive after the next questions
    """

    rank: int
    request: bytes
    judge: Callable[[bytes, float], str | None]
    named: bool = False
    late: bool = False


class OfferedMount(Struct, frozen=True):
    """A mount that a server in the network offers: ``where`` belongs into an endpoint, ``server`` is the name that the
    server reports; ``gateway``: it is a mount-gateway. It answered in ``seconds``; its ``identifier`` is the same in
    every network.
    """

    where: str
    product: str
    server: str
    gateway: bool
    identifier: str
    seconds: float


class NightRows(Struct, frozen=True):
    """The commands that the report of a night evaluates: those whose replies contain the position (``places``) or the
    site, and those that begin a goto. ``east`` is 1 if longitudes are positive to the east, else -1."""

    places: frozenset[str] = frozenset()
    site: frozenset[str] = frozenset()
    gotos: frozenset[str] = frozenset()
    east: int = 1


def part(module: str, name: str) -> Callable[..., Any]:
    """Return a factory for a part of a protocol, whose module the first call imports: every start reads all specs."""
    return lambda *given, **settings: getattr(import_module(f"gateway.protocols.{module}"), name)(*given, **settings)


def _checked(text: str) -> str:
    """Return the text unchanged. Raises ValueError if it is not a version."""
    parse_version(text)
    return text


class ProtocolSpec(Struct, frozen=True, kw_only=True):
    """One protocol. ``name`` is the word in the configuration, and the name of its folders."""

    name: str
    #: Words for messages: the protocol, a program and a mount that speak it, and that mount in a program's menu.
    title: str
    a_program: str
    a_mount: str
    preset: str
    #: The mounts, in the message that none was found.
    mounts: str
    #: The makers of the mounts, the best known first; and the words that may precede a model's name.
    makers: tuple[str, ...] = ()
    brands: tuple[str, ...] = ()
    #: The model that is simulated, driven and presented if the user names none.
    default_model: str | None = None
    #: The TCP port that programs use for it by default.
    usual_port: int = 4030
    #: The default equinox of its programs' coordinates: ``jnow`` or ``j2000``.
    equinox: str = "jnow"
    #: What its programs' guide pulses mean if nobody says: ``motor`` or ``sky``.
    guides_by: str = "motor"
    #: Whether its mounts are aligned or not; if not, they count as aligned.
    aligns: bool = True
    #: A mount for the demonstration, as an endpoint and in words.
    demo: tuple[str, str] | None = None

    # --- its parts; None if it has no such part ---
    #: Makes the framer; what a program may begin a connection with; the rules of replies, if mounts speak the protocol:
    #: of a model whose words differ, if it is named.
    framing: Callable[[], Framer]
    opening: bytes
    reply_rules: Callable[..., ReplyRules] | None = None
    make_surface: Callable[[SurfaceSettings], MadeSurface] | None = None
    #: If its programs speak HTTP: makes the converter from HTTP to lines.
    web: Callable[[], Web] | None = None
    make_driver: Callable[[DriverSettings, Callable[[], float]], MadeDriver] | None = None
    #: If its mounts are reached over HTTP: makes the converter from lines to HTTP for an address ``http://…``.
    over_http: Callable[[str], HttpDialect] | None = None
    #: Takes model, version; then ``clock``, ``site``, ``aligned``, ``speed`` and its own settings as keywords.
    make_simulator: Callable[..., Simulated] | None = None
    #: Flags that only this simulated mount has, with their help texts; the settings used in rehearsals.
    simulator_switches: Mapping[str, str] = {}
    rehearsal_settings: Callable[[bool], dict[str, object]] = lambda wedge: {}

    # --- versions ---
    #: Version text -> the version whose command set a mount of that version has. Raises ValueError.
    counts_as: Callable[[str], Version] = parse_version
    #: Normalises a version text. Raises ValueError if it is not a version, UserError if none was ever released.
    check_version: Callable[[str], str] = _checked
    #: A row of models.toml -> the versions of that model.
    versions_of: Callable[[Model], list[str]] = lambda row: list(row.get("versions", ()))
    #: Words that may replace a model and name a version: (word, version or None) -> version.
    version_names: Mapping[str, Callable[[str | None], str]] = {}
    #: The version that is presented to programs if the user names none.
    presented_version: str | None = None

    # --- recognising it ---
    #: The probability that these bytes of a client are in this protocol, 0 to 1.
    recognises: Callable[[bytes], float] = lambda sent: 0.0
    #: The first bytes of its programs, if no other protocol has such a command: other surfaces refuse the connection.
    greeting: bytes = b""
    #: Whether its programs wait for the mount to speak first: on a port for all protocols a silent client is one of
    #: them; and commands that programs of other protocols send first too: there they are answered and decide nothing.
    mount_speaks_first: bool = False
    shared_openings: bytes | None = None
    questions: tuple[Question, ...] = ()
    #: Other states that an answer to a question may show, with their descriptions.
    states: Mapping[str, str] = {}
    #: Returns the mounts that servers offer: those at these addresses, or all that answer in the network.
    find_mounts: Callable[[Sequence[str] | None], Awaitable[list[OfferedMount]]] | None = None
    night: NightRows = NightRows()
    #: Where to plug in the cable; which mount may not hear the questions that are sent to every port (at ``{port}``).
    cable: str = ""
    detect_warning: str = ""
    #: Host or port at which a device of this maker usually listens that cannot be used -> what it is, and what to do.
    unsupported_at: Mapping[str, str] = {}
    #: The source for the statement that mounts of a version use J2000.
    j2000_by: str = "its maker"
    #: What the user should know of a mount of an unknown model, given its version.
    unknown_model: Callable[[str], str] = lambda version: ""

    # --- words and examples ---
    #: Whether the mount can only park at a position of its own.
    parks_itself: bool = False
    #: The slowest mount, and how many seconds its first answer may take: with its model configured, and without.
    slowest: str = "a mount"
    first_answer_seconds: tuple[int, int] = (4, 4)
    #: Requests that give a client a target.
    target: tuple[str, ...] = ()
    #: Requests that a client must send before it is answered anything.
    required_requests: tuple[str, ...] = ()
    #: Explains what may be wrong with an unknown command; without it a similar command is suggested.
    hint: Callable[[bytes], str] | None = None

    @property
    def commands(self) -> CommandSet:
        """The command set of this protocol. Raises MappingError."""
        return load(self.name)

    def shown(self, model: str | None, version: str | None) -> str:
        """Return ``PROTOCOL[:MODEL[/VERSION]]``, as an endpoint is written."""
        if model is None and version is not None and version.partition("-")[0] in self.version_names:
            return f"{self.name}:{version.replace('-', '/')}"
        return f"{self.name}{f':{model}' if model else ''}{f'/{version}' if version else ''}"
