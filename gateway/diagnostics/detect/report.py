"""Present examined ports as text, as values for JSON, and as the command line and ``gateway.toml`` of a gateway.

If no mount was found, the suggested next steps depend on the states of the ports.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence

from gateway.diagnostics.detect.identify import FoundMount
from gateway.diagnostics.detect.ports import is_not_built_in, unsupported_device_at
from gateway.diagnostics.detect.scan_port import BUSY, DEFAULT_BAUD, FOREIGN, NO_ID, SERVED, UNOPENED, PortFinding
from gateway.protocols.registry import ANY, ANY_PORT, PROTOCOLS, other_surface

#: The warning for users who let other computers connect.
NETWORK_WARNING = "anyone on your network can then move the mount"
#: The text that stands for the version of a mount that does not report it.
UNREPORTED_VERSION = "?"
STATE_TEXTS = {
    "silent": "nothing here: no answer",
    "echo": "nothing here: what is sent comes back (a loopback plug, a cable with echo, a modem)",
    "gps": "a GPS receiver, not a mount",
    "talker": "a device that sends unknown data by itself, not a mount; nothing was sent to it",
    "stranger": "something answers here, but not as a mount does",
    "garbled": "something answers here, but nothing legible at any rate: not a mount",
    "busy": "not examined",
    "foreign": "not examined",
    "served": "a mount that a gateway already uses",
    "unopened": "cannot be opened",
    "vanished": "the port vanished during the search",
    "mute": "a mount",
    "offered": "a mount to which programs connect; it needs no second gateway",
}
EQUINOX_TEXTS = {
    "jnow": "of date (jnow)",
    "j2000": "by this version j2000 ({by} says so, other programs say of date); "
             "--equinox auto follows it, the default is jnow",
    "always": "J2000 (j2000), as its maker says of all versions; that is the default",
}  # fmt: skip
NO_PORT_ADVICE = (
    "no serial port was found: plug in the USB adapter; dmesg | tail shows whether this computer noticed (on Windows "
    "the device manager)",
    "a virtual serial port must be named (mount-gateway detect /tmp/ttySIM0), and so must an adapter in the network "
    "(mount-gateway detect socket://192.168.1.50:4030)",
)
NO_ADAPTER_ADVICE = (
    "only ports that are built into this computer were looked at: if the mount is on a USB adapter, plug that in; "
    "dmesg | tail shows whether this computer noticed"
)
#: Advice if nothing answers: first this, then the cables for the mounts of each protocol, then `SILENT_PORT_ADVICE`.
SWITCH_ON_ADVICE = "switch the mount on, and wait until its hand control has started"
SILENT_PORT_ADVICE = (
    "use the cable that is made for this hand control: others fit, but are wired differently",
    "close programs that use the mount on another port, and leave the menus of the hand control",
)
ADVICE_BY_STATE = {
    BUSY: "{port} is in use: close that program, or let it connect to the gateway instead of the port",
    FOREIGN: "{port}: sudo mount-gateway status shows whether that gateway has this mount, and where programs connect",
    SERVED: "{port}: mount-gateway status shows this mount, and the addresses where programs connect to its gateway",
    UNOPENED: "{port} cannot be opened: mount-gateway detect without a port looks at every port",
    NO_ID: "{port}: switch the mount off and on, and look again",
    "echo": "{port} receives what it sends: remove a loopback plug, or use the mount's own cable",
    "garbled": "{port}: try another cable, a shorter one, or another USB adapter",
}


def describe_port(finding: PortFinding) -> str:
    """Describe a port for people: the mount and the commands that start a gateway, then the details."""
    about = f"  ({finding.port.about})" if finding.port.about else ""
    lines = _mount_lines(finding) if finding.mount else [_describe_no_mount(finding)]
    return "\n".join([f"{finding.port.url}{about}", *(f"  {line}".rstrip() for line in lines)])


def _describe_no_mount(finding: PortFinding) -> str:
    """Describe the state of a port without an identified mount."""
    states = {state: text for spec in PROTOCOLS.values() for state, text in spec.device_states.items()}
    text = (STATE_TEXTS | states)[finding.state]
    if finding.state == "silent" and finding.rates_tried > 1:
        text += f" at {DEFAULT_BAUD} baud and {finding.rates_tried - 1} other rates"
    elif finding.state in ("gps", "stranger", "echo") and finding.baud not in (None, DEFAULT_BAUD):
        text += f" ({finding.baud} baud)"
    return f"{text}: {finding.reason}" if finding.reason else text


def _mount_lines(finding: PortFinding) -> list[str]:
    mount = finding.mount
    assert mount is not None
    if not mount.answered_commands:  # it was not asked anything: a server offers it
        return [f"{mount.product}; its server answers in {mount.latency * 1000:.0f} ms", *_start_lines(finding)]
    baud = f"{finding.baud} baud; " if finding.baud else ""
    motors = f"motors {', '.join(dict.fromkeys(mount.motor_versions))}; " if mount.motor_versions else ""
    version = "tells no version" if mount.version == UNREPORTED_VERSION else f"version {mount.version}"
    model = f"model {mount.model}" if mount.reports_model else "a model it cannot tell"
    mute = [name for name, meaning in mount.answered_commands.items() if not meaning]
    title = PROTOCOLS[mount.protocol].commands.model_title(mount.product, mount.model)
    return [
        f"{title}, {version}, {model}",
        *start_hints(mount),
        *_start_lines(finding),
        f"details: {motors}{baud}a reply takes {mount.latency * 1000:.0f} ms; "
        f"equinox {EQUINOX_TEXTS[_text_key(mount) or mount.equinox].format(by=PROTOCOLS[mount.protocol].j2000_source)}",
        f"  replies: {'; '.join(f'{name} ({text})' for name, text in mount.answered_commands.items() if text)}",
        *([f"  no reply: {', '.join(mute)}"] if mute else []),
    ]


def _start_lines(finding: PortFinding) -> list[str]:
    """Return lines with the commands that start a gateway for a mount."""
    return [
        "start the gateway:",
        f"  {start_command(finding)}",
        f"instead, to let phones connect ({NETWORK_WARNING}):",
        f"  {start_command(finding, allows_network=True)}",
    ]


def _text_key(mount: FoundMount) -> str:
    """Return the key "always" of ``EQUINOX_TEXTS`` if all versions of this model report J2000 positions; else ""."""
    return "always" if PROTOCOLS[mount.protocol].commands.models.get(mount.model, {}).get("equinox") else ""


def start_hints(mount: FoundMount) -> list[str]:
    """Return what the user should know, or add to the start command, before the first run."""
    parts = []
    if mount.aligned is False:
        parts.append("not aligned yet: align it at the hand control, because it refuses gotos before")
    if not mount.reports_model and (unknown := PROTOCOLS[mount.protocol].unknown_model_note(mount.version)):
        parts.append(unknown)
    if not mount.reports_site:
        parts.append("it does not report its site and mode: add --site LAT,LON --mode alt-az (or eq-north, eq-south)")
    return parts


def mount_endpoint(finding: PortFinding) -> str:
    """Return the mount's endpoint; it names the model if the user did, or if the mount cannot report its version."""
    mount, place = finding.mount, finding.port
    assert mount is not None
    if place.typed_endpoint is not None and place.typed_endpoint.protocol == mount.protocol:
        return str(place.typed_endpoint)
    model = f":{mount.model}" if mount.version == UNREPORTED_VERSION and mount.model else ""
    return f"{mount.protocol}{model}@{place.name}"


