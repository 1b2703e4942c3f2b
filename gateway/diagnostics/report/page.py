"""The report as one HTML file: text first, then plots, then tables. It needs no script and no other file.

It follows the light or dark setting of the reader's system. All text from the recording is escaped.
"""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime

from gateway.astro.ephemeris.sky import Sky
from gateway.diagnostics.report import plots
from gateway.diagnostics.report.night import Incident, Night
from gateway.diagnostics.report.plots import TrackPoint, altaz_track, light_intervals, quant
from gateway.diagnostics.report.svg import format_time_of_day

#: The greatest number of commands named for each program, and of rows in the tables of refusals and notes.
MAX_COMMANDS, MAX_ROWS = 8, 200


def report_page(night: Night, recording_name: str) -> str:
    """Return the report on a night as a complete HTML file."""
    sky = Sky()  # its closed forms are good to a second of arc
    points = altaz_track(night, sky)
    summary = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in summary_sentences(night, points))
    site = (
        f", {night.site.latitude:.2f}°, {night.site.longitude:.2f}° as {night.site.source} told" if night.site else ""
    )
    parts = [_html_section("", "", f'<div class="summary">{summary}</div>')]
    if points:
        parts.append(_html_section(
            "Where it pointed", "North is up and east is left, as you look up. Thick line: tracking or at rest. "
            "Thin line: slewing.", f'<div class="round">{plots.plot_all_sky(points, night)}</div>',
        ))  # fmt: skip
        parts.append(_html_section(
            "How high it pointed", "Behind the line: day, twilight, darkness. Triangles: refusals. Dashed: the "
            "limits.", _make_scrollable(plots.plot_altitude(points, light_intervals(night, sky), night)),
        ))  # fmt: skip
    if night.reply_times:
        parts.append(_html_section(
            "How long the mount took to answer", "Line: the median. Band: nine of ten replies. Dots: the longest. "
            "Red: a note about the mount or its connection.",
            _make_scrollable(plots.plot_reply_times(night)),
        ))  # fmt: skip
    parts += [
        _html_section("Programs", "", table_of_programs(night)),
        _html_section("Refused", "", table_of_remarks(night.refusals, "Nothing was refused.", with_client_column=True)),
        _html_section(
            "Notes about the mount and its connection",
            "",
            table_of_remarks(night.remarks, "Nothing.", with_client_column=False),
        ),
    ]
    heading, by = report_title(night), f" Recorded by mount-gateway {night.recorded_by}." if night.recorded_by else ""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(heading)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
        f"<h1>{html.escape(heading)}</h1>\n"
        f'<p class="from">{html.escape(recording_name)}{html.escape(site)}. Times are UTC.{html.escape(by)}</p>\n'
        + "\n".join(parts)
        + "\n</main>\n</body>\n</html>\n"
    )


def _make_scrollable(plot: str) -> str:
    """Wrap a plot so that it scrolls on a phone instead of becoming too small to read."""
    return f'<div class="wide">{plot}</div>'


def _html_section(title: str, note: str, content: str) -> str:
    head = f"<h2>{html.escape(title)}</h2>" if title else ""
    return f'<section>{head}{f"""<p class="note">{html.escape(note)}</p>""" if note else ""}{content}</section>'


