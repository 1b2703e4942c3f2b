"""Examine one port, from opening to closing; all ports are examined at the same time.

9600 baud comes first. Other rates are tried only if nothing was received at 9600, or if the bytes may have been sent at
another rate.
"""

from __future__ import annotations

import asyncio
import errno
from collections.abc import Iterable

from msgspec import Struct

from gateway.core.errors import Fault
from gateway.diagnostics.detect.identify import Mount, identify
from gateway.diagnostics.detect.port_listener import PortListener, Tunable
from gateway.diagnostics.detect.ports import SerialPortInfo, holder, serving_gateway
from gateway.diagnostics.detect.probe import AT_9600, ELSEWHERE, Patience, Verdict, overhear, probe
from gateway.protocols.registry import PROTOCOLS
from gateway.transport.wires import SerialTransport

USUAL = 9600
#: The other rates that a Meade can be set to (LX200 protocol, :SB; its 56.7K is 57600), and 115200 for newer devices;
#: the likeliest first. At 4800 and 2400 baud a query could harm a hand control that was only slow to start: at its 9600
#: it would read ACK, or Kx, as ``x``, hibernate. These rates come last, and 9600 is tried again before them.
OTHERS = (19200, 38400, 57600, 115200, 1200, 14400, 28800, USUAL, 4800, 2400)
#: Seconds to listen at each rate to a device that sends by itself: a GPS receiver sends every second.
EAVESDROP = 1.6
#: Verdicts after which other rates are tried.
OPEN = (Verdict.SILENT, Verdict.GARBLED, Verdict.TALKER)
#: Another program has the port; and that program is a gateway.
BUSY, SERVED = "busy", "served"
UNOPENED, VANISHED, MUTE = "unopened", "vanished", "mute"


class Finding(Struct, frozen=True):
    """The result for one port. ``state`` is a verdict, or why there is none: ``served``, ``busy``, ``unopened``,
    ``vanished``, or ``mute`` (it speaks a mount's protocol but could not be identified). ``reason`` says more; it took
    ``seconds``."""

    place: SerialPortInfo
    state: str
    baud: int | None = None
    reason: str = ""
    mount: Mount | None = None
    rates: int = 0
    seconds: float = 0.0


async def look_at_all(places: Iterable[SerialPortInfo]) -> list[Finding]:
    """Examine several ports at the same time."""
    return await asyncio.gather(*(look(place) for place in places))


async def look(
    place: SerialPortInfo, wire: Tunable | None = None, first: Patience = AT_9600, others: Patience = ELSEWHERE
) -> Finding:
    """Examine one port; problems with it are part of the result. ``wire`` replaces the port of a pyserial URL."""
    if wire is None and (process := serving_gateway(place.url)):
        return Finding(place, SERVED, reason=f"mount-gateway, process {process}")
    who = holder(place.url) if wire is None else ""
    if who:
        return Finding(place, BUSY, reason=f"in use by {who}")
    now = asyncio.get_running_loop().time
    began = now()
    ear = PortListener(wire or SerialTransport(place.url, USUAL))
    try:
        await ear.begin()
    except Exception as error:  # pyserial has more kinds of failure than OSError
        state = BUSY if getattr(error, "errno", None) == errno.EBUSY else UNOPENED
        return Finding(place, state, reason=getattr(error, "strerror", None) or str(error), seconds=now() - began)
    try:
        verdict, baud, rates = await _at_every_rate(ear, place, first, others)
        state, mount, reason = str(verdict), None, ""
        if state in PROTOCOLS:
            named = place.named if place.named and place.named.protocol == state else None
            model, version = (named.model, named.version) if named else (None, None)
            try:
                mount = await identify(state, ear, model, version)
            except Fault as fault:
                if ear.lost:
                    raise OSError(ear.lost) from None
                reason, state = f"speaks {state}, but did not say who it is: {fault}", MUTE
            except OSError:
                raise
            except Exception as error:  # a defect in a driver must affect this port only
                reason, state = f"speaks {state}; internal error, please report it: {error!r}", MUTE
        return Finding(place, state, baud if place.has_rates else None, reason, mount, rates, now() - began)
    except OSError as error:
        return Finding(place, VANISHED, reason=str(error), seconds=now() - began)
    finally:
        await ear.end()


async def _at_every_rate(
    ear: PortListener, place: SerialPortInfo, first: Patience, others: Patience
) -> tuple[str, int, int]:
    """Return the verdict, the baud rate and the number of rates tried. Raises OSError if the port disappears."""
    protocol = place.named.protocol if place.named else None
    verdict, baud, rates = await probe(ear, first, protocol), USUAL, 1
    if not place.has_rates or verdict not in OPEN:
        return verdict, baud, rates
    talks, garbled = verdict == Verdict.TALKER, verdict == Verdict.GARBLED
    for baud in OTHERS:
        try:
            ear.tune(baud)
        except OSError:
            await ear.tick()
            continue  # a rate that this port does not have
        rates += baud != USUAL
        verdict = await (overhear(ear, EAVESDROP) if talks else probe(ear, others, protocol))
        if verdict not in OPEN:
            return verdict, baud, rates
        garbled = garbled or verdict == Verdict.GARBLED
    return Verdict.TALKER if talks else Verdict.GARBLED if garbled else Verdict.SILENT, USUAL, rates


async def who_answers(url: str, baud: int) -> str | None:
    """Return the protocol of the mount that answers at this rate, or None if none does."""
    ear = PortListener(SerialTransport(url, baud))
    try:
        await ear.begin()
    except OSError:
        return None
    try:
        verdict = await probe(ear, AT_9600)
    except OSError:
        return None
    finally:
        await ear.end()
    return verdict if verdict in PROTOCOLS else None