def surface_endpoint(mount: FoundMount, allows_network: bool) -> str:
    """Return the endpoint of a suitable surface: for clients on this computer only, or also in the network."""
    spoken = other_surface(mount.protocol)
    return f"{spoken}@tcp://{'0.0.0.0' if allows_network else '127.0.0.1'}:{PROTOCOLS[spoken].usual_port}"


def start_command(finding: PortFinding, allows_network: bool = False) -> str:
    """Return the command line that starts a gateway with this mount."""
    assert finding.mount is not None
    argv = ["mount-gateway", "run", "--mount", mount_endpoint(finding)]
    if finding.baud not in (None, DEFAULT_BAUD):
        argv += ["--baud", str(finding.baud)]
    return shlex.join([*argv, "--surface", surface_endpoint(finding.mount, allows_network)])


def as_toml(finding: PortFinding, allows_network: bool = False) -> str:
    """Return a ``gateway.toml`` that is equivalent to the command line."""
    mount = finding.mount
    assert mount is not None
    who = f"# {mount.product} {mount.version}".removesuffix(f" {UNREPORTED_VERSION}")
    rows = [who, "[mount]", f"at = {json.dumps(mount_endpoint(finding))}"]
    if finding.baud:
        rows.append(f"baud = {finding.baud}")
    if mount.equinox == "j2000" and not _text_key(mount):
        rows.append(f'# equinox = "auto"  # j2000 for this version, by {PROTOCOLS[mount.protocol].j2000_source}')
    if not mount.reports_site:
        rows += ["# site = [48.1, 11.6]  # latitude north, longitude east positive", '# mode = "alt-az"']
    rows += ["", "[[surface]]", f"at = {json.dumps(surface_endpoint(mount, allows_network))}"]
    if allows_network:
        rows += [
            f"# {NETWORK_WARNING}: these protocols have no passwords",
            '# allow = ["192.168.1.0/24", "127.0.0.1"]  # only these may connect',
        ]
    else:
        rows += [
            "# instead, for programs of every protocol, and for your browser:",
            f'# at = "{ANY}@tcp://127.0.0.1:{ANY_PORT}"',
            f"# instead, to let phones connect ({NETWORK_WARNING}: these protocols have no passwords):",
            f"# at = {json.dumps(surface_endpoint(mount, True))}",
        ]
    spoken = other_surface(mount.protocol)
    rows += [
        "# instead, for programs on this computer that want a serial port (not on Windows):",
        f'# at = "{spoken}@pty:/tmp/{spoken}"',
        f"# instead, for a driver that redirects a COM port of a Windows computer ({NETWORK_WARNING}):",
        f'# at = "{spoken}@rfc2217://0.0.0.0:4032"',
    ]
    return "\n".join(rows) + "\n"


