"""``doctor``: checks this computer, and says what to do about everything that could keep a gateway from working.

Exit code 0 if nothing needs to be repaired, 1 if something does.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from gateway.cli.command_line import Commands
from gateway.core.about import full_version

if TYPE_CHECKING:
    from gateway.diagnostics.doctor.facts import CheckResult

EXAMPLES = """\
Examples:
  mount-gateway doctor
  mount-gateway doctor --json > report.json      for a report
"""


def add_doctor(commands: Commands) -> None:
    doctor = commands.add_parser(
        "doctor",
        description="Checks Python and its packages, serial ports and their permissions, programs that disturb "
        "them, the clock, the age of the astronomy data, TCP ports, the state folder and running gateways. It opens "
        "no serial port and changes nothing. Exit code 0: no problem was found, 1: a "
                    "problem.",
        epilog=EXAMPLES,
    )  # fmt: skip
    doctor.add_argument("--json", action="store_true", help="print JSON: one object, with a list of all checks")
    doctor.add_argument("--state", metavar="PATH", help="the state folder of the gateway")
    doctor.add_argument("--almanac", metavar="FILE", help="the almanac of a gateway without astropy")
    doctor.set_defaults(run=_run_doctor)


def _run_doctor(arguments: argparse.Namespace) -> int:
    import json

    import msgspec

    from gateway.diagnostics.doctor.checks import run_checks
    from gateway.diagnostics.doctor.facts import BAD
    from gateway.diagnostics.doctor.gathering import gather_facts

    results = run_checks(gather_facts(arguments.state, arguments.almanac))
    well = all(result.state != BAD for result in results)
    if arguments.json:
        output = {"version": full_version(), "good": well, "checks": msgspec.to_builtins(results)}
        print(json.dumps(output, indent=2))
    else:
        print("\n".join(result_lines(results)))
    return 0 if well else 1


def result_lines(results: Sequence[CheckResult]) -> list[str]:
    """Return the results as lines for the user, followed by the number of problems and of notes."""
    from gateway.diagnostics.doctor.facts import BAD, NOTE

    output: list[str] = []
    for result in results:
        state = result.state.upper() if result.state == BAD else result.state
        output.append(f"{state:<5} {result.check:<10} {result.found}")
        if result.do:
            output.append(f"{'':<16} -> {result.do}")
    bad, notes = (sum(result.state == state for result in results) for state in (BAD, NOTE))
    output.append("")
    output.append(f"{bad or 'nothing'} to mend{f', {notes} to know' if notes else ''}")
    return output
