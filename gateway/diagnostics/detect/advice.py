"""What a person can try when no mount was found, by what was found on the ports instead."""

from __future__ import annotations

from collections.abc import Sequence

from gateway.diagnostics.detect.scan_port import BUSY, MUTE, UNOPENED, Finding
from gateway.protocols.registry import PROTOCOLS

NO_PORT = (
    "no serial port is there: plug the USB adapter in; dmesg | tail tells whether this computer noticed (on Windows "
    "the device manager)",
    "a virtual serial port must be named (mount-gateway detect /tmp/ttySIM0), and so must an adapter in the network "
    "(mount-gateway detect socket://192.168.1.50:4030)",
)
#: What may be wrong where nothing answers; between both come the cables of each protocol's mounts.
SWITCHED_OFF = "switch the mount on, and wait until its hand control has started"
SILENT = (
    "use the cable that is made for this hand control: others fit, and have their wires elsewhere",
    "end a program that speaks to the mount on another port; leave the menus of the hand control",
)
OF_OTHERS = {
    BUSY: "{port} is in use: end that program, or have it connect to the gateway in place of the port",
    UNOPENED: "{port} cannot be opened: mount-gateway detect without a port looks at all that there are",
    MUTE: "{port}: switch the mount off and on, and look again",
    "echo": "{port} hears itself: take out a loopback plug, or look whether the cable is the mount's own",
    "garbled": "{port}: try another cable, a shorter one, or another USB adapter",
}


def next_steps(findings: Sequence[Finding]) -> list[str]:
    """What to try next, most promising first; empty where a mount was found."""
    if any(finding.mount for finding in findings):
        return []
    if not findings:
        return list(NO_PORT)
    steps: list[str] = []
    silent = [finding.place.url for finding in findings if finding.state == "silent"]
    if silent:
        specs = [spec for spec in reversed(PROTOCOLS.values()) if spec.make_driver is not None]
        cables = "; ".join(f"{spec.makers[0].title()}: {spec.cable}" for spec in specs if spec.makers and spec.cable)
        deaf = [spec.deaf for spec in specs if spec.deaf]
        steps += [step.format(port=silent[0]) for step in (SWITCHED_OFF, cables, *SILENT, *deaf)]
    steps += [
        OF_OTHERS[finding.state].format(port=finding.place.url)
        for finding in findings
        if finding.state in OF_OTHERS and "usermod" not in finding.reason
    ]
    return list(dict.fromkeys(steps))
