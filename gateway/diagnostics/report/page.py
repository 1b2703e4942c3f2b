"""The report as one HTML file: words first, then plots, then tables. It needs no script and no other file."""

from __future__ import annotations

import html

from gateway.astro.ephemeris.sky import Sky
from gateway.diagnostics.report import answer_plots, sky_plots, summary, tables
from gateway.diagnostics.report.night import Night
from gateway.diagnostics.report.over_horizon import light, track
from gateway.diagnostics.report.style import STYLE


def page(night: Night, source: str) -> str:
    """``source`` is the recording's name."""
    sky = Sky()  # its closed forms are good to a second of arc
    seen = track(night, sky)
    said = "".join(f"<p>{html.escape(words)}</p>" for words in summary.sentences(night, seen))
    site = (
        f", {night.site.latitude:.2f}°, {night.site.longitude:.2f}° as {night.site.source} told" if night.site else ""
    )
    parts = [_section("", "", f'<div class="summary">{said}</div>')]
    if seen:
        parts.append(_section(
            "Where it pointed", "North is up and east is left, as one looks up. The thick line: it tracked or rested; "
            "the thin one: it was on its way.", f'<div class="round">{sky_plots.all_sky(seen, night)}</div>',
        ))  # fmt: skip
        parts.append(_section(
            "How high it pointed", "Behind the line: day, twilight, darkness. Triangles: a program was refused "
            "something. Dashed: the limits.", _wide(sky_plots.altitude(seen, light(night, sky), night)),
        ))  # fmt: skip
    if night.took:
        parts.append(_section(
            "How long the mount took to answer", "The line is the middle one of the answers, the band nine of ten, "
            "dots are the longest. Red: something was noted about the mount or its line.",
            _wide(answer_plots.over_time(night)),
        ))  # fmt: skip
        parts.append(_section("How often it took how long", "", _wide(answer_plots.histogram(night))))
    parts += [
        _section("Programs", "", tables.programs(night)),
        _section("Refused", "", tables.remarks(night.refusals, "Nothing was refused.", of_programs=True)),
        _section(
            "Noted about the mount and its line", "", tables.remarks(night.remarks, "Nothing.", of_programs=False)
        ),
    ]
    title = summary.title(night)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
        f'<h1>{html.escape(title)}</h1>\n<p class="from">{html.escape(source)}{html.escape(site)}. Times are UTC.</p>\n'
        + "\n".join(parts)
        + "\n</main>\n</body>\n</html>\n"
    )


def _wide(plot: str) -> str:
    """On a phone it is as wide as its words need, and scrolls."""
    return f'<div class="wide">{plot}</div>'


def _section(title: str, note: str, content: str) -> str:
    head = f"<h2>{html.escape(title)}</h2>" if title else ""
    return f'<section>{head}{f"""<p class="note">{html.escape(note)}</p>""" if note else ""}{content}</section>'
