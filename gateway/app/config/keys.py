"""Every key of a mount and of a surface, declared once: its type, range, default and description.

A new key is one field here, and the code that reads it (docs/adding.md). ``key`` takes the description for
``--help`` and the documentation, the name of the value, an example for keys without a default, and the limits that
msgspec checks; if a key may be absent, its limits belong to the inner type. Every key of ``[mount]`` is also a flag of
``run``, except those with ``flag=False``, and so is every key that only a surface has. In a flag, commas separate the
values of a list. ``run --help`` shows the ``common`` keys, ``run --help all`` the others.
"""

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

from gateway.mount.policy import Limits

#: The value that turns something off.
OFF = "off"


def key(
    description: str, metavar: str = "", example: Any = None, *, flag: bool = True, common: bool = False, **limits: Any
) -> Meta:
    extra = {"shown": metavar, "example": example, "flag": flag, "common": common}
    return Meta(description=description, extra=extra, **limits)


#: The characters of a name: no blank, no slash, no wildcard.
NAME_PATTERN = r"[A-Za-z0-9_.-]+"
Word = Annotated[str, Meta(pattern=f"^{NAME_PATTERN}$", title="a word of letters, digits and _ . -")]
Plain = Annotated[str, Meta(pattern=r"^[ -\"$-~]+$", title="plain text without #")]
Host = Annotated[str, Meta(pattern=r"^[][A-Za-z0-9_.:-]+$", title="a host name or an address")]
_Latitude = Annotated[float, Meta(ge=-90.0, le=90.0)]
_Longitude = Annotated[float, Meta(ge=-180.0, le=360.0)]


class MountConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """``[mount]``, or one ``[[mount]]`` of several."""

    at: Annotated[
        str,
        key(
            "the mount: PROTOCOL[:MODEL[/VERSION]]@PORT, where PORT is a serial port, socket://HOST:PORT or another "
            "pyserial URL, http://HOST:PORT of an Alpaca server, or sim for a simulated mount",
            "ENDPOINT",
            "nexstar@/dev/ttyUSB0",
            flag=False,
        ),
    ]
    name: Annotated[
        Word | None, key("a name for the mount, needed with several mounts", "NAME", "pier", flag=False)
    ] = None
    baud: Annotated[int, key("speed of the mount's serial port (baud)", "BAUD", ge=300, le=921600)] = 9600
    site: Annotated[
        tuple[_Latitude, _Longitude] | None,
        key(
            "latitude and longitude (degrees, north and east positive), for hand controls that do not report them",
            "LAT,LON",
            [48.1, 11.6],
            common=True,
        ),
    ] = None
    mode: Annotated[
        Literal["alt-az", "eq-north", "eq-south"] | None,
        key(
            "tracking mode, for hand controls that do not report it (before version 2.3), and an AZ-EQ whose tracking "
            "is off",
            example="alt-az",
        ),
    ] = None
    equinox: Annotated[
        Literal["jnow", "j2000", "auto"] | None,
        key(
            "equinox of the mount's coordinates (default: jnow, of a SynScan j2000, of an Alpaca mount what its server "
            "declares); auto: by the version of its hand control",
            example="auto",
        ),
    ] = None
    site_time: Annotated[
        Literal["unaligned", "always", "never"],
        key(
            "when to pass site and time from programs on to the mount (unaligned: to a NexStar only until it is "
            "aligned, to a Meade always, to an Alpaca server not)"
        ),
    ] = "unaligned"
    computer_clock: Annotated[
        Literal["auto", "right", "doubtful"],
        key(
            "whether the limits may use this computer's clock. auto: yes; but if it is older than this version, or "
            "no time server has set it on a board without a hardware clock, only if neither the mount nor its GPS "
            "reports the time"
        ),
    ] = "auto"
    lowest: Annotated[
        Annotated[float, Meta(ge=-90.0, le=90.0)] | None,
        key(
            "lowest altitude (degrees; default: 0). It applies to the hand control's keys only if you set it",
            "DEG",
            15.0,
            common=True,
        ),
    ] = None
    highest: Annotated[
        Annotated[float, Meta(ge=-90.0, le=90.0)] | None,
        key(
            "highest altitude (degrees; default: 90). It applies to the hand control's keys only if you set it",
            "DEG",
            85.0,
            common=True,
        ),
    ] = None
    sync_limit: Annotated[float, key("refuse syncs further away than this (degrees)", "DEG", gt=0.0, le=180.0)] = 15.0
    guide_rate: Annotated[
        Annotated[float, Meta(gt=0.0, le=1.0)] | None,
        key("guiding speed as a fraction of sidereal (default: 0.5 on a NexStar; a Meade keeps its own)", "RATE", 0.5),
    ] = None
    guide_directions: Annotated[
        Literal["motor", "sky"] | None,
        key(
            "what guide pulses (:Mgn#, PulseGuide) to a NexStar mean on both sides of the pier. motor: a pulse always "
            "turns the motor the same way; sky: north is always north on the sky (default: sky for Alpaca programs, "
            "else motor)",
            example="motor",
        ),
    ] = None
    park: Annotated[
        tuple[Annotated[float, Meta(ge=-360.0, le=360.0)], Annotated[float, Meta(ge=-180.0, le=180.0)]]
        | Literal["mount"]
        | None,
        key(
            "park position of a NexStar, as axis readings in degrees (default: the pole on an equatorial mount, else "
            "north at the horizon or half a degree above lowest). mount: a Meade may park at its own park position, "
            "even outside lowest and highest",
            "AZ,ALT",
            [0.0, 0.0],
        ),
    ] = None
    unaligned: Annotated[
        Literal["refuse", "allow"],
        key(
            "whether a NexStar that is not aligned may be sent to axis readings, parked and homed. Nobody knows "
            "then where it really points"
        ),
    ] = "refuse"
    aux_home: Annotated[bool, key("use the mount's home switches for homing, if it has them")] = False
    reversed_axes: Annotated[
        Literal["none", "first", "second", "both"] | None,
        key(
            "axes of an Alpaca mount that arrows turn the wrong way (default: found with the first arrow)",
            example="first",
        ),
    ] = None
    hibernate: Annotated[
        bool,
        key(
            "allow programs on a network surface (tcp, rfc2217) to put the mount to sleep; "
            "on virtual and real serial ports they always may"
        ),
    ] = False
    sun: Annotated[
        float,
        key(
            "keep this far from the Sun while it is up (degrees; 0: no limit, for solar filters)",
            "DEG",
            common=True,
            ge=0.0,
            le=90.0,
        ),
    ] = 20.0
    hour_angle_limit: Annotated[
        Annotated[float, Meta(gt=0.0, le=12.0)] | None,
        key(
            "how far an equatorial mount may go past the meridian (hours; default: no limit)", "HOURS", 1.5, common=True
        ),
    ] = None
    run_on: Annotated[
        float,
        key(
            "seconds the mount keeps moving after a stop; limits allow for it. mount-gateway prove measures it",
            "S",
            ge=0.5,
            le=10.0,
        ),
    ] = 0.5
    rates: Annotated[
        Annotated[list[Annotated[float, Meta(gt=0.0, le=20.0)]], Meta(min_length=9, max_length=9)] | None,
        key(
            "real speeds of the nine arrow rates (degrees a second), if they differ from the maker's. mount-gateway "
            "prove measures it",
            "RATES",
            [0.002, 0.004, 0.017, 0.033, 0.067, 0.27, 1.0, 2.0, 4.0],
        ),
    ] = None
    dead_man: Annotated[
        float,
        key(
            "stop arrow motion when the program that started it has been silent this long (seconds)",
            "S",
            gt=0.0,
            le=3600.0,
        ),
    ] = 30.0
    dead_man_closed: Annotated[
        float,
        key(
            "stop arrow motion this long after the connection that started it was closed, unless its computer has "
            "opened another (seconds)",
            "S",
            gt=0.0,
            le=3600.0,
        ),
    ] = 5.0
    state: Annotated[
        str | None,
        key(
            "folder for the state saved between runs (default: the usual one of your system)",
            "PATH",
            "/var/lib/mount-gateway",
        ),
    ] = None
    record: Annotated[
        str | None, key("record all traffic to FILE, for decode and report", "FILE", "/var/tmp/night.rec", common=True)
    ] = None
    record_keep: Annotated[
        int, key("how many files of 10 MB a recording may have; then the oldest is deleted", "N", ge=1, le=10000)
    ] = 20
    latency: Annotated[float, key("how long a simulated mount takes to answer (seconds)", "S", ge=0.0, le=3.0)] = 0.0
    speed: Annotated[
        float, key("how many times faster than a real mount a simulated one slews", "TIMES", gt=0.0, le=1000.0)
    ] = 1.0

    @property
    def limits(self) -> Limits:
        """The limits of the mount's motion and of syncs, all in degrees, also the hour angle."""
        lowest, highest = self.lowest, self.highest
        return Limits(
            0.0 if lowest is None else lowest,
            90.0 if highest is None else highest,
            self.sync_limit,
            sun=self.sun,
            hour_angle=None if self.hour_angle_limit is None else self.hour_angle_limit * 15.0,
            key_limits=(-90.0 if lowest is None else lowest, 90.0 if highest is None else highest),
        )


class SurfaceConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """One ``[[surface]]``."""

    at: Annotated[
        str,
        key(
            "where programs connect: PROTOCOL[:MODEL[/VERSION]]@tcp://HOST:PORT, rfc2217://HOST:PORT, "
            "pty:PATH or a serial port; any@tcp://HOST:PORT recognises the protocol by a program's first bytes",
            "ENDPOINT",
            "lx200@tcp://127.0.0.1:4030",
        ),
    ]
    baud: Annotated[
        Annotated[int, Meta(ge=300, le=921600)] | None,
        key("speed of a serial port (baud; default: 9600; a virtual port takes any)", "BAUD", 9600),
    ] = None
    mount: Annotated[
        str | None, key("name of the mount this surface belongs to, needed with several mounts", "NAME", "pier")
    ] = None
    client: Annotated[
        str,
        key(
            "the program that connects here; the gateway adapts to it. auto: recognise it where possible; "
            "any: treat all alike",
            "PROGRAM",
        ),
    ] = "auto"
    equinox: Annotated[
        Literal["jnow", "j2000"] | None,
        key("equinox of the program's coordinates (default: by client, else jnow; stellarium: j2000)", example="jnow"),
    ] = None
    guide_directions: Annotated[
        Literal["motor", "sky"] | None,
        key("what guide pulses of these programs mean, instead of the mount's key", example="sky", flag=False),
    ] = None
    precision: Annotated[
        Literal["high", "low"] | None,
        key("lx200: precision when a program connects (default: by client, else high)", example="high"),
    ] = None
    sync_text: Annotated[
        Plain | None,
        key(
            "lx200: reply to :CM# (sync), without its # (default: by client, else that of the model)",
            "TEXT",
            "Coordinates matched.",
        ),
    ] = None
    allow: Annotated[
        list[str] | None,
        key(
            "only these networks or addresses may connect (default: all that can reach the port)",
            "NETWORKS",
            ["192.168.1.0/24", "127.0.0.1"],
            common=True,
        ),
    ] = None
    read_only: Annotated[
        bool | list[str],
        key(
            "programs may look and stop the mount, but not move or set anything: all programs, or those on these "
            "networks",
            "NETWORKS",
        ),
    ] = False
    names: Annotated[
        list[Host],
        key(
            "alpaca and any: further names and addresses under which programs reach this computer, as through a router "
            "or a container's published port",
            "NAMES",
        ),
    ] = []
    hold_text: Annotated[
        bool,
        key(
            "lx200 on the network: a refused goto is answered by its digit at once, and by the text behind it only if "
            "the program waits 1.2 s for that, because INDI's drivers do not read it; false: all at once"
        ),
    ] = True
    degree: Annotated[
        Literal["*", "0xDF"] | None,
        key(
            "lx200: the degree character in replies: the byte 0xDF, as Meades send it, or * (default: 0xDF on serial, "
            "virtual and RFC 2217 ports; * on tcp)",
            example="0xDF",
        ),
    ] = None
    reply_after: Annotated[
        Annotated[float, Meta(ge=0.0, le=1000.0)] | None,
        key(
            "milliseconds between a request and its reply, because some programs clear their input after sending "
            "(default: 6 on serial, virtual and RFC 2217 ports, 0 on tcp)",
            "MS",
            6.0,
        ),
    ] = None
    max_clients: Annotated[int, key("network surfaces: how many connections at a time", "N", ge=1, le=10000)] = 400
