"""Every key of ``gateway.toml``, declared once: its type, range, default, and the words that describe it.

A new key is one field here. ``_key`` takes the words of ``--help`` and of the documentation, what the value is called
there, an example for keys that have no default, and the limits that msgspec checks; those of a key that may be absent
belong to the type within it, as for ``site``. The ``title`` of a limit is what a message calls it. Every key of
``[mount]`` is also a flag of ``run``, except those with ``flag=False``, and so is every key that only a surface has; a
flag writes a list with commas.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

from gateway.mount.safety.limits import Limits

#: What is written where something is not wanted at all.
OFF = "off"


def _key(words: str, shown: str = "", example: Any = None, *, flag: bool = True, **limits: Any) -> Meta:
    return Meta(description=words, extra={"shown": shown, "example": example, "flag": flag}, **limits)


_Latitude = Annotated[float, Meta(ge=-90.0, le=90.0)]
_Longitude = Annotated[float, Meta(ge=-180.0, le=360.0)]
_Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9_.-]+$", title="a word of letters, digits and _ . -")]
_Plain = Annotated[str, Meta(pattern=r"^[ -\"$-~]+$", title="plain text without #")]


class MountConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """``[mount]``, or one ``[[mount]]`` of several."""

    at: Annotated[
        str,
        _key(
            "the mount: PROTOCOL[:MODEL[/VERSION]]@PORT; any pyserial URL will do, or sim",
            "ENDPOINT",
            "nexstar@/dev/ttyUSB0",
            flag=False,
        ),
    ]
    name: Annotated[
        _Name | None, _key("what the mount is called, where there are several", "NAME", "pier", flag=False)
    ] = None
    baud: Annotated[int, _key("baud rate of the mount's port", "BAUD", ge=300, le=921600)] = 9600
    site: Annotated[
        tuple[_Latitude, _Longitude] | None,
        _key(
            "where the mount stands, degrees, north and east positive, for hand controls that cannot tell",
            "LAT,LON",
            [48.1, 11.6],
        ),
    ] = None
    mode: Annotated[
        Literal["alt-az", "eq-north", "eq-south"] | None,
        _key("tracking mode, for hand controls that cannot tell (before 2.3)", example="alt-az"),
    ] = None
    equinox: Annotated[
        Literal["jnow", "j2000", "auto"], _key("what the mount's coordinates mean; auto goes by its version")
    ] = "jnow"
    site_time: Annotated[
        Literal["unaligned", "always", "never"],
        _key(
            "send the mount the site and time that clients set? unaligned: a NexStar while it is not aligned, a Meade "
            "always"
        ),
    ] = "unaligned"
    lowest: Annotated[float, _key("lowest altitude of gotos and of hand motion, degrees", "DEG", ge=-90.0, le=90.0)] = (
        0.0
    )
    highest: Annotated[
        float, _key("highest altitude of gotos and of hand motion, degrees", "DEG", ge=-90.0, le=90.0)
    ] = 90.0
    sync_limit: Annotated[float, _key("refuse syncs further than this, degrees", "DEG", gt=0.0, le=180.0)] = 15.0
    guide_rate: Annotated[
        Annotated[float, Meta(gt=0.0, le=1.0)] | None,
        _key(
            "speed of guiding, as a part of sidereal (default: 0.5 on a NexStar, else the telescope's own)", "RATE", 0.5
        ),
    ] = None
    guide_directions: Annotated[
        Literal["motor", "sky"],
        _key(
            "what guide pulses (:Mgn#) to a NexStar mean: the same turn of a motor, or the sky, "
            "on both sides of the pier"
        ),
    ] = "motor"
    park: Annotated[
        tuple[Annotated[float, Meta(ge=-360.0, le=360.0)], Annotated[float, Meta(ge=-180.0, le=180.0)]]
        | Literal["mount"]
        | None,
        _key(
            "axis readings that a NexStar parks at, degrees (default: the pole on an equatorial mount, else north at "
            "the horizon or half a degree above lowest); mount: a Meade may park at its own place, whatever lowest and "
            "highest "
            "say",
            "AZ,ALT",
            [0.0, 0.0],
        ),
    ] = None
    unaligned: Annotated[
        Literal["refuse", "allow"],
        _key(
            "may a NexStar that is not aligned be sent to axis readings, parked and homed? Its axes point anywhere then"
        ),
    ] = "refuse"
    aux_home: Annotated[bool, _key("home is where the motors' own home switches are, on mounts that have some")] = False
    hibernate: Annotated[
        bool,
        _key(
            "let programs that come over a network (tcp, rfc2217) put the mount to sleep; "
            "on virtual and real serial ports they always may"
        ),
    ] = False
    sun: Annotated[
        float, _key("come no nearer to the Sun while it is up, degrees; 0 for solar work", "DEG", ge=0.0, le=90.0)
    ] = 20.0
    hour_angle_limit: Annotated[
        Annotated[float, Meta(gt=0.0, le=12.0)] | None,
        _key("equatorial mounts: no farther past the meridian, hours (default: no limit)", "HOURS", 1.5),
    ] = None
    dead_man: Annotated[
        float,
        _key("a program that is silent this long loses the arrows it holds down, seconds", "S", gt=0.0, le=3600.0),
    ] = 30.0
    dead_man_closed: Annotated[
        float,
        _key(
            "the same, when its connection is closed and its computer has opened no other since", "S", gt=0.0, le=3600.0
        ),
    ] = 5.0
    state: Annotated[
        str | None,
        _key("directory for what is kept (default: where your system has it)", "PATH", "/var/lib/mount-gateway"),
    ] = None
    record: Annotated[
        str | None, _key("write everything that passes to a file that replay plays again", "FILE", "/var/tmp/night.rec")
    ] = None
    record_keep: Annotated[
        int, _key("how many files of 10 MB a recording has at most; the oldest is deleted", "N", ge=1, le=10000)
    ] = 20
    latency: Annotated[float, _key("seconds that a simulated mount takes to answer", "S", ge=0.0, le=3.0)] = 0.0
    speed: Annotated[
        float, _key("a simulated mount slews this many times faster than real", "TIMES", gt=0.0, le=1000.0)
    ] = 1.0

    @property
    def limits(self) -> Limits:
        """The limits that the mount is held to, in degrees."""
        return Limits(
            self.lowest,
            self.highest,
            self.sync_limit,
            sun=self.sun,
            hour_angle=None if self.hour_angle_limit is None else self.hour_angle_limit * 15.0,
        )


class SurfaceConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """One ``[[surface]]``."""

    at: Annotated[
        str,
        _key(
            "where programs connect: PROTOCOL[:MODEL[/VERSION]]@tcp://HOST:PORT, rfc2217://HOST:PORT, "
            "pty:PATH or a serial port",
            "ENDPOINT",
            "lx200@tcp://127.0.0.1:4030",
        ),
    ]
    baud: Annotated[
        Annotated[int, Meta(ge=300, le=921600)] | None,
        _key("baud rate of a serial port (default: 9600, and any at all on a virtual one)", "BAUD", 9600),
    ] = None
    mount: Annotated[str | None, _key("the name of the mount, where there are several", "NAME", "pier")] = None
    client: Annotated[
        str,
        _key(
            "the program that connects here, which then gets what it needs; auto: recognised where it can be, "
            "any: never",
            "PROGRAM",
        ),
    ] = "auto"
    equinox: Annotated[
        Literal["jnow", "j2000"] | None,
        _key("what the program's coordinates mean; else what client says, else jnow", example="jnow"),
    ] = None
    precision: Annotated[
        Literal["high", "low"] | None,
        _key("the precision a connection begins with (lx200); else what client says, else high", example="high"),
    ] = None
    sync_text: Annotated[
        _Plain | None,
        _key(
            "reply to :CM# without its # (lx200); else what client says, else the model's own",
            "TEXT",
            "Coordinates matched.",
        ),
    ] = None
    allow: Annotated[
        list[str] | None,
        _key(
            "tcp: only these networks or addresses may connect (default: all that can reach the port)",
            "NETWORKS",
            ["192.168.1.0/24", "127.0.0.1"],
        ),
    ] = None
    read_only: Annotated[
        bool | list[str],
        _key(
            "programs see the mount and may stop it, but move and set nothing: all, or those of these networks",
            "NETWORKS",
        ),
    ] = False
    max_clients: Annotated[int, _key("tcp: no more connections than this at a time", "N", ge=1, le=10000)] = 400


class ConsoleConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """``[console]``: the page that shows the mounts in a browser."""

    at: Annotated[
        str,
        _key(
            "where a browser finds the console; another free port is taken where this one is not; off: there is none",
            "tcp://HOST:PORT",
        ),
    ] = "tcp://127.0.0.1:4080"
    allow: Annotated[
        list[str] | None,
        _key(
            "only browsers of these networks or addresses are shown anything (default: all that reach the port)",
            "NETWORKS",
            ["192.168.1.0/24", "127.0.0.1"],
        ),
    ] = None
    read_only: Annotated[
        bool | list[str],
        _key("pages show the mounts and may stop them, but move and set nothing: all, or those of these networks",
             "NETWORKS"),
    ] = False  # fmt: skip
    pin: Annotated[
        _Plain | None, _key("without it a page only looks and stops; whoever types it in may act", "PIN", "4711")
    ] = None
    names: Annotated[
        list[str], _key("further names under which browsers reach this computer", "NAMES", ["pier.example.org"])
    ] = []  # fmt: skip


class Config(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """Everything that ``run`` needs."""

    mount: list[MountConfig]
    surface: list[SurfaceConfig] = []
    console: list[ConsoleConfig] = []
    wait: Annotated[bool, _key("keep trying when no mount answers; clients stay connected")] = False
    discovery: Annotated[bool, _key("let programs find surfaces that the network can reach (SkySafari, mDNS)")] = True
    watchdog: Annotated[
        bool, _key("a second, small process stops the mount when this one dies or hangs while something moves")
    ] = True
    log: Annotated[
        bool | Literal["all", "program", "mount", "changes", "refusals"],
        _key(
            "show the conversation in words: all of it (or true), only that with programs or with the mount, only what "
            "moves or sets something, or only what is refused or fails"
        ),
    ] = False
    night: Annotated[bool, _key("colours on the terminal are shades of red")] = False
    status: Annotated[bool, _key("show one line on a terminal that tells how the mount is (not together with log)")] = (
        True
    )

    @property
    def page(self) -> ConsoleConfig | None:
        """The console; None where there is to be none."""
        console = self.console[0] if self.console else ConsoleConfig()
        return None if console.at == OFF else console

    def of(self, mount: MountConfig) -> list[SurfaceConfig]:
        """The surfaces of one mount."""
        return [surface for surface in self.surface if surface.mount == mount.name or len(self.mount) == 1]


#: Every table and what its keys are; the keys outside any table last.
TABLES: dict[str, type[Struct]] = {"mount": MountConfig, "surface": SurfaceConfig, "console": ConsoleConfig, "": Config}
