"""The reads: who the mount is, whether it answers every question of its protocol in its form, and how soon.

The questions are asked by a program of the mount's own protocol; what counts is what passes on the mount's line.
"""

from __future__ import annotations

import statistics

from gateway.core import operations as op
from gateway.core.wire_log import MOUNT, Entry
from gateway.diagnostics.log.conversation import Side
from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, NOT_TRIED, SAME, Finding, Report
from gateway.diagnostics.prove.programs import Program, readable
from gateway.diagnostics.prove.telescope import Telescope
from gateway.protocols.base.driver import Driver
from gateway.protocols.registry import streams

#: Questions that are not asked: names that people have given to sites, and lists that a question leafs through.
LEFT_ALONE = frozenset(("GM", "GN", "GO", "GP", "Lf", "LI", "??", "?+", "?-"))
#: Fields of answers that are of their moment only: positions, motion, time, temperature.
PASSING = frozenset(("ra", "dec", "az", "alt", "bars", "slewing", "state", "sidereal", "time", "date", "year", "month",
                     "day", "hour", "minute", "second", "value"))  # fmt: skip
#: In the words for a reply that has no form of its command; a refusal has one.
GARBLED = "garbled"
#: Seconds: a usual line answers sooner; and one that takes so much longer than its usual time is busy.
SOON, BUSY = 0.3, 1.0


class Line:
    """Follows the exchanges on the mount's line: a sink of the wire log."""

    def __init__(self, protocol: str) -> None:
        self._side, self._asked, self._command = Side(protocol), 0.0, ""
        #: By command: seconds of its replies; the commands without an answer, and those with one of another form.
        self.took: dict[str, list[float]] = {}
        self.silent: set[str] = set()
        self.strange: dict[str, bytes] = {}

    def put(self, entry: Entry) -> None:
        if entry.side != MOUNT or entry.arrow not in "<>":
            return
        if entry.arrow == ">":
            if self._command:
                self.silent.add(self._command)
            heard = self._side.command(entry.data)
            self._command, self._asked = heard.command if heard.asks else "", entry.time
        elif self._command:
            heard = self._side.reply(entry.data)
            if not heard.words or GARBLED in heard.words:
                self.strange[self._command] = entry.data
            else:
                self.took.setdefault(self._command, []).append(entry.time - self._asked)
            self._command = ""


async def run(telescope: Telescope, report: Report) -> None:
    """Raises Ended."""
    gateway, controller = telescope.gateway, telescope.controller
    identity: op.Identity | None = controller.cache.value(op.GetIdentity)
    report.found(_identity(identity, telescope.driver))
    if telescope.driver.protocol.name not in streams():
        report.found(Finding("answers to its protocol's questions", NOT_MEASURABLE, "they are no lines of bytes"))
        return
    line = Line(telescope.driver.protocol.name)
    names = list(readable(gateway, LEFT_ALONE))
    program = Program(gateway, line._side.protocol)
    gateway.wire_log.sinks.append(line.put)
    try:
        for number, name in enumerate(names):
            report.progress(number, len(names), telescope.driver.protocol.commands[name].help)
            heard = await program.ask(name)
            telescope.check()
            if heard is not None and heard.values and not PASSING & heard.fields.keys():
                telescope.settings[name] = repr(heard.values)
    finally:
        gateway.wire_log.remove(line.put)
        program.close()
    report.found(_forms(line))
    report.found(_times(line))


async def settings(telescope: Telescope, report: Report) -> None:
    """Ask again what the mount keeps, and compare it with what it told at first. Raises Ended."""
    if not telescope.settings:
        report.found(Finding("settings", NOT_TRIED, "the first stage has not been told any"))
        return
    program = Program(telescope.gateway, telescope.driver.protocol.name, "settings")
    try:
        after = dict[str, str]()
        for name in telescope.settings:
            heard = await program.ask(name)
            telescope.check()
            if heard is not None and not heard.fails:
                after[name] = repr(heard.values)
    finally:
        program.close()
    helps = telescope.driver.protocol.commands
    changed = [f"{name} ({helps[name].help})" for name, values in after.items() if values != telescope.settings[name]]
    means = "Set it back at the hand control, and tell the author of the gateway."
    if changed:
        report.found(Finding("settings", DIFFERS, "; ".join(changed), "as before", means))
    else:
        told = f"{len(after)} of {len(telescope.settings)} were told, as they were"
        report.found(Finding("settings", SAME if after else NOT_MEASURABLE, told))


def named(identity: op.Identity, driver: Driver) -> tuple[str, str]:
    """Return the name of a mount, and its version; a server's own texts may name its owner, and are left out."""
    if driver.protocol.name not in streams():
        return f"{driver.protocol.name} {identity.model}", ""
    return " ".join(f"{identity.product} {identity.model} {identity.version}".split()), identity.version


def _identity(identity: op.Identity | None, driver: Driver) -> Finding:
    if identity is None:
        return Finding("identity", NOT_MEASURABLE, "it tells nothing")
    name = named(identity, driver)[0]
    if driver.reported_model(identity) is None:
        return Finding("identity", NOT_MEASURABLE, f"{name}: it does not tell its model")
    if identity.model in driver.protocol.models:
        return Finding("identity", SAME, name)
    means = "The gateway has no model of this name: it drives it like its nearest relative."
    return Finding("identity", DIFFERS, name, "", means)


def _forms(line: Line) -> Finding:
    silent = sorted(line.silent - line.took.keys() - line.strange.keys())
    what = "answers to its protocol's questions"
    if not silent and not line.strange:
        return Finding(what, SAME, f"{len(line.took)} in their form")
    parts = [f"none to {', '.join(silent)}"] * bool(silent)
    parts += [f"of another form to {', '.join(sorted(line.strange))}"] * bool(line.strange)
    means = "Programs that ask these get what the gateway knows instead, or a refusal."
    return Finding(what, DIFFERS, "; ".join(parts), f"{len(line.took)} others fit", means)


def _times(line: Line) -> Finding:
    took = [seconds for each in line.took.values() for seconds in each]
    if not took:
        return Finding("reply times", DIFFERS, "no reply", "", "Nothing was answered.")
    usual, longest = statistics.median(took), max(took)
    measured = f"{usual * 1000.0:.0f} ms, at most {longest * 1000.0:.0f} ms"
    if usual > SOON:
        means = "A slow line: limits are kept from farther away, and arrows end later. The gateway adapts by itself."
        return Finding("reply times", DIFFERS, measured, f"below {SOON * 1000.0:.0f} ms", means)
    if longest > usual + BUSY:
        means = "At times it is busy and answers late; the gateway waits for it."
        return Finding("reply times", DIFFERS, measured, "even", means)
    return Finding("reply times", SAME, measured)
