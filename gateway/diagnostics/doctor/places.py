"""The checks of what a gateway shares with others: serial ports, TCP ports, the state folder, other gateways."""

from __future__ import annotations

from collections.abc import Iterator

from gateway.diagnostics.doctor.facts import BAD, GOOD, NOTE, Facts, Port, Said
from gateway.protocols.registry import ANY_PORT, PROTOCOLS

#: TCP ports that a gateway is usually reached at, and by whom.
USUAL = {4030: "most telescope programs", ANY_PORT: "programs of every protocol", 4080: "browsers"}
USUAL |= {spec.usual_port: spec.title for spec in PROTOCOLS.values() if spec.usual_port not in USUAL}
#: What makes ModemManager leave all USB serial ports alone; `linux` looks for its effect.
RULE = 'SUBSYSTEM=="tty", ENV{ID_BUS}=="usb", ENV{ID_MM_PORT_IGNORE}="1"'
LEAVE_ALONE = (
    "without a modem here: sudo systemctl disable --now ModemManager; else write the line "
    f"{RULE} into /etc/udev/rules.d/99-telescope.rules, type sudo udevadm control --reload, and plug the adapter in "
    "again"
)


def ports(facts: Facts) -> Iterator[Said]:
    """Every serial port can be opened by this user, and nobody else has it."""
    if not facts.ports:
        yield (
            NOTE,
            "there is no serial port",
            "plug the USB adapter in, unless the mount is reached over the network; dmesg | tail tells whether this "
            "computer noticed",
        )
    own = {running.process for running in facts.gateways}
    for port in facts.ports:
        called = f"{port.name} ({port.about})" if port.about else port.name
        if not port.permitted:
            yield BAD, f"{called}: you may not open it", _permission(facts, port)
        elif port.holder and not any(f"(process {process})" in port.holder for process in own):
            yield (
                BAD,
                f"{called} is in use by {port.holder}",
                "end that program, or let it connect to the gateway in place of the port",
            )
        else:
            used = f"in use by a gateway: {port.holder}" if port.holder else "free, and you may open it"
            yield GOOD, f"{called}: {used}", ""


def _permission(facts: Facts, port: Port) -> str:
    if port.group in facts.groups and port.group not in facts.active_groups:
        return f"log out and in again: you were put into the group {port.group}, which counts from the next login on"
    if port.group in facts.active_groups:
        return f"ls -l {port.name} tells who may: the group {port.group}, which you are in, has no right to write"
    return f"sudo usermod -aG {port.group} $USER, then log out and in again"


def meddlers(facts: Facts) -> Iterator[Said]:
    """Nobody writes to serial ports unasked, or takes them away."""
    usb = [port for port in facts.ports if port.usb]
    said = False
    if process := facts.meddlers.get("ModemManager"):
        exposed = [port.name for port in usb if not port.modem_manager_ignores]
        if exposed:
            said = True
            yield (
                BAD,
                f"ModemManager (process {process}) looks for modems: when a USB serial port is plugged in it may write "
                f"AT to it, which a mount can take for commands ({', '.join(exposed)})",
                LEAVE_ALONE,
            )
        elif not usb:
            said = True
            yield (
                NOTE,
                f"ModemManager (process {process}) runs: it may write AT to a USB serial port that is plugged in",
                LEAVE_ALONE,
            )
    if process := facts.meddlers.get("brltty"):
        said = True
        yield (
            NOTE if usb else BAD,
            f"brltty (process {process}) looks for braille displays: it takes some USB adapters (CH340, CP210x, FTDI) "
            "away, and their port vanishes",
            "if nobody here reads braille: sudo systemctl mask --now brltty brltty-udev, and plug the adapter in again",
        )
    if not said:
        yield GOOD, "no program is running that is known to write to serial ports unasked", ""


def listeners(facts: Facts) -> Iterator[Said]:
    """The ports that programs have in mind are free, or a gateway's own."""
    own = {running.process for running in facts.gateways}
    taken = {listener.port: listener for listener in facts.listeners}
    free = []
    for port, whom in USUAL.items():
        listener = taken.get(port)
        if listener is None:
            free.append(str(port))
        elif listener.process in own:
            yield GOOD, f"TCP port {port} is a gateway's (process {listener.process})", ""
        else:
            who = f"{listener.name} (process {listener.process})" if listener.process else "a program of another user"
            yield (
                NOTE,
                f"TCP port {port}, where {whom} would look for the gateway, is taken by {who}",
                f"end that program, or give the gateway another port, such as {port + 1}, and tell the programs",
            )
    if free:
        yield GOOD, f"TCP {'ports' if len(free) > 1 else 'port'} {', '.join(free)}: free", ""


def state_folder(facts: Facts) -> Iterator[Said]:
    """What a mount keeps over power-off can be written."""
    if facts.state_problem:
        yield (
            BAD,
            f"the state folder {facts.state_folder} cannot be written to ({facts.state_problem}): after a crash in "
            "motion the mount would not be stopped, and sites and parking are forgotten",
            f"make it yours: sudo chown -R $USER {facts.state_folder}; or name another one with --state",
        )
    else:
        yield GOOD, f"the state folder {facts.state_folder} can be written to", ""


def gateways(facts: Facts) -> Iterator[Said]:
    """Those that run, and whether they can be asked."""
    hidden: dict[tuple[str, bool], list[str]] = {}
    for running in facts.gateways:
        if running.mount:
            yield GOOD, f"a gateway runs for {running.mount} (process {running.process})", ""
        else:
            hidden.setdefault((running.user, running.foreign), []).append(str(running.process))
    for (user, foreign), numbers in hidden.items():
        which = f"process {numbers[0]}" if len(numbers) == 1 else f"processes {', '.join(numbers)}"
        yield (
            NOTE,
            f"{'a gateway' if len(numbers) == 1 else 'gateways'} of {user} cannot be asked from here: {which}",
            f"ask as {user} or as root" if foreign else "name its state folder: mount-gateway status --state PATH",
        )
    if not facts.gateways:
        yield GOOD, "no gateway runs now", ""
