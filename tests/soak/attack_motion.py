"""Attacks on motion: gotos of one axis, lost tracking, lost stops, vanished clients, positions that are wrong."""

from __future__ import annotations

import time
from functools import partial

from tests.soak.attack_limits import AUTOSTAR, FORK, GERMAN, MEADE, Attack, goto
from tests.soak.attacked import Attacked

SEVERAL = (FORK, GERMAN, MEADE)
PULSING = "nexstar:avx/5.31"
#: Seconds in motion after a stop: coasting and one position reading; if the first stop was lost, until the next one.
SOON, AGAIN = ("after the stop", None, 3.0), ("after the stop", None, 9.0)
ARRIVES = ("off", None, 0.2)
#: Arcseconds a minute by which the drift on the sky may change.
AS_BEFORE = ("drift", None, 3.0)
FREE = ("--lowest", "0")

# --- a goto moves both axes or none -----------------------------------------------------------------------------------


def during_a_goto(order: bytes, at: Attacked) -> dict[str, float]:
    """Send something that must not affect a goto, in the middle of one."""
    program = at.program()
    place = at.at_hour_angle(-30.0), 20.0
    at.begin()
    goto(program, *place)
    time.sleep(1.2)
    program.ask(order, 0.5)
    at.rests(45.0)
    return {"off": at.off(*place)}


def halted_goto(order: bytes, at: Attacked) -> None:
    """Stop one axis, or send another stop command: either ends a goto as a whole."""
    program = at.program()
    at.begin()
    goto(program, at.at_hour_angle(-30.0), 20.0)
    time.sleep(1.5)
    at.stopped()
    program.ask(order, 0.5)
    at.rests()


def halted_arrow(order: bytes, at: Attacked) -> None:
    program = at.program()
    at.begin()
    program.tell(b":RM#:Me#")
    time.sleep(2.0)
    at.stopped()
    program.ask(order, 0.5)
    at.rests()


def arrow_goto_release(at: Attacked) -> dict[str, float]:
    program = at.program()
    place = at.at_hour_angle(-30.0), 20.0
    at.begin()
    program.tell(b":RM#:Me#")
    time.sleep(1.0)
    goto(program, *place)
    time.sleep(0.8)
    program.tell(b":Qe#")
    at.rests(45.0)
    return {"off": at.off(*place)}


GOTOS = [
    *(Attack("half gotos", f"`{order.decode()}` during a goto", SEVERAL, partial(during_a_goto, order), ARRIVES, FREE)
      for order in (b":TL#", b":ST60.0#", b":Mge500#", b":Mgn500#")),
    *(Attack("half gotos", f"`{order.decode()}` during a goto", SEVERAL, partial(halted_goto, order), SOON, FREE)
      for order in (b":Qe#", b":Qn#", b":I#")),
    Attack("half gotos", "arrow, goto, release of the arrow", SEVERAL, arrow_goto_release, ARRIVES, FREE),
    Attack("lost ends", "`:I#` during an arrow", SEVERAL, partial(halted_arrow, b":I#"), SOON, FREE),
]  # fmt: skip

# --- tracking is preserved --------------------------------------------------------------------------------------------


def tracks_on(rate: bytes, work: bytes, seconds: float, end: bytes, at: Attacked) -> dict[str, float]:
    """Measure the drift on the true sky, before and after something that only suspends tracking."""
    program = at.program()
    goto(program, at.at_hour_angle(-20.0), 30.0)
    at.rests(40.0)
    program.ask(rate, 1.0)
    time.sleep(1.0)
    at.begin()
    before = at.drift()
    if work == b":MS#":
        goto(program, at.at_hour_angle(-25.0), 32.0)
    else:
        program.ask(work, 0.3)
    time.sleep(seconds)
    program.ask(end, 0.3)
    program.poll(8.0)
    return {"drift": abs(at.drift() - before)}


_WORK = {
    "a pulse": (b":Mge500#", 1.0, b""), "a guide arrow": (b":RG#:Mw#", 1.5, b":Qw#"),
    "an arrow": (b":RC#:Me#", 1.5, b":Qe#"), "a goto": (b":MS#", 6.0, b""), "sleep and waking": (b":hN#", 4.0, b":hW#"),
}  # fmt: skip
TRACKING = [
    *(Attack("tracking", f"the Moon's rate after {name}", (GERMAN,), partial(tracks_on, b":ST57.9#", *work), AS_BEFORE,
             (*FREE, "--hibernate")) for name, work in _WORK.items()),
    *(Attack("tracking", f"the stars' after {name}", (FORK, MEADE), partial(tracks_on, b":TQ#", *work), AS_BEFORE, FREE)
      for name, work in _WORK.items() if name not in ("sleep and waking", "a pulse")),
]  # fmt: skip

# --- stops that are lost ----------------------------------------------------------------------------------------------


