"""Play evenings and attacks, print their tables.

python -m tests.support.instrument evenings [--slip right …] [--gotos 200] [--lowest 15] [--park] [--without RULE]
python -m tests.support.instrument attacks [--only WORDS] [--kinds 6] [--without RULE]
python -m tests.support.instrument rules [--only WORDS] [--kinds 6] [--json EVENINGS]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from msgspec import json

from gateway.diagnostics.virtual_time import run
from tests.support.instrument.attacks import Result, assault, attacks
from tests.support.instrument.evening import Told, cells, evening
from tests.support.instrument.rules import RULES, without
from tests.support.instrument.worlds import SLIPS


def share(told: list[Told], measure: str) -> str:
    """Return how many harmless gotos are lost, of how many."""
    lost = sum(one.lost and getattr(one, measure) for one in told)
    return f"{lost}/{len(told)} {100.0 * lost / len(told):.1f}%" if told else "-"


def by_slip(told: list[Told]) -> Iterator[str]:
    """Yield the rows of a table: harmless gotos that are lost, by slip, night and day, above and below 12 degrees."""
    for measure in ("old", "new"):
        heads = [f"{when} {where}" for when in ("night", "day") for where in (">12°", "<12°")]
        yield f"\n| {measure} | {' | '.join(heads)} | no source has the Sun up | one has |"
        yield f"|---|{'---|' * 6}"
        for up, slip in ((up, slip) for up in (True, False) for slip in SLIPS):
            rows = [one for one in told if one.slip == slip and one.up is up]
            if rows:
                cell = [[one for one in rows if one.day is day and one.low is low]
                        for day in (False, True) for low in (False, True)]  # fmt: skip
                cell += [[one for one in rows if one.lit is lit] for lit in (False, True)]
                shown = " | ".join(share(one, measure) for one in cell)
                yield f"| {slip}{'' if up else ', down by the mount'} | {shown} |"


def by_kind_and_rule(told: list[Told]) -> Iterator[str]:
    yield "\n| kind | night: n, refused, short, harmless old, new | day |\n|---|---|---|"
    for kind in dict.fromkeys(one.kind for one in told):
        parts = []
        for day in (False, True):
            rows = [one for one in told if one.kind == kind and one.day is day]
            outcomes = Counter(one.outcome for one in rows)
            lost = [sum(one.lost and getattr(one, measure) for one in rows) for measure in ("old", "new")]
            parts.append(f"{len(rows)}, {outcomes['refused']}, {outcomes['short']}, {lost[0]}, {lost[1]}")
        yield f"| {kind} | {' | '.join(parts)} |"
    yield "\n| rule | lost | harmless old | harmless new |\n|---|---|---|---|"
    for rule, count in Counter(one.rule for one in told if one.lost).most_common():
        rows = [one for one in told if one.rule == rule and one.lost]
        yield f"| {rule} | {count} | {sum(one.old for one in rows)} | {sum(one.new for one in rows)} |"
    yield f"\nthrough: {dict(Counter(one.through for one in told if one.through))}, of {len(told)} gotos"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("evenings", "attacks", "rules"))
    parser.add_argument("--slip", action="append", choices=SLIPS)
    parser.add_argument("--gotos", type=int, default=180)
    parser.add_argument("--lowest", type=float)
    parser.add_argument("--park", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--kinds", type=int, default=6, help="on how many kinds of mount each attack is tried")
    parser.add_argument("--without", choices=RULES)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    with without(chosen.without):
        {"evenings": evenings, "attacks": assaults, "rules": rules}[chosen.what](chosen)


def evenings(chosen: argparse.Namespace) -> None:
    work = cells(chosen.slip or list(SLIPS), chosen.gotos, chosen.seed, chosen.lowest, chosen.park)
    began, told = time.process_time(), list[Told]()
    for number, one in enumerate(work):
        told += run(evening(*one))
        if number % 50 == 49:
            print(f"{number + 1} of {len(work)} evenings", file=sys.stderr, flush=True)
    if chosen.json:
        chosen.json.write_bytes(json.encode(told))
    print(f"{len(told)} gotos, {time.process_time() - began:.0f} s of this process")
    print("\n".join([*by_slip(told), *by_kind_and_rule(told)]))


def results(words: str, kinds: int, seed: int) -> Iterator[tuple[str, list[Result]]]:
    """Play each attack whose name has these words on some kinds of mount."""
    for number, one in enumerate(one for one in attacks() if words in one.name):
        first = (number + seed * kinds) % len(one.kinds)
        tried = (one.kinds * 2)[first : first + min(kinds, len(one.kinds))]
        yield one.name, [run(assault(one, kind, seed + place + number)) for place, kind in enumerate(tried)]


def assaults(chosen: argparse.Namespace) -> None:
    print("| attack | runs | through | where |\n|---|---|---|---|")
    every: list[Result] = []
    for name, rows in results(chosen.only, chosen.kinds, chosen.seed):
        through, every = [row for row in rows if row.through], [*every, *rows]
        print(f"| {name} | {len(rows)} | {len(through)} | {', '.join(map(str, through))} |", flush=True)
    print(f"| all | {len(every)} | {sum(bool(row.through) for row in every)} | |")


def rules(chosen: argparse.Namespace) -> None:
    """Switch off one rule after the other. ``--json`` names the evenings of before."""
    told = json.decode(chosen.json.read_bytes(), type=list[Told]) if chosen.json else []
    print("| rule | danger | attacks that it stops | harmless refusals | file |\n|---|---|---|---|---|")
    for name, rule in RULES.items():
        if chosen.only in name:
            with without(name):
                rows = [row for _, rows in results(rule.tried, chosen.kinds, chosen.seed) for row in rows]
            stops, lost = (
                sum(bool(row.through) for row in rows),
                sum(one.lost and one.new for one in told if one.rule == name),
            )
            print(
                f"| {name} | {rule.danger} | {stops} of {len(rows)} | {lost} of {len(told):,} | `{rule.file}` |",
                flush=True,
            )


if __name__ == "__main__":
    main()
