"""Eight hours at the mount in a few minutes: nothing drifts, nothing grows. Standalone.

    python -m tests.soak.long_night [--hours 8] [--gotos 60] [--seed 1] [--plans 0 1 2 3]

Mount and gateway share one virtual clock in this process (``tests/support/night.py``): a program sets site and time,
polls every half to whole second, guides every two to three seconds if the mount can be guided, and sends sixty gotos;
it parks the mount at the end. Objects and resident memory are counted at every full hour.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import time

from gateway.diagnostics.virtual_time import run
from tests.benchmarks.memory import resident
from tests.support.night import PLANS, Plan, night

#: Permitted growth from the first to the last hour: objects (a deque that fills, a cache, up to 500 cancelled timers of
#: the virtual loop, each of two objects), and MiB.
OBJECTS, MEMORY = 1200, 1.0


def _spend(plan: Plan, hours: float, gotos: int, seed: int) -> bool:
    """Simulate a night and print its figures; return whether all was well."""
    counted: list[tuple[int, float]] = []

    def count() -> None:
        gc.collect()
        counted.append((len(gc.get_objects()), resident(os.getpid())))

    began = time.process_time()
    record = run(night(plan, hours * 3600.0, hours * 3600.0 / gotos, seed, count))
    first, last = counted[min(1, len(counted) - 1)], counted[-1]
    more, grown = last[0] - first[0], last[1] - first[1]
    print(
        f"{plan.presented} program on {plan.driven}:{plan.mount}: {record.polls} polls, {record.gotos} gotos, "
        f"{record.pulses} pulses; {len(record.wrong)} wrong, at worst {record.worst:.2f} units off; from the first "
        f"hour to the last {more:+d} objects, {grown:+.2f} MiB; {time.process_time() - began:.0f} s of processor"
    )
    print(*(f"  {words}\n" for words in record.wrong[:10]), sep="", end="", flush=True)
    return not record.wrong and more <= OBJECTS and grown <= MEMORY


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=8.0)
    parser.add_argument("--gotos", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plans", type=int, nargs="+", default=range(len(PLANS)), help="which of the four programs")
    arguments = parser.parse_args()
    well = [_spend(PLANS[number], arguments.hours, arguments.gotos, arguments.seed) for number in arguments.plans]
    print(f"seed {arguments.seed}: {arguments.hours:g} hours {'all well' if all(well) else 'NOT all well'}")
    return 0 if all(well) else 1


if __name__ == "__main__":
    sys.exit(main())
