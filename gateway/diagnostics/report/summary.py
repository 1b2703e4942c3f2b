"""The night in words: a few sentences that say what is in the plots."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime

from gateway.diagnostics.report.answer_plots import at
from gateway.diagnostics.report.night import Night
from gateway.diagnostics.report.sky_plots import Seen
from gateway.diagnostics.report.svg import clock


def title(night: Night) -> str:
    """The day on which it began, UTC."""
    return f"The night of {datetime.fromtimestamp(night.began, UTC):%d %B %Y}".replace(" 0", " ")


def sentences(night: Night, seen: list[Seen]) -> list[str]:
    """What happened, the most important first."""
    return [
        f"From {clock(night.began)} to {clock(night.ended)} UTC, {_lasting(night.ended - night.began)}, with the mount "
        f"{night.mount}.",
        _pointing(night, seen),
        _answering(night),
        _programs(night),
        _refusals(night),
        _remarks(night),
        *([f"The recording is not whole: {night.cut}."] if night.cut else []),
    ]


def _lasting(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"


def counted(number: int, thing: str) -> str:
    """``1 program``, ``1,200 commands``."""
    return f"{number:,} {thing}{'s' * (number != 1)}"


def _pointing(night: Night, seen: list[Seen]) -> str:
    if not night.pointings:
        return "The mount never told where it pointed."
    gotos = f"It was sent to {counted(night.gotos, 'place')}" if night.gotos else "It was sent nowhere"
    if not seen:
        return f"{gotos}. Neither the settings nor the mount tell a site, so altitudes are not known."
    lowest, highest = min(place.alt for place in seen), max(place.alt for place in seen)
    return f"{gotos}; the telescope was between {lowest:.0f}° and {highest:.0f}° high."


def _answering(night: Night) -> str:
    if not night.took:
        return "The mount answered nothing."
    times = sorted(night.took)
    lost = f"; {counted(night.unanswered, 'question')} had no answer" if night.unanswered else ""
    every = "" if lost or len(times) == 1 else "all "
    return (
        f"The mount answered {every}{counted(len(times), 'question')}{lost}. It took {_ms(at(0.5, times))} as a rule, "
        f"{_ms(at(0.99, times))} or less 99 times in 100, {_ms(times[-1])} at worst."
    )


def _ms(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 10.0 else f"{seconds * 1000.0:.0f} ms"


def _programs(night: Night) -> str:
    sent = sum(program.sent for program in night.programs.values())
    if not night.programs:
        return "No program was connected."
    return f"{counted(len(night.programs), 'program')} sent {counted(sent, 'command')}."


def _refusals(night: Night) -> str:
    if not night.refusals:
        return "Nothing was refused."
    [(words, times)] = Counter(remark.words for remark in night.refusals).most_common(1)
    often = f", {'all of them' if times == len(night.refusals) else f'{times:,} of them'} because" if times > 1 else ":"
    were = "was" if len(night.refusals) == 1 else "were"
    return f"{counted(len(night.refusals), 'thing')} {were} refused{often} “{words}”."


def _remarks(night: Night) -> str:
    if not night.remarks:
        return "The gateway had nothing to say about the mount or its line."
    listed = "it is" if len(night.remarks) == 1 else "they are"
    noted = counted(len(night.remarks), "thing")
    return f"The gateway noted {noted} about the mount and its line; {listed} listed below."
