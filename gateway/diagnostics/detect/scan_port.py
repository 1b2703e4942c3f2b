"""Examine a port, from opening to closing; all ports are examined at the same time.

9600 baud comes first. Other rates are tried only if nothing was received at 9600, or if the bytes may have been sent at
another rate. An unknown device is queried in an order in which no query can do harm (``probes_for``). The first query
waits for silence: an unfinished command of another program must time out first, and a device that sends unasked is no
mount.
"""

from __future__ import annotations

import asyncio
import errno
import re
from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from functools import partial

from msgspec import Struct
from pynmea2 import NMEASentence

from gateway.core.errors import Fault
from gateway.diagnostics.detect.identify import FoundMount, identify
from gateway.diagnostics.detect.port_listener import BaudTransport, PortListener
from gateway.diagnostics.detect.ports import SerialPortInfo, other_user_gateway, port_holder, serving_gateway_pid
from gateway.protocols.base.spec import Probe
from gateway.protocols.registry import PROTOCOLS
from gateway.transport.wires import SerialTransport

#: The answer of an unknown device at its own baud rate; other bytes may come from a device at another rate.
_PRINTABLE_TEXT = re.compile(rb"[ -~\r\n\t]+")
_NMEA_LINE = re.compile(rb"\$([A-Z]{4,6},[^\r\n*$]*)\*([0-9A-F]{2})")


class PortVerdict(StrEnum):
    """Verdicts on a port without a mount. ``probe`` also returns protocols of mounts, and keys of ``device_states``."""

    SILENT = "silent"
    ECHO = "echo"
    GPS = "gps"
    TALKER = "talker"  # sends data unasked, but is no GPS receiver
    STRANGER = "stranger"  # answers, but not like a mount
    GARBLED = "garbled"  # answers with illegible bytes


class ProbeTimes(Struct, frozen=True):
    """Times in seconds: how long the port must be silent before the first query, and how long to wait for that silence;
    the interval between two queries; and the timeout of all answers, from the first query on.
    """

    required_silence: float
    silence_timeout: float
    query_interval: float
    answer_timeout: float


#: At 9600 baud: a hand control discards an incomplete command after a second, and may take 3.5 s to answer (NexStar
#: protocol, Developer Notes). ACK (0x06) is sent before that time is over, and its answer may arrive later.
AT_9600 = ProbeTimes(required_silence=1.05, silence_timeout=2.5, query_interval=0.6, answer_timeout=3.5)
#: At other rates only a Meade can be expected, which answers at once. Here, too, there is a second between the last
#: query at one rate and the first query at the next.
AT_OTHERS = ProbeTimes(required_silence=0.3, silence_timeout=1.5, query_interval=0.3, answer_timeout=1.05)


def probes_for(protocol: str | None) -> list[Probe]:
    """Return the queries that may be sent, in order.

    First comes ``Kx``, which a hand control echoes as ``x#`` and an LX200 ignores. Then come ``#`` and the single byte
    0x06, which a Meade answers with one letter and which is no command of a hand control; the ``#`` is for controllers
    that take the ``K`` for the beginning of a command. Nothing that begins with ``:`` is sent unless the user has named
    the protocol, because a hand control would take parts of it for commands: ``:GR#`` contains an ``R``, which is a
    goto. A user who names a protocol may be wrong: the queries before that protocol's are sent as well.
    """
    every = sorted(
        ((spec.name, question) for spec in PROTOCOLS.values() for question in spec.probes),
        key=lambda candidate: candidate[1].rank,
    )
    last = max((question.rank for name, question in every if name == protocol), default=None)
    return [
        question
        for name, question in every
        if (not question.opt_in or name == protocol) and (last is None or question.rank <= last)
    ]


async def probe(listener: PortListener, times: ProbeTimes, protocol: str | None = None) -> str:
    """Query an open port and return the verdict. Raises OSError if the port disappears meanwhile."""
    if not await _wait_for_silence(listener, times):
        return PortVerdict.GPS if has_nmea_sentence(listener.received) else PortVerdict.TALKER
    listener.discard_received()
    asked = probes_for(protocol)
    waits = [times.query_interval] * (len(asked) - 1)
    waits.append(times.answer_timeout - sum(waits))
    for question, seconds in zip(asked, waits, strict=True):
        listener.write(question.request)
        verdict = await _listen(listener, seconds, partial(_judge_received, listener, question))
        if verdict is not None:
            return verdict
    if not listener.received:
        return PortVerdict.SILENT
    if has_nmea_sentence(listener.received):
        return PortVerdict.GPS
    return PortVerdict.STRANGER if _PRINTABLE_TEXT.fullmatch(listener.received) else PortVerdict.GARBLED


