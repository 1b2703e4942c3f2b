"""Rates, requested and measured at the axes of simulated mounts: NexStar rates on Meades, LX200 rates on NexStars.

A row fails if the axis speed differs by more than 10 % from the speed that the tables give for that model.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from msgspec import Struct

from gateway.astro.spherical import SIDEREAL_ARCSECONDS, SIDEREAL_RATE, wrap180
from gateway.diagnostics.virtual_time import run
from gateway.protocols.lx200.driver.speeds import ModelSpeeds, instead_of_tracking, nearest
from gateway.protocols.mechanics.truth import truth_of
from gateway.protocols.nexstar.counting import key_speed, rate_tables
from gateway.protocols.wireformat.command_set import load
from tests.support.in_process_gateway import Bridge

MEADES = ("lx200gps", "autostar", "lx200", "lx200-16")
#: Model, version, and the command that puts a fork on its wedge.
NEXSTARS = (
    ("cge", "4.21", b""),
    ("avx", "5.31", b""),
    ("cpc", "4.21", b"T\2"),
    ("6-8se", "4.21", b"T\2"),
    ("slt", "4.03", b"T\2"),
    ("nexstar-gps", "2.2", b"T\2"),
    ("nexstar-gps", "1.2", b""),
    ("gt", "101.0", b""),
)
VARIABLE = (0.5, 7.5, 14.5, 15.0, 22.5, -3.0, 30.0, 60.0, 150.0, -150.0, 300.0, 1000.0, 3600.0, 14400.0)
KEYS = tuple(range(1, 10))
#: The permitted fraction by which the measured speed may differ from the table's.
WITHIN = 0.10
#: The same for the fastest speed of motors that move by small gotos: they stop and start.
STEPPED = 0.45


class Row(Struct, frozen=True):
    """Arcseconds a second. ``named`` is the speed that the tables give for the request."""

    mount: str
    what: str
    asked: float
    named: float
    measured: float
    within: float = WITHIN

    @property
    def fails(self) -> bool:
        return abs(self.measured - self.named) > max(abs(self.named) * self.within, 0.3)

    def line(self) -> str:
        return (
            f"{self.mount:<18} {self.what:<14} {self.asked:>10.2f} {self.named:>10.2f} {self.measured:>10.2f}"
            f"{'  FAILS' if self.fails else ''}"
        )


def _limits(version: str = "") -> dict[str, Any]:
    return {"sun": 0.0, "lowest": -90.0, **({"mode": "eq-north"} if version == "2.2" else {})}


def over_meade(model: str, variable: tuple[float, ...] = VARIABLE, keys: tuple[int, ...] = KEYS) -> list[Row]:
    """Measure variable and fixed rates of a NexStar program, both axes, on a polar-mounted Meade that tracks."""
    rows: list[Row] = []
    facts = load("lx200").models[model]
    low, high = facts["max_rates"]
    able = ModelSpeeds(
        model == "lx200gps",
        model == "lx200gps",
        True,
        facts["max_rate"],
        (low, high),
        (facts["hertz"][0], facts["hertz"][1]),
    )

    async def program() -> None:
        bridge = Bridge(model, driven="lx200", presented="nexstar", surface="cge", latency=0.02, config=_limits())
        bridge.sim.feed(b":AP#:CM#")
        async with bridge:
            client = bridge.client()

            async def turns(device: int, frame: bytes) -> float:
                await client.ask(frame)
                await asyncio.sleep(2.5)
                seen = truth_of(bridge.sim)
                await client.ask(bytes((80, 2, device, 36, 0, 0, 0, 0)))
                await asyncio.sleep(4.0)
                return (seen.rate1 if device == 16 else seen.rate2) * 3600.0

            for asked in variable:
                code = round(abs(asked) * 4)
                for device in (16, 17):
                    named = (
                        instead_of_tracking(able, asked / 3600.0, SIDEREAL_ARCSECONDS / 3600.0).degrees
                        if device == 16
                        else nearest(able, abs(asked) / 3600.0).degrees * (1 if asked > 0 else -1)
                    )
                    frame = bytes((80, 3, device, 6 if asked > 0 else 7, code // 256, code % 256, 0, 0))
                    what, measured = f"P 3 {device} {frame[3]}", await turns(device, frame)
                    rows.append(Row(model, what, asked, named * 3600.0, measured))
            for key in keys:
                asked = key_speed(rate_tables()["se"], key)
                named = nearest(able, asked).degrees
                frame = bytes((80, 2, 17, 36, key, 0, 0, 0))
                rows.append(Row(model, f"key {key}", asked * 3600.0, named * 3600.0, await turns(17, frame)))

    _run(program)
    return rows


def over_nexstar(model: str, version: str, first: bytes, guides: tuple[float, ...] = (3.0, 7.5, 15.0)) -> list[Row]:
    """Measure guide, direction key and drive rates of an LX200 program; hand controls before 1.6 use small gotos."""
    rows: list[Row] = []
    ancient = version in ("1.2", "101.0")  # 1.2 does not report its model, so the commonest table is used
    table = rate_tables()["se" if version == "1.2" else load("nexstar").models[model]["rates"]]
    name = f"{model}/{version}"

    async def program() -> None:
        bridge = Bridge(model, version, surface="lx200gps", config=_limits(version))
        if first:
            bridge.sim.feed(first)
        async with bridge:
            client = bridge.client()
            await asyncio.sleep(2.0)

            def place() -> float:
                return bridge.sim.truth()[1] if ancient else truth_of(bridge.sim).axis2

            async def south(command: bytes, seconds: float) -> float:
                client.tell(command + b":Ms#")
                await asyncio.sleep(3.0)
                before = place()
                await asyncio.sleep(seconds)
                turned = abs(wrap180(place() - before)) * 3600.0 / seconds
                client.tell(b":Qs#")
                await asyncio.sleep(6.0)
                client.tell(b":RS#:Mn#" if turned > 300.0 else b"")
                await asyncio.sleep(3.0 if turned > 300.0 else 0.0)
                client.tell(b":Qn#")
                await asyncio.sleep(6.0)
                return turned

            for guide in guides if not ancient else ():
                client.tell(b":Rg%04.1f#" % guide)
                for axis, direction in ((0, b"w"), (1, b"n")):
                    seen = truth_of(bridge.sim)
                    client.tell(b":Mg%s4000#" % direction)
                    await asyncio.sleep(6.0)
                    now = truth_of(bridge.sim)
                    turned = (
                        wrap180(now.axis1 - seen.axis1) - SIDEREAL_RATE * (now.t - seen.t),
                        wrap180(now.axis2 - seen.axis2),
                    )[axis]
                    rows.append(Row(name, f":Mg{direction.decode()} at :Rg", guide, guide, abs(turned) * 900.0))
                rows.append(Row(name, ":RG at :Rg", guide, guide, await south(b":RG#", 4.0)))
            if ancient:
                rows.append(
                    Row(name, ":RG", SIDEREAL_ARCSECONDS / 2, SIDEREAL_ARCSECONDS / 2, await south(b":RG#", 30.0), 0.4)
                )
            for command, key in ((b":RC#", 4), (b":RM#", 7), (b":RS#", 9)):
                asked = min(key_speed(table, key), float(table["degrees"][-1])) * 3600.0
                within = STEPPED if ancient and key == 9 else WITHIN
                rows.append(Row(name, command.decode(), asked, asked, await south(command, 4.0), within))
            for degrees in (0.5, 2.0):
                asked = degrees * 3600.0
                rows.append(Row(name, ":RE", asked, asked, await south(b":RE%04.1f#" % degrees, 4.0)))
            for hertz in (b"57.9", b"060.0", b"060.1"):
                said = await client.ask(b":ST%s#" % hertz)
                await asyncio.sleep(2.0)
                seen = truth_of(bridge.sim)
                equatorial = model in ("cge", "avx") or bool(first)
                told = float((await client.ask(b":GT#", until=b"#"))[:-1])
                runs = seen.rate1 * 3600.0 * 4.0 if equatorial else 60.16
                rows.append(Row(name, f":ST{hertz.decode()} {said.decode()}", float(hertz), told, runs, 0.002))

    _run(program)
    return rows


def _run(program: Callable[[], Coroutine[Any, Any, None]]) -> None:
    run(program())
