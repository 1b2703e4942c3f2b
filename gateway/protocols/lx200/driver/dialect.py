"""Reads what another maker's controller, such as an OnStep, reports, as the table of its dialect describes it.

A status report serves all reads for some seconds, unless an order is sent. Speeds are read if they depend on the setup.
If the controller's own timer ends an arrow that nobody has released, the arrow is pressed again.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from gateway.core.errors import Fault, Garbled, NoAnswer, Silence
from gateway.core.operations import Operation
from gateway.protocols.base.driver import Remark, Schedule, Send, Steps
from gateway.protocols.lx200.driver.speeds import SPEEDS
from gateway.protocols.lx200.driver.state import OWN_PATIENCE, ControllerReport, Lx200Driver, ask

#: Seconds for which a status report is reused; an order makes it stale at once.
SHARED = 2.5
#: Seconds from pressing an arrow to the first check whether it moves the mount, and between two further checks.
LOOK_FIRST, LOOK_AGAIN = 1.25, 2.0
#: Shortest timeout of such a check, seconds.
GLANCE = 0.5


def read_report(mount: Lx200Driver, status_request: Send | None = None) -> Steps:
    """Return the status report: the last one if it is recent and nothing was ordered since, else a new one."""
    if mount.reported is None or mount.now() - mount.reported[0] > SHARED:
        form = mount.dialect["status"]
        answer = (yield status_request) if status_request is not None else (yield from ask(mount, form["command"]))
        state = (
            _report_from_letters(mount, form, answer["letters"]) if "letters" in answer else _report_from_places(answer)
        )
        mount.reported = mount.now(), state
    return mount.reported[1]


def _report_from_places(answer: dict[str, Any]) -> ControllerReport:
    place = answer["aligned"]
    build = None if answer["build"] == "L" else answer["build"]
    return ControllerReport(answer["tracking"] == "T", place == "P", place == "H", build)


def _report_from_letters(mount: Lx200Driver, form: dict[str, Any], text: str) -> ControllerReport:
    letters, tail = text[: -form["tail"]], text[-form["tail"] :]
    if not any(letter in letters for letter in form["park"]):
        raise Garbled  # cut short, or another controller's
    mount.pulse_rate = f"R{tail[0]}" if tail[:1] == tail[1:2] else None  # either may be that of its pulses
    if mount.rate_sent is None and (pulses := f"R{tail[:1]}") in mount.dialect["pulses"]["rates"]:
        mount.pulses_before = pulses
    if mount.supports(keys := f"R{tail[1:2]}") and keys != mount.rate_sent:
        mount.keys_rate = keys

    def has(name: str) -> bool:
        return any(letter in letters for letter in form[name])

    builds, sides = {"german": "G", "fork": "P", "alt-az": "A"}, {"east": "E", "west": "W"}
    return ControllerReport(
        tracks=not has("tracks-not"),
        parked=has("parked"),
        home=has("home"),
        build=next((letter for name, letter in builds.items() if has(name)), None),
        side=next((letter for name, letter in sides.items() if has(name)), None),
        moves=has("moves"),
        slews=has("seeks") or not has("goto-not"),
        fault=tail[-1:] != "0",
    )


def reported_side(mount: Lx200Driver) -> Steps:
    """Return the side of the pier, E or W; None if the mount does not report it."""
    if not mount.tells_status or not mount.dialect:
        return None
    if (command := mount.dialect["status"].get("side")) is not None:
        side = (yield from ask(mount, command))["side"]
    else:
        side = (yield from read_report(mount)).side
    return side if side in ("E", "W") else None


def learn_speeds(mount: Lx200Driver) -> Steps:
    """Read the speeds of the arrows, if they depend on how the controller was set up."""
    said: dict[str, float | None] = {}
    for name, speed in mount.dialect.get("speeds", {}).items():
        if isinstance(speed, list):
            command, times = speed
            if command not in said:
                said[command] = yield from _number(mount, command)
            if (number := said[command]) is not None:
                mount.own_speeds[name] = number * times * SPEEDS["RG"]
    rates = mount.dialect["pulses"]["rates"]
    if not mount.guide_rate_chosen:
        rate = mount.pulse_rate if mount.pulse_rate in rates else str(rates[-1])
        mount.guide_rate = mount.speeds.get(rate or "", SPEEDS["RG"]) / SPEEDS["RG"]


def _number(mount: Lx200Driver, command: str) -> Steps:
    """Return a number that the mount reports; None if it reports none."""
    with contextlib.suppress(ValueError):
        try:
            return float((yield Send(command, patience=OWN_PATIENCE))["speed"]) or None
        except Fault as fault:
            if type(fault) is NoAnswer:
                raise
    return None


class KeepOn(Operation, frozen=True):
    """Internal: check whether an arrow still moves the mount; ``observed_at`` is when it was last seen to do so."""

    axis: int
    pressed_at: float
    observed_at: float


def watch_arrow(mount: Lx200Driver, axis: int) -> Steps:
    """Check later whether an arrow moves the mount, if its controller can end arrows by itself."""
    if "arrows" in mount.dialect and mount.tells_status:
        yield Schedule(LOOK_FIRST, KeepOn(axis, mount.now(), mount.now()))


def keep_on(mount: Lx200Driver, operation: KeepOn) -> Steps:
    """Press an arrow again if the controller's timer has ended it and nobody has released it.

    An arrow that ended at any other time met a limit or was stopped at the keypad: it is not pressed again. A release
    has to wait for this check, so an unverified reply is accepted if it shows motion, and the timeout is short.
    """
    axis, letter = operation.axis, mount.moving.get(operation.axis)
    if not letter:
        return
    mount.reported, form, patience = None, mount.dialect["status"], max(GLANCE, 2.0 * mount.reply_time)

    def shows_motion(reply: Mapping[str, object]) -> bool:
        return not set(form["moves"]).isdisjoint(str(reply.get("letters")))

    try:
        state = yield from read_report(mount, Send(form["command"], patience=patience, unverified_ok=shows_motion))
    except (Silence, Garbled):
        yield Schedule(LOOK_AGAIN, operation)
        return
    if mount.moving.get(axis) != letter or mount.rate_sent is None:  # somebody has released it meanwhile
        return
    ends = operation.pressed_at + mount.dialect["arrows"]["end"]
    if state.moves:
        yield Schedule(LOOK_AGAIN, replace(operation, observed_at=mount.now()))
    elif state.fault or not operation.observed_at < ends < mount.now():
        del mount.moving[axis]
        yield Remark(
            "the mount ended the arrow, by its own limit or at its keypad: the gateway does not press it again"
        )
    else:
        yield from ask(mount, mount.rate_sent)
        if mount.moving.get(axis) == letter:
            yield from ask(mount, f"M{letter}")
            yield from watch_arrow(mount, axis)