async def listen_for_gps(listener: PortListener, seconds: float) -> str:
    """Listen to a device that sends unasked; return GPS or TALKER. Raises OSError if the port disappears."""
    return (
        await _listen(listener, seconds, lambda: PortVerdict.GPS if has_nmea_sentence(listener.received) else None)
        or PortVerdict.TALKER
    )


def _judge_received(listener: PortListener, query: Probe) -> str | None:
    return judge_bytes(listener.received, listener.quiet_seconds, query)


def judge_bytes(received: bytes, quiet_seconds: float, query: Probe) -> str | None:
    """Return the verdict on the bytes received after a query; None while they are ambiguous. ``quiet_seconds`` is the
    time since the last byte. Late answers to earlier queries are recognised, too.
    """
    before = [asked for spec in PROTOCOLS.values() for asked in spec.probes if asked.rank < query.rank]
    if received.startswith((query.request, *(asked.request for asked in before if asked.slow))):
        return PortVerdict.ECHO
    for asked in (*(asked for asked in before if asked.slow), query):
        if (said := asked.judge(received, quiet_seconds)) is not None:
            return said
    return None


def has_nmea_sentence(received: bytes) -> bool:
    """Whether these bytes contain a complete NMEA 0183 sentence with a valid checksum."""
    return any(
        NMEASentence.checksum(body.decode("latin-1")) == int(check, 16) for body, check in _NMEA_LINE.findall(received)
    )


async def _wait_for_silence(listener: PortListener, times: ProbeTimes) -> bool:
    """Wait until the port has been silent for the required time; return False if that takes too long."""
    end = listener.now() + times.silence_timeout
    while listener.quiet_seconds < times.required_silence:
        if has_nmea_sentence(listener.received) or listener.now() > end:
            return False
        await listener.wait_briefly()
    return True


async def _listen(listener: PortListener, seconds: float, get_verdict: Callable[[], str | None]) -> str | None:
    """Listen until ``get_verdict`` returns a verdict, and return that; None on timeout."""
    end = listener.now() + seconds
    while listener.now() < end:
        await listener.wait_briefly()
        verdict = get_verdict()
        if verdict is not None:
            return verdict
    return None


DEFAULT_BAUD = 9600
#: The other rates that a Meade can be set to (LX200 protocol, :SB; its 56.7K is 57600), and 115200 for newer devices;
#: the likeliest first. 4800 and 2400 baud come last, after another try at 9600: a hand control that was only slow to
#: start listens at 9600, and would read ACK or Kx at these rates as ``x``, its command to hibernate.
OTHER_BAUD_RATES = (19200, 38400, 57600, 115200, 1200, 14400, 28800, DEFAULT_BAUD, 4800, 2400)
#: Seconds to listen at each baud rate to a device that sends unasked: a GPS receiver sends every second.
LISTENING_TIME = 1.6
#: Verdicts after which other rates are tried.
UNDECIDED_VERDICTS = (PortVerdict.SILENT, PortVerdict.GARBLED, PortVerdict.TALKER)
#: A port in use by a program, by this user's gateway, perhaps by another user's gateway; a mount behind a gateway.
BUSY, SERVED, FOREIGN, OFFERED = "busy", "served", "foreign", "offered"
#: The port could not be opened; it disappeared during the search; a mount answered but could not be identified.
UNOPENED, VANISHED, NO_ID = "unopened", "vanished", "mute"


class PortFinding(Struct, frozen=True):
    """The result for a port. ``state`` is a verdict, a mount's protocol, or one of the constants ``BUSY`` to ``NO_ID``;
    ``reason`` explains it. The search took ``seconds``.
    """

    port: SerialPortInfo
    state: str
    baud: int | None = None  # None: not examined, or the port has no baud setting
    reason: str = ""
    mount: FoundMount | None = None
    rates_tried: int = 0  # how many baud rates were tried
    seconds: float = 0.0


async def examine_ports(ports: Iterable[SerialPortInfo]) -> list[PortFinding]:
    """Examine several ports at the same time."""
    return await asyncio.gather(*(scan_port(place) for place in ports))