def html_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return an HTML table; the cells are HTML already."""
    head = "".join(f'<th scope="col">{html.escape(word)}</th>' for word in headings)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def table_of_programs(night: Night) -> str:
    """Return an HTML table of the programs, the one with most commands first."""
    rows = []
    busiest = max((program.command_count for program in night.programs.values()), default=1) or 1
    for program in sorted(night.programs.values(), key=lambda listed: -listed.command_count):
        named = [f"<b>{html.escape(name)}</b> {times:,}" for name, times in program.commands.most_common(MAX_COMMANDS)]
        more = len(program.commands) - MAX_COMMANDS
        share = program.command_count / busiest * 100.0
        minutes = max((program.last_time - program.first_time) / 60.0, 1.0)
        rows.append([
            html.escape(program.host), html.escape(program.surface),
            f"{format_time_of_day(program.first_time)}–{format_time_of_day(program.last_time)}",
            f"{program.connection_count:,}",
            f'<span class="share" style="--share:{share:.1f}%">{program.command_count:,}</span>',
            f"{program.command_count / minutes:,.0f}", f"{program.refusal_count:,}",
            " · ".join(named) + (f" · {more} others" if more > 0 else ""),
        ])  # fmt: skip
    heads = ("host", "surface", "time", "connections", "commands", "a minute", "refused", "which ones")
    return html_table(heads, rows) if rows else "<p>No program was connected.</p>"


def table_of_remarks(remarks: Sequence[Incident], empty_text: str, with_client_column: bool) -> str:
    """Return an HTML table of remarks, the most frequent first; equal ones share a row: count, times, text."""
    same: dict[tuple[str, str], list[float]] = {}
    for remark in remarks:
        same.setdefault((remark.text, remark.client_name), []).append(remark.time)
    if not same:
        return f"<p>{html.escape(empty_text)}</p>"
    rows = []
    for (text, who), times in sorted(same.items(), key=lambda item: -len(item[1]))[:MAX_ROWS]:
        when = format_time_of_day(times[0], with_seconds=True)
        when += f" – {format_time_of_day(times[-1], with_seconds=True)}" if len(times) > 1 else ""
        rows.append([f"{len(times):,} ×", when, *([html.escape(who)] if with_client_column else []), html.escape(text)])
    heads = ("how often", "when", *(["to whom"] if with_client_column else []), "what")
    omitted_note = f"<p>{len(same) - MAX_ROWS:,} others are not shown.</p>" if len(same) > MAX_ROWS else ""
    return html_table(heads, rows) + omitted_note


def report_title(night: Night) -> str:
    """Return the title of the report, with the date on which the recording began, UTC."""
    return f"The night of {datetime.fromtimestamp(night.began, UTC):%d %B %Y}".replace(" 0", " ")


def summary_sentences(night: Night, points: list[TrackPoint]) -> list[str]:
    """Return sentences that summarise the night, the most important first."""
    return [
        f"From {format_time_of_day(night.began)} to {format_time_of_day(night.ended)} UTC, "
        f"{_format_duration(night.ended - night.began)}, with the mount {night.mount}.",
        _pointing_sentence(night, points),
        _reply_time_sentence(night),
        _programs_sentence(night),
        _refusals_sentence(night),
        _remarks_sentence(night),
        *([f"The recording is not whole: {night.cut_reason}."] if night.cut_reason else []),
    ]


def _format_duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"


def format_count(number: int, noun: str) -> str:
    """Format a count, as in ``1 program`` or ``1,200 commands``."""
    return f"{number:,} {noun}{'s' * (number != 1)}"


def _pointing_sentence(night: Night, points: list[TrackPoint]) -> str:
    if not night.pointings:
        return "The mount never reported its position."
    gotos = f"It was sent to {format_count(night.goto_count, 'place')}" if night.goto_count else "It received no goto"
    if not points:
        return f"{gotos}. The site is not known, and so are altitudes."
    lowest, highest = min(place.alt for place in points), max(place.alt for place in points)
    return f"{gotos}; the telescope was between {lowest:.0f}° and {highest:.0f}° high."


def _reply_time_sentence(night: Night) -> str:
    if not night.reply_times:
        return "The mount answered no question."
    times = sorted(night.reply_times)
    lost = f"; {format_count(night.unanswered_count, 'question')} had no answer" if night.unanswered_count else ""
    every = "" if lost or len(times) == 1 else "all "
    return (
        f"The mount answered {every}{format_count(len(times), 'question')}{lost}. "
        f"It took {_format_reply_time(quant(0.5, times))} as a rule, "
        f"{_format_reply_time(quant(0.99, times))} or less 99 times in 100, {_format_reply_time(times[-1])} at worst."
    )


def _format_reply_time(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 10.0 else f"{seconds * 1000.0:.0f} ms"


def _programs_sentence(night: Night) -> str:
    sent = sum(program.command_count for program in night.programs.values())
    if not night.programs:
        return "No program was connected."
    return f"{format_count(len(night.programs), 'program')} sent {format_count(sent, 'command')}."


def _refusals_sentence(night: Night) -> str:
    if not night.refusals:
        return "Nothing was refused."
    [(text, times)] = Counter(remark.text for remark in night.refusals).most_common(1)
    often = f", {'all of them' if times == len(night.refusals) else f'{times:,} of them'} because" if times > 1 else ":"
    were = "was" if len(night.refusals) == 1 else "were"
    return f"{format_count(len(night.refusals), 'thing')} {were} refused{often} “{text}”."


def _remarks_sentence(night: Night) -> str:
    if not night.remarks:
        return "The gateway noted nothing about the mount or its connection."
    listed = "it is" if len(night.remarks) == 1 else "they are"
    noted = format_count(len(night.remarks), "thing")
    return f"The gateway noted {noted} about the mount and its connection; {listed} listed below."


STYLE = """
:root { color-scheme: light dark; --paper: #f3f5f9; --card: #fff; --ink: #1a2233; --soft: #5b677e; --line: #dce2ec;
  --sky: #f6f8fc; --track: #1b63c9; --slew: #9aa9c4; --fault: #d0403f; --refusal: #b4690e; --band: #cfe0f8;
  --day: #fdf3d6; --twilight: #e8ecf8; --dark: #d5dcec; }
@media (prefers-color-scheme: dark) { :root { --paper: #0b101b; --card: #131a29; --ink: #e3e9f5; --soft: #93a0b8;
  --line: #253048; --sky: #0d1424; --track: #6da8ff; --slew: #4b5b7c; --fault: #ff7a73; --refusal: #ffb454;
  --band: #22385c; --day: #3a3420; --twilight: #1a2338; --dark: #101828; } }
* { box-sizing: border-box }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, -apple-system, "Segoe UI",
  Roboto, sans-serif; }
main { max-width: 1040px; margin: 0 auto; padding: 32px 20px 56px }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 4px; letter-spacing: -.01em }
h2 { font-size: 1.05rem; margin: 0 0 2px } p { margin: 0 0 8px }
.from, .note { color: var(--soft); font-size: .875rem }
.note { margin: 0 0 12px }
section { background: var(--card); border: 1px solid var(--line); border-radius: 12px; padding: 18px 20px;
  margin-top: 16px }
.summary p { margin: 0 0 4px; max-width: 76ch; overflow-wrap: anywhere }
.summary p:first-child { font-weight: 600 }
svg { display: block; width: 100%; height: auto }
.round svg { max-width: 560px; margin: 0 auto }
.wide { overflow-x: auto } .wide svg { min-width: 640px }
table { border-collapse: collapse; width: 100%; font-size: .875rem; font-variant-numeric: tabular-nums }
th { text-align: left; font-weight: 600; color: var(--soft); white-space: nowrap }
th, td { padding: 6px 14px 6px 0; border-bottom: 1px solid var(--line); vertical-align: top }
td { overflow-wrap: anywhere } td:not(:last-child) { white-space: nowrap } td:last-child { min-width: 16em }
tr:last-child td { border-bottom: 0 }
.share { display: block; padding: 0 6px; border-radius: 3px;
  background: linear-gradient(90deg, var(--band) var(--share), transparent var(--share)) }
text { fill: var(--ink); font: 12px system-ui, -apple-system, "Segoe UI", Roboto, sans-serif }
.tick { fill: var(--soft); font-size: 11px } .compass { font-size: 15px; font-weight: 650 }
.time { font-size: 11px; font-weight: 600; paint-order: stroke; stroke: var(--sky); stroke-width: 3px }
.grid { fill: none; stroke: var(--line) } .sky { fill: var(--sky); stroke: var(--soft); stroke-width: 1.5 }
.limit { fill: none; stroke: var(--refusal); stroke-dasharray: 5 4 }
.track { fill: none; stroke: var(--track); stroke-width: 2.5; stroke-linecap: round; stroke-linejoin: round }
.slew { fill: none; stroke: var(--slew); stroke-width: 1.25; stroke-linejoin: round }
.dot { fill: var(--track) } .day { fill: var(--day) } .twilight { fill: var(--twilight) } .dark { fill: var(--dark) }
.spread { fill: var(--band) } .middle { fill: none; stroke: var(--track); stroke-width: 1.5 }
.longest { fill: var(--slew) } .fault { stroke: var(--fault); stroke-width: 1.25 } .refusal { fill: var(--refusal) }
@media print { body { background: none } section { break-inside: avoid } }
"""