def lost(begin: bytes, end: bytes, swallowed: tuple[bytes, ...], at: Attacked) -> None:
    """Lose the first stop on the line, while programs poll."""
    program, other = at.program(), at.program()
    at.begin()
    if begin:
        program.tell(begin)
    else:
        goto(program, at.at_hour_angle(-30.0), 20.0)
    time.sleep(2.0)
    at.relay.swallow(*swallowed)
    at.stopped()
    program.tell(end)
    other.poll(15.0)


def pulse_is_over(end: bytes, at: Attacked) -> None:
    """Start a motor's own pulse of three seconds, and stop it after half a second."""
    program = at.program()
    at.begin()
    program.tell(b":Mgn3000#")
    time.sleep(0.5)
    at.stopped()
    program.tell(end)
    time.sleep(5.0)


def backlog(at: Attacked) -> None:
    """One client sends a megabyte of direction keys and disconnects; eight seconds later another client stops."""
    flood, program = at.program(), at.program()
    at.begin()
    flood.link.setblocking(False)
    left, end = memoryview(b":RM#:Me#" * 125_000), time.monotonic() + 8.0
    while left and time.monotonic() < end:
        try:
            left = left[flood.link.send(left) :]
        except BlockingIOError:
            time.sleep(0.05)
        except OSError:
            break
    flood.link.close()
    time.sleep(max(0.0, end - time.monotonic()))
    at.stopped()
    program.tell(b":Q#")
    program.poll(20.0)


_NEXSTAR_ENDS = (b"M", b"P\x02\x10\x24\0", b"P\x02\x11\x24\0", b"PUT /api/v1/telescope/0/abortslew")
STOPS = [
    *(Attack("lost ends", f"one lost `:Q#`, {name}", (MEADE, AUTOSTAR, "lx200:lx200"), partial(lost, begin, b":Q#",
      (b":Q#",)), AGAIN, FREE) for name, begin in {"arrow": b":RS#:Me#", "goto": b""}.items()),
    Attack("lost ends", "one lost `:Qe#`", (MEADE, AUTOSTAR), partial(lost, b":RS#:Me#", b":Qe#", (b":Qe#",)), AGAIN,
           FREE),
    Attack("lost ends", "one lost stop of a NexStar, arrow", (FORK, GERMAN), partial(lost, b":RS#:Me#", b":Q#",
           _NEXSTAR_ENDS), AGAIN, FREE),
    *(Attack("lost ends", f"the rest of a motor's pulse after `{end.decode()}`", (PULSING,),
             partial(pulse_is_over, end), ("after the stop", None, 0.7), FREE) for end in (b":Qn#", b":Q#")),
    Attack("clients that are gone", "1 MB of arrows waits, `:Q#` of another", (FORK, MEADE), backlog, SOON, FREE),
]  # fmt: skip

# --- clients that vanish, cables that are pulled out, positions that are wrong ----------------------------------------


def dead_man(at: Attacked) -> None:
    """Kill the program while another one on the same computer polls."""
    program, other = at.program(), at.program()
    at.begin()
    other.poll(1.0)
    program.tell(b":RS#:Me#")
    other.poll(2.0)
    at.stopped()
    program.reset()
    other.poll(40.0, every=1.0)


def cable(at: Attacked) -> None:
    """Pull the cable out for four seconds during a manual motion: the mount must stand still afterwards."""
    program = at.program()
    at.begin()
    program.tell(b":RM#:Me#")
    program.poll(2.0)
    at.relay.cut(4.0)
    program.poll(4.0)
    at.stopped()
    program.poll(20.0)


def stuck(at: Attacked) -> None:
    """Freeze the position that the mount reports, then move down by direction key."""
    program = at.program()
    program.poll(2.0)
    at.begin()
    at.relay.freeze(b"e", b"z", b"E", b"Z", b"P\x01\x10\x01", b"P\x01\x11\x01", b":GR#", b":GD#", b":GA#", b":GZ#",
                    *(b"GET /api/v1/telescope/0/" + name for name in (b"devicestate", b"right", b"decl")))  # fmt: skip
    program.tell(b":RS#:Ms#")
    program.poll(22.0)


GONE = [
    Attack("clients that are gone", "a killed program's arrow while another polls", (FORK, MEADE), dead_man,
           ("after the stop", None, 8.0), FREE),
    Attack("blind", "cable out for 4 s during an arrow: seconds in motion when it is back", (FORK, MEADE), cable,
           ("after the stop", None, 9.0), FREE),
    # Only time shows that the position is stuck: four seconds at a Meade's 8 degrees a second.
    Attack("blind", "a stuck position, arrow down, `lowest` 20", (FORK, MEADE), stuck, ("altitude", 45.0 - 32.0, None),
           ("--lowest", "20")),
]  # fmt: skip

MOTION = [*GOTOS, *TRACKING, *STOPS, *GONE]
