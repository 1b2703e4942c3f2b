"""Declares the tables of ``gateway.toml`` other than mount and surface, and ``Config``, which contains all tables."""

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from gateway.app.config.keys import NAME_PATTERN, OFF, Host, MountConfig, Plain, SurfaceConfig, Word, key

#: What MQTT topics may begin with: words separated by slashes.
TOPIC_PREFIX_PATTERN = rf"^{NAME_PATTERN}(/{NAME_PATTERN})*$"
_Parts = Annotated[str, Meta(pattern=TOPIC_PREFIX_PATTERN, title="words of letters, digits and _ . -, with / between")]


class ConsoleConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """``[console]``: the page that shows the mounts in a browser."""

    at: Annotated[
        str,
        key(
            "where a browser finds the console. If the port is in use, the gateway takes the next free one; off: no "
            "console",
            "tcp://HOST:PORT",
        ),
    ] = "tcp://127.0.0.1:4080"
    allow: Annotated[
        list[str] | None,
        key(
            "only browsers on these networks or addresses may connect (default: all that reach the port)",
            "NETWORKS",
            ["192.168.1.0/24", "127.0.0.1"],
        ),
    ] = None
    read_only: Annotated[
        bool | list[str],
        key("pages show and stop the mounts, but move and set nothing: all pages, or those on these networks",
             "NETWORKS"),
    ] = False  # fmt: skip
    pin: Annotated[
        Plain | None, key("a page only shows and stops the mounts until its user enters this", "PIN", "4711")
    ] = None
    names: Annotated[
        list[Host],
        key("further names and addresses under which browsers reach this computer", "NAMES", ["pier.example.org"]),
    ] = []


class MqttConfig(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """``[mqtt]``: the broker to which this gateway publishes its mounts, and over which they can be stopped.

    The password is in a file of its own or in the environment: here or in a flag others would see it.
    """

    at: Annotated[
        str,
        key(
            "the MQTT broker on which the mounts are shown: mqtt://HOST:PORT, or mqtts://HOST:PORT with TLS",
            "URL",
            "mqtts://broker.example.org:8883",
        ),
    ]
    id: Annotated[
        Word | None, key("name of this gateway on the broker (default: the name of the computer)", "ID", "pier")
    ] = None
    prefix: Annotated[_Parts, key("prefix of all topics", "PREFIX")] = "mount-gateway"
    user: Annotated[Plain | None, key("user name for the broker", "USER", "observatory")] = None
    password_file: Annotated[
        str | None,
        key(
            "a file that contains only the password (default: the environment variable "
            "MOUNT_GATEWAY_MQTT_PASSWORD, where it is set)",
            "FILE",
            "/etc/mount-gateway/mqtt-password",
        ),
    ] = None
    ca: Annotated[
        str | None,
        key(
            "mqtts: a file with the certificates of the broker's authority (default: those of the system)",
            "FILE",
            "/etc/mount-gateway/ca.pem",
        ),
    ] = None
    home_assistant: Annotated[
        _Parts, key("the prefix at which Home Assistant looks for new devices; off: announce none", "PREFIX")
    ] = "homeassistant"
    orders: Annotated[
        list[Literal["park", "wake", "home", "goto"]],
        key("requests that the broker may send to a mount; stop is always allowed", "ORDERS"),
    ] = field(default_factory=lambda: ["park", "wake"])  # fmt: skip


class Config(Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """The whole configuration: everything that ``run`` needs."""

    mount: list[MountConfig]
    surface: list[SurfaceConfig] = []
    console: ConsoleConfig = field(default_factory=ConsoleConfig)
    mqtt: MqttConfig | None = None
    wait: Annotated[
        bool | None,
        key(
            "keep looking for a mount that does not answer; programs can connect meanwhile. false: give up after 10 s "
            "(default: after 40 s)",
            "true|false",
            True,
            common=True,
        ),
    ] = None
    discovery: Annotated[bool, key("let programs find surfaces that other computers reach (SkySafari, Alpaca)")] = True
    watchdog: Annotated[
        bool, key("a second, small process stops the mount if the gateway dies or hangs while the mount moves")
    ] = True
    almanac: Annotated[
        Plain | None,
        key(
            "file that mount-gateway almanac wrote on another computer, if this one has no astropy",
            "FILE",
            "year.almanac",
        ),
    ] = None
    log: Annotated[
        bool
        | Literal[
            "all",
            "program",
            "mount",
            "changes",
            "refusals",
            "json",
            "json-program",
            "json-mount",
            "json-changes",
            "json-refusals",
        ],
        key(
            "show the conversation in words; all counts repeated requests, too; program, mount, changes, refusals show "
            "only these; json, json-changes and so on print one JSON object a line",
            "WHAT",
            common=True,
        ),
    ] = False
    night: Annotated[bool, key("use only shades of red as colours on the terminal", common=True)] = False
    status: Annotated[bool, key("show a status line on a terminal, renewed every second (not together with log)")] = (
        True
    )

    @property
    def page(self) -> ConsoleConfig | None:
        """The console's settings; None if the console is off."""
        return None if self.console.at == OFF else self.console

    def surfaces_of(self, mount: MountConfig) -> list[SurfaceConfig]:
        """Return the surfaces of a mount; if there is only one mount, all of them."""
        return [surface for surface in self.surface if surface.mount == mount.name or len(self.mount) == 1]


#: Every table and the struct of its keys; the keys outside any table last.
TABLES: dict[str, type[Struct]] = {
    "mount": MountConfig, "surface": SurfaceConfig, "console": ConsoleConfig, "mqtt": MqttConfig, "": Config
}  # fmt: skip
