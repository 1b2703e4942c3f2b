"""Reads the status reports of another maker's controller, such as an OnStep, by the table of its dialect.

The last status report answers all status queries for some seconds, or until an order is sent. If the controller's timer
ends the motion of an arrow (a direction key) that the client has not released, the gateway presses the arrow again.
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
from gateway.protocols.lx200.driver.state import KNOWN_COMMAND_TIMEOUT, ControllerReport, Lx200Driver, ask

#: Seconds for which a status report is reused; an order makes it stale at once.
REPORT_MAX_AGE = 2.5
#: Seconds from pressing an arrow to the first check whether it moves the mount, and between two further checks.
ARROW_CHECK_DELAY, ARROW_CHECK_INTERVAL = 1.25, 2.0
#: Shortest timeout of such a check, seconds.
ARROW_CHECK_TIMEOUT = 0.5


def read_report(mount: Lx200Driver, status_request: Send | None = None) -> Steps:
    """Return the last status report if it is recent and no order followed, else a new one (by ``status_request``)."""
    if mount.last_report is None or mount.now() - mount.last_report[0] > REPORT_MAX_AGE:
        form = mount.dialect["status"]
        answer = (yield status_request) if status_request is not None else (yield from ask(mount, form["command"]))
        state = (
            _report_from_letters(mount, form, answer["letters"]) if "letters" in answer else _report_from_fields(answer)
        )
        mount.last_report = mount.now(), state
    return mount.last_report[1]


def _report_from_fields(answer: dict[str, Any]) -> ControllerReport:
    place = answer["aligned"]
    build = None if answer["build"] == "L" else answer["build"]
    return ControllerReport(answer["tracking"] == "T", place == "P", place == "H", build)


def _report_from_letters(mount: Lx200Driver, status_table: dict[str, Any], status_text: str) -> ControllerReport:
    letters, tail = status_text[: -status_table["tail"]], status_text[-status_table["tail"] :]
    if not any(letter in letters for letter in status_table["park"]):
        raise Garbled  # cut short, or another controller's
    mount.pulse_rate = f"R{tail[0]}" if tail[:1] == tail[1:2] else None  # either may be that of its pulses
    if mount.rate_sent is None and (pulses := f"R{tail[:1]}") in mount.dialect["pulses"]["rates"]:
        mount.old_pulse_rate = pulses
    if mount.supports(keys := f"R{tail[1:2]}") and keys != mount.rate_sent:
        mount.keypad_rate = keys

    def has_flag(flag: str) -> bool:
        return any(letter in letters for letter in status_table[flag])

    builds, sides = {"german": "G", "fork": "P", "alt-az": "A"}, {"east": "E", "west": "W"}
    return ControllerReport(
        tracks=not has_flag("tracks-not"),
        parked=has_flag("parked"),
        at_home=has_flag("home"),
        mounting=next((letter for name, letter in builds.items() if has_flag(name)), None),
        side=next((letter for name, letter in sides.items() if has_flag(name)), None),
        moves=has_flag("moves"),
        slews=has_flag("seeks") or not has_flag("goto-not"),
        has_fault=tail[-1:] != "0",
    )


def read_pier_side(mount: Lx200Driver) -> Steps:
    """Return the side of the pier, E or W; None if the mount does not report it."""
    if not mount.has_status or not mount.dialect:
        return None
    if (command := mount.dialect["status"].get("side")) is not None:
        side = (yield from ask(mount, command))["side"]
    else:
        side = (yield from read_report(mount)).side
    return side if side in ("E", "W") else None


def read_speeds(mount: Lx200Driver) -> Steps:
    """Read the speeds of the arrows that depend on the controller's set-up; set the guide rate unless configured."""
    said: dict[str, float | None] = {}
    for name, speed in mount.dialect.get("speeds", {}).items():
        if isinstance(speed, list):
            command, times = speed
            if command not in said:
                said[command] = yield from _read_speed(mount, command)
            if (number := said[command]) is not None:
                mount.reported_speeds[name] = number * times * SPEEDS["RG"]
    rates = mount.dialect["pulses"]["rates"]
    if not mount.guide_rate_configured:
        rate = mount.pulse_rate if mount.pulse_rate in rates else str(rates[-1])
        mount.guide_rate = mount.speeds.get(rate or "", SPEEDS["RG"]) / SPEEDS["RG"]


def _read_speed(mount: Lx200Driver, command: str) -> Steps:
    """Return the speed in the reply to a command, in the unit of that command; None without a usable reply."""
    with contextlib.suppress(ValueError):
        try:
            return float((yield Send(command, timeout=KNOWN_COMMAND_TIMEOUT))["speed"]) or None
        except Fault as fault:
            if type(fault) is NoAnswer:
                raise
    return None


class CheckArrow(Operation, frozen=True):
    """Internal: check whether an arrow still moves the mount; ``seen_moving_at`` is when a report last showed that."""

    axis: int
    pressed_at: float
    seen_moving_at: float


def schedule_arrow_check(mount: Lx200Driver, axis: int) -> Steps:
    """Schedule a check whether an arrow still moves the mount, if the controller's timer can end such a motion."""
    if "arrows" in mount.dialect and mount.has_status:
        yield Schedule(ARROW_CHECK_DELAY, CheckArrow(axis, mount.now(), mount.now()))


def check_arrow_motion(mount: Lx200Driver, operation: CheckArrow) -> Steps:
    """Press an arrow again if the controller's timer has ended its motion and the client has not released it.

    A motion that ended at any other time met a limit or was stopped at the keypad, so the arrow is not pressed again.
    A release of the arrow waits for this check: so the timeout is short, and a reply that shows motion is not verified.
    """
    axis, letter = operation.axis, mount.moving.get(operation.axis)
    if not letter:
        return
    mount.last_report, form, patience = None, mount.dialect["status"], max(ARROW_CHECK_TIMEOUT, 2.0 * mount.reply_time)

    def shows_motion(reply: Mapping[str, object]) -> bool:
        return not set(form["moves"]).isdisjoint(str(reply.get("letters")))

    try:
        state = yield from read_report(mount, Send(form["command"], timeout=patience, unverified_ok=shows_motion))
    except (Silence, Garbled):
        yield Schedule(ARROW_CHECK_INTERVAL, operation)
        return
    if mount.moving.get(axis) != letter or mount.rate_sent is None:  # somebody has released it meanwhile
        return
    ends = operation.pressed_at + mount.dialect["arrows"]["end"]
    if state.moves:
        yield Schedule(ARROW_CHECK_INTERVAL, replace(operation, seen_moving_at=mount.now()))
    elif state.has_fault or not operation.seen_moving_at < ends < mount.now():
        del mount.moving[axis]
        yield Remark(
            "the mount ended the arrow, by its own limit or at its keypad: the gateway does not press it again"
        )
    else:
        yield from ask(mount, mount.rate_sent)
        if mount.moving.get(axis) == letter:
            yield from ask(mount, f"M{letter}")
            yield from schedule_arrow_check(mount, axis)
