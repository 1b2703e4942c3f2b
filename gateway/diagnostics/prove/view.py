"""The view of programs of the other protocol: the goto that such a program would order, in its own words."""

from __future__ import annotations

from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.diagnostics.prove.findings import DIFFERS, NOT_TRIED, SAME, Finding, Report
from gateway.diagnostics.prove.gotos import LONGEST, NEAR, near, stay_if_elsewhere
from gateway.diagnostics.prove.programs import Program
from gateway.diagnostics.prove.telescope import Ended, Telescope
from gateway.protocols.registry import other_surface
from gateway.protocols.wireformat.command_set import load


async def run(telescope: Telescope, report: Report) -> None:
    """Raises Ended."""
    presented = other_surface(telescope.driver.protocol.name)
    start = await telescope.rest()
    goal, refused = await near(telescope, start.sky)
    if goal is None:
        report.found(Finding(f"goto of a program ({presented})", NOT_TRIED, refused))
        return
    program = Program(telescope.gateway, presented)
    try:
        for number, to in enumerate((goal, start.sky)):
            report.progress(number, 2, f"goto of a program ({presented})")
            report.found(await _goto(telescope, program, to))
            stay_if_elsewhere(await telescope.look(), to)
    finally:
        program.close()


async def _goto(telescope: Telescope, program: Program, goal: op.Equatorial) -> Finding:
    what, commands = f"goto of a program ({program.protocol})", load(program.protocol).extra("prove.toml")["goto"]
    telescope.mine = True
    for order in commands["orders"]:
        heard = await program.ask(order, ra=goal.ra, dec=goal.dec)
        telescope.check()
        if heard is None:
            raise Ended("the goto was not acknowledged")
        if heard.fails:
            telescope.mine = False
            return Finding(what, NOT_TRIED, heard.words)
    end = telescope.now() + LONGEST
    while telescope.now() < end:
        heard = await program.ask(commands["tells"])
        if heard is not None and set(heard.fields.values()) & set(commands["over"]):
            break
        await telescope.until(lambda: False, 0.5)
    told = await program.values(*commands["position"])
    here = await telescope.rest()
    off = separation(told["ra"], told["dec"], goal.ra, goal.dec) if told.keys() >= {"ra", "dec"} else 180.0
    moved = telescope.drift(here, await telescope.look())
    measured = f"{off * 60.0:.1f}' from its goal"
    if off <= NEAR + max(telescope.ticks) and moved <= NEAR:
        return Finding(what, SAME, measured)
    return Finding(what, DIFFERS, measured, "at its goal", "Programs are told another place than the mount reached.")
