"""What the rest of the gateway knows of a protocol: one value, made by the protocol's own folder.

The list of them is ``gateway/protocols/registry.py``. A specification is read at every start, so it holds data and
functions only: whatever a function needs is imported when it is called.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

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
    from gateway.transport.web_port import Web


class SurfaceSettings(Struct, frozen=True):
    """What a user may set for a surface. ``limits`` are the altitudes that no client widens.

    ``equinox`` is what its programs count in, ``jnow`` or ``j2000``: they are converted, and may ask which it is.
    """

    model: str | None
    version: str | None
    precision: str | None
    sync_text: str | None
    limits: AltitudeLimits
    equinox: str = "jnow"


class MadeSurface(Struct, frozen=True):
    """A surface, and the constants of the model that it presents.

    ``fit`` gives the model for a mount that is equatorial or not, German or not, with a GPS receiver or without; it is
    None where the user has named a model.
    """

    surface: Surface
    model: Model
    settings: ClientSettings
    fit: Callable[[bool, bool | None, bool], Model] | None = None


class DriverSettings(Struct, frozen=True):
    """What a user may set for a mount, as far as its driver goes by it; the defaults leave it to the driver."""

    model: str | None = None
    version: str | None = None
    site: tuple[float, float] | None = None
    mode: str | None = None
    guide_rate: float | None = None
    guide_directions: str = "motor"  # what a pulse's direction means: the motor's, or the sky's
    park: tuple[float, float] | None = None
    aux_home: bool = False  # home is where the motors' own switches are
    lowest: float = 0.0  # where nobody has chosen a park position it is not below that


class MadeDriver(NamedTuple):
    """A driver, what it does later by itself, and how its line exchanges commands."""

    driver: Driver
    follow_ups: FollowUps
    reply_rules: ReplyRules


class Question(Struct, frozen=True):
    """What ``detect`` may send to an unknown device, and what an answer to it says.

    ``rank`` is its place among the questions of all protocols: what does no harm to any mount comes first. One that is
    only for a port whose protocol the user has ``named`` is not asked otherwise. ``judge`` is given the bytes that have
    come since, and for how many seconds nothing more has: it returns the protocol's name, another state, or None. The
    answer to one may come ``late``, behind the next questions.
    """

    rank: int
    request: bytes
    judge: Callable[[bytes, float], str | None]
    named: bool = False
    late: bool = False


class NightRows(Struct, frozen=True):
    """Commands that the report of a night looks at: those whose replies tell where the tube points, and the site, and
    those that send it somewhere. ``east`` is 1 where longitudes count east, else -1."""

    places: frozenset[str] = frozenset()
    site: frozenset[str] = frozenset()
    gotos: frozenset[str] = frozenset()
    east: int = 1


def _written(text: str) -> str:
    """The same. Raises ValueError for what is no version."""
    parse_version(text)
    return text


class ProtocolSpec(Struct, frozen=True, kw_only=True):
    """One protocol. ``name`` is what users write, and what its folders are called."""

    name: str
    #: The protocol, a program that speaks it, a mount that does, and that mount in a program's menu: for messages.
    title: str
    a_program: str
    a_mount: str
    preset: str
    #: What the mounts are called where one was not found.
    mounts: str
    #: Who builds the mounts, first the best known; and the words that may stand before a model's name.
    makers: tuple[str, ...] = ()
    brands: tuple[str, ...] = ()
    #: What is simulated, driven and presented where nobody names a model.
    default_model: str | None = None
    #: The TCP port that programs have in mind for it.
    usual_port: int = 4030
    #: What its programs' coordinates are counted in where nobody says otherwise: ``jnow`` or ``j2000``.
    equinox: str = "jnow"
    #: A mount for the demonstration, as an endpoint names it, and in words; a model for help texts.
    demo: tuple[str, str] | None = None
    example: str = ""

    # --- what it is made of; None where there is no such thing ---
    #: How commands are cut out of bytes, by a clock; what a program may begin a connection with; how replies are taken
    #: apart, where a mount is spoken to in this protocol.
    framing: Callable[[], Framer]
    opening: re.Pattern[bytes]
    reply_rules: Callable[[], ReplyRules] | None = None
    make_surface: Callable[[SurfaceSettings], MadeSurface] | None = None
    #: Where its programs speak HTTP: what turns that into lines.
    web: Callable[[], Web] | None = None
    make_driver: Callable[[DriverSettings, Callable[[], float]], MadeDriver] | None = None
    #: Model, version; then ``clock``, ``site``, ``aligned``, ``speed`` and its own settings by name.
    make_simulator: Callable[..., Simulated] | None = None
    #: Switches of the simulated mount that no other has, with their help texts; what rehearsals switch on.
    simulator_switches: Mapping[str, str] = {}
    rehearsed_with: Callable[[bool], dict[str, object]] = lambda wedge: {}

    # --- versions ---
    #: The version whose commands a mount of a version has. Raises ValueError.
    counts_as: Callable[[str], Version] = parse_version
    #: A version as it is written. Raises ValueError for what is none, UserError for one that there never was.
    check_version: Callable[[str], str] = _written
    #: The versions of a row of models.toml.
    made_with: Callable[[Model], list[str]] = lambda row: list(row.get("versions", ()))
    #: Words in the place of a model that name a version: (word, version or None) -> version.
    version_words: Mapping[str, Callable[[str | None], str]] = {}
    #: The version that programs are told where nobody names one.
    presented_version: str | None = None

    # --- recognising it ---
    #: How surely these bytes of a client are in this protocol, 0 to 1.
    recognises: Callable[[bytes], float] = lambda sent: 0.0
    #: What its programs begin with, where that is no command of any other protocol: there they are turned away.
    greeting: bytes = b""
    #: Whether its programs wait for the first word: where every protocol is spoken, one that says nothing is one of
    #: them; and commands that programs of other protocols begin with as well: answered there, they decide nothing.
    waits: bool = False
    also_others: re.Pattern[bytes] | None = None
    questions: tuple[Question, ...] = ()
    #: Other states that an answer may tell, in words.
    states: Mapping[str, str] = {}
    #: What ``detect`` says that a mount does (coordinates, tracking, sync, arrows, site, clock): command -> words, of
    #: which the first counts whose command this mount has.
    capabilities: Mapping[str, Mapping[str, str]] = {}
    night: NightRows = NightRows()
    #: Where the cable belongs; which mount may hear none of the questions that are asked of any port, at ``{port}``.
    cable: str = ""
    deaf: str = ""
    #: Who says that mounts of a version count in J2000.
    j2000_by: str = "its maker"
    #: What a person should know of a mount whose model is not known, given its version.
    unknown_model: Callable[[str], str] = lambda version: ""

    # --- words and examples ---
    #: Whether the mount has a park position of its own, and no other.
    parks_itself: bool = False
    #: The slowest mount, and how many seconds its first answer may take: with its model named, and without.
    slowest: str = "a mount"
    takes: tuple[int, int] = (4, 4)
    #: Requests that give a client a target, and what may be wrong with one that is not known; without it a command that
    #: begins alike is shown.
    target: tuple[str, ...] = ()
    #: Requests without which no client is answered anything.
    hello: tuple[str, ...] = ()
    hint: Callable[[bytes], str] | None = None
    #: What the tables say above the models that it presents.
    presented_remark: str = ""

    @property
    def commands(self) -> CommandSet:
        """Its tables. Raises MappingError."""
        return load(self.name)

    def shown(self, model: str | None, version: str | None) -> str:
        """``PROTOCOL[:MODEL[/VERSION]]``."""
        if model is None and version is not None and version.partition("-")[0] in self.version_words:
            return f"{self.name}:{version.replace('-', '/')}"
        return f"{self.name}{f':{model}' if model else ''}{f'/{version}' if version else ''}"
