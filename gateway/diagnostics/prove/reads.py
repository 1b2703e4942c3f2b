"""The reads stage: the mount's identity, and whether and how fast it answers all questions of its protocol.

Every question goes to the mount itself, even if the gateway has the answer in its cache or answers programs itself.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

from gateway.core import operations as op
from gateway.core.errors import Fault, NoDevice, Refused, Unsupported
from gateway.diagnostics.log.conversation import ConnectionDecoder, DecodedMessage
from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, SAME, Finding, StageReporter
from gateway.diagnostics.prove.telescope import CheckedMount
from gateway.protocols.base.driver import Driver
from gateway.protocols.registry import streams

#: Questions that are not asked: names of sites (private), lists that each question advances, and the target of a
#: server, which is only defined after a goto.
UNASKED_QUERIES = frozenset(("GM", "GN", "GO", "GP", "Lf", "LI", "??", "?+", "?-", "targetdeclination",
                        "targetrightascension"))  # fmt: skip
#: Seconds to wait after a missing answer before the next question.
RECOVERY_TIME = 3.0
#: Questions about product and version, which old mounts do not answer; the text for a version that is unknown.
NAME_QUERIES, UNKNOWN_VERSION = frozenset(("GVP", "GVN", "GVD", "GVT")), "?"
#: This word is in the description of a reply whose form is wrong.
GARBLED_WORD = "garbled"
#: Seconds: the longest reply time of an ordinary connection; the extra time that shows that the mount is busy.
USUAL_REPLY_TIME, BUSY_EXTRA_TIME = 0.3, 1.0
#: How many exchanges a question needs at most, as a rule: the gateway asks again if an answer is doubtful.
MAX_EXCHANGES = 6.0


async def ask_mount(telescope: CheckedMount, query_name: str) -> DecodedMessage:
    """Send a query to the mount even if the gateway has the answer in its cache; decode the reply. Raises Fault."""
    driver = telescope.driver
    side = ConnectionDecoder(driver.protocol.name, driver.model)
    side.describe_command(driver.protocol.commands[query_name].request.encode({}))
    keep = "dialect" if driver.protocol.dialect else "moment"
    return side.describe_reply_to_last(await telescope.controller.read(op.NativeRequest(query_name, (), keep)))


def _query_names(driver: Driver) -> Iterator[str]:
    """Yield the names of commands without arguments that only read something, if this mount has them."""
    for name, command in driver.protocol.commands.items():
        asks = command.is_query and command.answer_kind != "stream" and not command.request.fields and command.requested
        if asks and not command.beyond and name not in UNASKED_QUERIES and driver.supports(name):
            yield name


async def run(telescope: CheckedMount, report: StageReporter) -> None:
    """Ask all questions and report findings on identity, form of replies and reply times. Raises StageEnded."""
    identity: op.Identity | None = telescope.controller.cache.last_value(op.GetIdentity)
    report.add(_identity_finding(identity, telescope.driver))
    #: Seconds until the replies, by command; the commands without a reply, and those with a reply of another form.
    took, silent, strange = dict[str, float](), list[str](), list[str]()
    names = list(_query_names(telescope.driver))
    for number, name in enumerate(names):
        report.progress(number, len(names), telescope.driver.protocol.commands[name].help)
        began = telescope.now()
        try:
            heard = await ask_mount(telescope, name)
        except (Unsupported, NoDevice):
            continue  # it has not got that
        except Refused:
            heard = DecodedMessage(b"", "refused")  # an answer, too
        except Fault:
            await asyncio.sleep(RECOVERY_TIME)
            telescope.raise_if_stage_ends()
            if name in NAME_QUERIES and identity is not None and identity.version == UNKNOWN_VERSION:
                continue
            silent.append(name)
            continue
        telescope.raise_if_stage_ends()
        if not heard.text or GARBLED_WORD in heard.text:
            strange.append(name)
            continue
        took[name] = telescope.now() - began
    report.add(_reply_form_finding(len(took), silent, strange))
    report.add(_reply_time_finding(took, telescope.controller.line.times.typical_rtt))


def name_and_version(identity: op.Identity, driver: Driver) -> tuple[str, str]:
    """Return a mount's name and version, without the texts of a network server: they may contain its owner's name."""
    if driver.protocol.name not in streams():
        return f"{driver.protocol.name} {identity.model}", ""
    return " ".join(f"{identity.product} {identity.model} {identity.version}".split()), identity.version


def _identity_finding(identity: op.Identity | None, driver: Driver) -> Finding:
    if identity is None:
        return Finding("identity", NOT_MEASURABLE, "it tells nothing")
    name = name_and_version(identity, driver)[0]
    if driver.reported_model(identity) is None:
        return Finding("identity", NOT_MEASURABLE, f"{name}: it does not tell its model")
    if identity.model in driver.protocol.models:
        return Finding("identity", SAME, name)
    means = "The gateway has no model of this name: it drives it like its nearest relative."
    return Finding("identity", DIFFERS, name, "", means)


def _reply_form_finding(matching_count: int, silent_commands: list[str], malformed_replies: list[str]) -> Finding:
    what = "answers to its protocol's questions"
    if not silent_commands and not malformed_replies:
        return Finding(what, SAME, f"all {matching_count} in their form")
    parts = [f"none to {', '.join(silent_commands)}"] * bool(silent_commands)
    parts += [f"of another form to {', '.join(malformed_replies)}"] * bool(malformed_replies)
    means = "Programs that ask these get what the gateway knows instead, or a refusal."
    return Finding(what, DIFFERS, "; ".join(parts), f"{matching_count} others fit", means)


def _reply_time_finding(reply_times: dict[str, float], usual_time: float) -> Finding:
    """Return the finding on the reply times, seconds by command; ``usual_time`` is that of a single exchange."""
    if not reply_times:
        return Finding("reply times", DIFFERS, "no reply", "", "Nothing was answered.")
    longest = max(reply_times.values())
    measured = f"{usual_time * 1000.0:.0f} ms, at most {longest * 1000.0:.0f} ms"
    if usual_time > USUAL_REPLY_TIME:
        means = "A slow line: limits stop the mount earlier, and arrows end later. The gateway adapts by itself."
        return Finding("reply times", DIFFERS, measured, f"below {USUAL_REPLY_TIME * 1000.0:.0f} ms", means)
    if longest > MAX_EXCHANGES * usual_time + BUSY_EXTRA_TIME:
        means = "At times it is busy and answers late; the gateway waits for it."
        return Finding("reply times", DIFFERS, measured, "even", means)
    return Finding("reply times", SAME, measured)