def port_values(finding: PortFinding, allows_network: bool = False) -> dict[str, object]:
    """Return the JSON object of a port; unknown values are None."""
    mount = finding.mount
    known: dict[str, object] = {
        "port": finding.port.url, "name": finding.port.name, "about": finding.port.about,
        "state": "mount" if mount else finding.state, "words": "" if mount else _describe_no_mount(finding),
        "baud": finding.baud, "seconds": round(finding.seconds, 2), "mount": None,
    }  # fmt: skip
    if mount is not None:
        known["mount"] = {
            "protocol": mount.protocol, "product": mount.product, "version": mount.version,
            "model": mount.model if mount.reports_model else None, "motors": list(mount.motor_versions),
            "aligned": mount.aligned, "equatorial": mount.equatorial, "equinox": mount.equinox,
            "latency": round(mount.latency, 4), "answers": mount.answered_commands,
            "endpoint": mount_endpoint(finding), "run": start_command(finding),
            "run_network": start_command(finding, allows_network=True), "toml": as_toml(finding, allows_network),
        }  # fmt: skip
    return known


def next_steps(findings: Sequence[PortFinding]) -> list[str]:
    """Return advice on what to try next, most promising first; empty if a mount was found."""
    if any(finding.mount for finding in findings):
        return []
    if not findings:
        return list(NO_PORT_ADVICE)
    steps = [] if any(is_not_built_in(finding.port.url) for finding in findings) else [NO_ADAPTER_ADVICE]
    silent = [finding.port.url for finding in findings if finding.state == "silent"]
    steps += filter(None, map(unsupported_device_at, silent))
    if silent and not steps:
        specs = [spec for spec in reversed(PROTOCOLS.values()) if spec.make_driver is not None]
        cables = "; ".join(f"{spec.makers[0].title()}: {spec.cable}" for spec in specs if spec.makers and spec.cable)
        deaf = [spec.detect_warning for spec in specs if spec.detect_warning]
        steps += [step.format(port=silent[0]) for step in (SWITCH_ON_ADVICE, cables, *SILENT_PORT_ADVICE, *deaf)]
    steps += [
        ADVICE_BY_STATE[finding.state].format(port=finding.port.url)
        for finding in findings
        if finding.state in ADVICE_BY_STATE and "permission denied" not in finding.reason
    ]
    return list(dict.fromkeys(steps))