async def ask_servers(urls: Sequence[str] | None) -> list[PortFinding]:
    """Return the mounts and gateways behind network servers at these addresses; None asks the whole network."""
    mounts = []
    for spec in PROTOCOLS.values():
        for answer in await spec.find_mounts(urls) if spec.find_mounts is not None else []:
            place = SerialPortInfo(answer.url, answer.url, f"{spec.title}: {answer.server_name}")
            mount = FoundMount(
                spec.name, answer.product, "", "?", (), answer.seconds, "jnow", None, None,
                reports_model=False, reports_site=True, answered_commands={},
            )  # fmt: skip
            gateway = PortFinding(place, OFFERED, reason=answer.product)
            mounts.append(
                gateway if answer.is_gateway else PortFinding(place, spec.name, mount=mount, seconds=answer.seconds)
            )
    return mounts


async def scan_port(
    port: SerialPortInfo,
    transport: BaudTransport | None = None,
    first_times: ProbeTimes = AT_9600,
    other_times: ProbeTimes = AT_OTHERS,
) -> PortFinding:
    """Examine a port; the result reports problems. ``transport``, if given, is used instead of the port's URL."""
    if transport is None and (process := serving_gateway_pid(port.url)):
        return PortFinding(port, SERVED, reason=f"mount-gateway, process {process}")
    who = port_holder(port.url) if transport is None else ""
    if who:
        return PortFinding(port, BUSY, reason=f"in use by {who}")
    now = asyncio.get_running_loop().time
    began = now()
    listener = PortListener(transport or SerialTransport(port.url, DEFAULT_BAUD))
    try:
        await listener.open_port()
    except Exception as error:  # pyserial has more kinds of failure than OSError
        state = BUSY if getattr(error, "errno", None) == errno.EBUSY else UNOPENED
        if state == BUSY and (who := other_user_gateway()):
            return PortFinding(port, FOREIGN, reason=f"in use, {who}", seconds=now() - began)
        return PortFinding(port, state, reason=getattr(error, "strerror", None) or str(error), seconds=now() - began)
    try:
        verdict, baud, rates = await _probe_at_every_rate(listener, port, first_times, other_times)
        state, mount, reason = str(verdict), None, ""
        if state in PROTOCOLS:
            named = port.typed_endpoint if port.typed_endpoint and port.typed_endpoint.protocol == state else None
            model, version = (named.model, named.version) if named else (None, None)
            try:
                mount = await identify(state, listener, model, version)
            except Fault as fault:
                if listener.loss_reason:
                    raise OSError(listener.loss_reason) from None
                reason, state = f"speaks {state}, but did not say who it is: {fault}", NO_ID
            except OSError:
                raise
            except Exception as error:  # a defect in a driver must affect this port only
                reason, state = f"speaks {state}; internal error, please report it: {error!r}", NO_ID
        return PortFinding(port, state, baud if port.has_baud_setting else None, reason, mount, rates, now() - began)
    except OSError as error:
        return PortFinding(port, VANISHED, reason=str(error), seconds=now() - began)
    finally:
        await listener.close_port()


async def _probe_at_every_rate(
    listener: PortListener, port: SerialPortInfo, first_times: ProbeTimes, other_times: ProbeTimes
) -> tuple[str, int, int]:
    """Return the verdict, the baud rate and the number of rates tried. Raises OSError if the port disappears."""
    protocol = port.typed_endpoint.protocol if port.typed_endpoint else None
    verdict, baud, rates = await probe(listener, first_times, protocol), DEFAULT_BAUD, 1
    if not port.has_baud_setting or verdict not in UNDECIDED_VERDICTS:
        return verdict, baud, rates
    talks, garbled = verdict == PortVerdict.TALKER, verdict == PortVerdict.GARBLED
    for baud in OTHER_BAUD_RATES:
        try:
            listener.change_baud(baud)
        except OSError:
            await listener.wait_briefly()
            continue  # a rate that this port does not have
        rates += baud != DEFAULT_BAUD
        verdict = await (listen_for_gps(listener, LISTENING_TIME) if talks else probe(listener, other_times, protocol))
        if verdict not in UNDECIDED_VERDICTS:
            return verdict, baud, rates
        garbled = garbled or verdict == PortVerdict.GARBLED
    return PortVerdict.TALKER if talks else PortVerdict.GARBLED if garbled else PortVerdict.SILENT, DEFAULT_BAUD, rates


async def answering_protocol(url: str, baud: int) -> str | None:
    """Return the protocol of the mount that answers at this baud rate, or None."""
    listener = PortListener(SerialTransport(url, baud))
    try:
        await listener.open_port()
    except OSError:
        return None
    try:
        verdict = await probe(listener, AT_9600)
    except OSError:
        return None
    finally:
        await listener.close_port()
    return verdict if verdict in PROTOCOLS else None
