"""Play evenings and attacks, print their tables.

python -m tests.support.instrument evenings [--slip right …] [--gotos 200] [--lowest 15] [--park] [--without RULE]
python -m tests.support.instrument attacks [--only WORDS] [--kinds 6] [--without RULE]
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
from tests.support.instrument.evening import Told, cells, evening, prepare
from tests.support.instrument.rules import SWITCHES, without
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
    parser.add_argument("what", choices=("evenings", "attacks"))
    parser.add_argument("--slip", action="append", choices=SLIPS)
    parser.add_argument("--gotos", type=int, default=180)
    parser.add_argument("--lowest", type=float)
    parser.add_argument("--park", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--kinds", type=int, default=6, help="on how many kinds of mount each attack is tried")
    parser.add_argument("--without", choices=SWITCHES)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    prepare()
    with without(chosen.without):
        (evenings if chosen.what == "evenings" else assaults)(chosen)


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


def assaults(chosen: argparse.Namespace) -> None:
    print("| attack | runs | through | where |\n|---|---|---|---|")
    every: list[Result] = []
    for number, one in enumerate(one for one in attacks() if chosen.only in one.name):
        first = (number + chosen.seed * chosen.kinds) % len(one.kinds)
        tried = (one.kinds * 2)[first : first + min(chosen.kinds, len(one.kinds))]
        rows = [run(assault(one, kind, chosen.seed + place + number)) for place, kind in enumerate(tried)]
        through, every = [row for row in rows if row.through], [*every, *rows]
        print(f"| {one.name} | {len(rows)} | {len(through)} | {', '.join(map(str, through))} |", flush=True)
    print(f"| all | {len(every)} | {sum(bool(row.through) for row in every)} | |")


if __name__ == "__main__":
    main()
