"""Play evenings and attacks, print their tables.

python -m tests.support.instrument attacks [--only WORDS] [--kinds 6] [--without RULE]
python -m tests.support.instrument rules [--only WORDS] [--kinds 6] [--gotos 180]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator

from gateway.diagnostics.virtual_time import run
from tests.support.instrument.attacks import Result, assault, attacks
from tests.support.instrument.evening import evenings
from tests.support.instrument.rules import RULES, without


def results(words: str, kinds: int, seed: int) -> Iterator[tuple[str, list[Result]]]:
    """Play each attack whose name has these words on some kinds of mount."""
    for number, one in enumerate(one for one in attacks() if words in one.name):
        first = (number + seed * kinds) % len(one.kinds)
        tried = (one.kinds * 2)[first : first + min(kinds, len(one.kinds))]
        yield one.name, [run(assault(one, kind, seed + place + number)) for place, kind in enumerate(tried)]


def assaults(chosen: argparse.Namespace) -> None:
    print("| attack | runs | through | where |\n|---|---|---|---|")
    with without(chosen.without):
        for name, rows in results(chosen.only, chosen.kinds, chosen.seed):
            through = [row for row in rows if row.through]
            print(f"| {name} | {len(rows)} | {len(through)} | {', '.join(map(str, through))} |", flush=True)


def rules(chosen: argparse.Namespace) -> None:
    """Switch off one rule after the other; count what each refuses in evenings that harm nothing."""
    told = [one for evening in evenings(chosen.gotos, chosen.seed) for one in run(evening)]
    lost = Counter(one.rule for one in told if one.lost and one.harmless)
    print("| rule | danger | attacks that it stops | harmless refusals | file |\n|---|---|---|---|---|")
    for name, rule in RULES.items():
        if chosen.only in name:
            with without(name):
                rows = [row for _, rows in results(rule.tried, chosen.kinds, chosen.seed) for row in rows]
            stops = f"{sum(bool(row.through) for row in rows)} of {len(rows)}"
            print(f"| {name} | {rule.danger} | {stops} | {lost[name]} of {len(told):,} | `{rule.file}` |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("attacks", "rules"))
    parser.add_argument("--gotos", type=int, default=180)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--kinds", type=int, default=6, help="on how many kinds of mount each attack is tried")
    parser.add_argument("--without", choices=RULES)
    chosen = parser.parse_args()
    {"attacks": assaults, "rules": rules}[chosen.what](chosen)


if __name__ == "__main__":
    main()
