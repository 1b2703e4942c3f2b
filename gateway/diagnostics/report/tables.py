"""Tables of the report: programs and their commands, what was refused, what was noted. All words are escaped."""

from __future__ import annotations

import html
from collections.abc import Sequence

from gateway.diagnostics.report.night import Night, Remark
from gateway.diagnostics.report.svg import clock

#: Commands that are named of each program, and rows of what was refused or noted.
NAMED, ROWS = 8, 200


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Cells are HTML already."""
    head = "".join(f'<th scope="col">{html.escape(word)}</th>' for word in heads)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def programs(night: Night) -> str:
    """The busiest first."""
    rows = []
    busiest = max((program.sent for program in night.programs.values()), default=1) or 1
    for program in sorted(night.programs.values(), key=lambda one: -one.sent):
        named = [f"<b>{html.escape(name)}</b> {times:,}" for name, times in program.commands.most_common(NAMED)]
        more = len(program.commands) - NAMED
        share = program.sent / busiest * 100.0
        rows.append([
            html.escape(program.host), html.escape(program.surface),
            f"{clock(program.first)}–{clock(program.last)}", f"{program.connections:,}",
            f'<span class="share" style="--share:{share:.1f}%">{program.sent:,}</span>', f"{program.per_minute:,.0f}",
            f"{program.refused:,}", " · ".join(named) + (f" · {more} others" if more > 0 else ""),
        ])  # fmt: skip
    heads = ("host", "surface", "time", "connections", "commands", "a minute", "refused", "which ones")
    return table(heads, rows) if rows else "<p>No program was connected.</p>"


def remarks(found: Sequence[Remark], none: str, of_programs: bool) -> str:
    """The same words once, with how often and when first and last; the most frequent first."""
    same: dict[tuple[str, str], list[float]] = {}
    for remark in found:
        same.setdefault((remark.words, remark.who), []).append(remark.time)
    if not same:
        return f"<p>{html.escape(none)}</p>"
    rows = []
    for (words, who), times in sorted(same.items(), key=lambda item: -len(item[1]))[:ROWS]:
        when = clock(times[0], seconds=True)
        when += f" – {clock(times[-1], seconds=True)}" if len(times) > 1 else ""
        rows.append([f"{len(times):,} ×", when, *([html.escape(who)] if of_programs else []), html.escape(words)])
    heads = ("how often", "when", *(["to whom"] if of_programs else []), "what")
    left = f"<p>{len(same) - ROWS:,} others are not shown.</p>" if len(same) > ROWS else ""
    return table(heads, rows) + left
