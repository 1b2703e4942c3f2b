"""How the report looks, by day and by night as the reader's system asks for it. Nothing is fetched from anywhere."""

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
.bar { fill: var(--track) } .bar.longer { fill: var(--refusal) }
@media print { body { background: none } section { break-inside: avoid } }
"""
