"""How the sky behaves: it answers with tables and without, stays small, never asks the network."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from datetime import UTC, datetime

import erfa
import numpy as np
import pytest

from gateway.astro.ephemeris import closed_forms
from gateway.astro.ephemeris.almanac import DAY, Almanac
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.offline import go_offline
from gateway.astro.spherical import from_vector, separation
from tests.support import exact_sky
from tests.support.each import each

GREENWICH_1987 = (13 + 10 / 60 + 46.1351 / 3600) * 15  # Meeus 12.a, apparent, 1987 April 10, 0h UT1
UT1_UTC_1987 = -0.2910912  # the IERS, that day


def unix(*date: int) -> float:
    return datetime(*date, tzinfo=UTC).timestamp()  # type: ignore[misc, arg-type]


DAY_OF_1987 = 6308  # 1987 April 10


@pytest.fixture(scope="module")
def almanac() -> Almanac:
    go_offline()
    return importlib.import_module("gateway.astro.ephemeris.by_astropy").calculate_almanac(
        [DAY_OF_1987, DAY_OF_1987 + 1]
    )


def test_sky_answers_without_an_almanac_and_requests_the_day(almanac: Almanac) -> None:
    sky, asked = Sky(), list[int]()
    sky.request_almanac = lambda: asked.append(1)
    moment = unix(1987, 4, 10) - UT1_UTC_1987
    assert not sky.has_tables and sky.calculation_source(moment) == "closed form"
    assert sky.sidereal_time(moment, 0.0) == pytest.approx(GREENWICH_1987, abs=0.02 / 240 + abs(UT1_UTC_1987) / 240)
    assert (sky.sun(moment), sky.planet("Mars", moment)) == (Sky().sun(moment), None)
    assert (sky.missing_day, len(asked)) == (DAY_OF_1987, 1), "once, however often it is needed"
    sky.use(almanac)
    assert sky.has_tables and sky.planet("Mars", moment) is not None and sky.missing_day is None
    assert sky.calculation_source(moment) == "almanac of 1987-04-10"
    assert sky.sidereal_time(moment, 0.0) == pytest.approx(GREENWICH_1987, abs=0.005 / 240)


def test_sky_continues_with_closed_forms_after_the_last_almanac_day(almanac: Almanac) -> None:
    sky, midnight = Sky(), unix(1987, 4, 12)
    sky.use(almanac)
    before = sky.sidereal_time(midnight - 0.001, 0.0)
    assert (
        sky.calculation_source(midnight - 0.001) == "almanac of 1987-04-11"
        and sky.calculation_source(midnight) == "closed form"
    )
    assert sky.missing_day == DAY_OF_1987 + 2
    assert sky.sidereal_time(midnight, 0.0) - before == pytest.approx(0.001 / 240, abs=1.0 / 240)
    first = unix(1987, 4, 11)  # between two days of the almanac only UT1-UTC changes
    assert sky.sidereal_time(first, 0.0) - sky.sidereal_time(first - 1e-3, 0.0) == pytest.approx(
        1e-3 / 240, abs=0.003 / 240
    )


@each("moment", [94780799.5, 4102444800.0])
def test_sky_requests_no_almanac_for_a_year_without_tables(moment: float) -> None:
    sky = Sky()
    assert sky.calculation_source(moment) == "closed form" and sky.missing_day is None


@each(("body", "middle", "ends"), [("Sun", 0.0002, 0.0002), ("Moon", 0.0017, 0.004)])
def test_interpolated_almanac_matches_astropy_between_rows(body: str, middle: float, ends: float) -> None:
    """Half-way between rows, which are nearest on both sides in the middle of a day; in arcseconds."""
    go_offline()
    by_astropy = importlib.import_module("gateway.astro.ephemeris.by_astropy")
    almanac = by_astropy.calculate_almanac([20007])
    for seconds in (0.0, 600.0, 5400.0, 27000.0, 48600.0, 81000.0, 86399.0):
        moment = 20007 * DAY + seconds
        arcseconds = middle if 10000.0 < seconds < 70000.0 else ends
        at = by_astropy.Time(moment, format="unix").tt
        right = np.dot(erfa.pnm06a(at.jd1, at.jd2), by_astropy.geocentric_vector(body, at))
        assert separation(*from_vector(almanac.values_at(body, moment)), *from_vector(right)) < arcseconds / 3600.0


@pytest.fixture(scope="module")
def loaded() -> Sky:
    return exact_sky.load(Sky())


@each("moment", [-1e300, -1e11, -2208988800.5, 0.0, 4102444800.0, 1e11, 1e300])
@each(("lat", "lon"), [(90.0, 0.0), (-90.0, 180.0), (0.0, -540.0), (1e9, 1e9)])
def test_sky_functions_stay_in_range_for_any_date_and_site(loaded: Sky, moment: float, lat: float, lon: float) -> None:
    for sky in (loaded, Sky()):
        places = [
            sky.az_alt(10.0, 90.0, lat, lon, moment),
            sky.to_ra_dec(10.0, -90.0, lat, lon, moment),
            sky.from_j2000(0.0, 90.0, moment),
            sky.to_j2000(0.0, -90.0, moment),
            sky.sun(moment),
            sky.moon(moment, lat, lon)[:2],
        ]
        for longitude, latitude in places:
            assert 0.0 <= longitude < 360.0 and -90.0 <= latitude <= 90.0
        assert 0.0 <= sky.sidereal_time(moment, lon) < 360.0


def test_sky_frame_is_calculated_once_a_minute_for_several_clocks(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[float] = []
    original = closed_forms.frame

    def counted(moment: float) -> closed_forms.Frame:
        made.append(moment)
        return original(moment)

    monkeypatch.setattr(closed_forms, "frame", counted)
    sky = Sky()
    for second in range(60):
        for clock in (unix(2026, 11, 21), unix(2001, 1, 1)):
            sky.az_alt(10.0, 20.0, 45.0, 10.0, clock + second)
            sky.from_j2000(10.0, 20.0, clock + second)
    assert sorted(made) == [unix(2001, 1, 1), unix(2026, 11, 21)]


def run(program: str) -> str:
    """What a fresh interpreter prints, which knows nothing of what was loaded here."""
    command = [sys.executable, "-bb", "-W", "error", "-c", program]
    environment = {name: value for name, value in os.environ.items() if name != "ASTROPY_CONFIG_DIR"}
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60, env=environment)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return done.stdout.strip()


def test_importing_the_sky_loads_no_heavy_module() -> None:
    heavy = "{'numpy', 'erfa', 'astropy', 'astropy_iers_data', 'threading', 'typing', 'socket', 'asyncio'}"
    assert run(f"import sys, gateway.astro.ephemeris; print(sorted({heavy} & set(sys.modules)))") == "[]"


WATCHED = """
import os, pathlib, socket, sys
touched = []
class Forbidden(socket.socket):
    def __new__(cls, *arguments, **options):
        touched.append(arguments)
        raise OSError("no network here")
socket.socket = Forbidden
def watch(event, arguments):
    written = event == "open" and (not isinstance(arguments[1], str) or set("wax+") & set(arguments[1]))
    if event.startswith(("socket.", "urllib.", "subprocess.")) or event == "os.mkdir" or written:
        touched.append((event, *arguments))
sys.dont_write_bytecode = True
sys.addaudithook(watch)
"""
ASKED = """
from gateway.astro.offline import go_offline
go_offline()
from gateway.astro.ephemeris.by_astropy import calculate_almanac as almanac
from gateway.astro.ephemeris.sky import Sky
sky = Sky()
sky.use(almanac([int(moment // 86400) for moment in (1e8, 1.7e9, 4.0e9)]))
for moment in (-1e9, 1e8, 1.7e9, 4.0e9):
    sky.az_alt(1.0, 2.0, 3.0, 4.0, moment), sky.sun(moment), sky.moon(moment, 1.0, 2.0), sky.planet("Mars", moment)
from astropy.utils import iers
print(sky.has_tables, touched, iers.conf.auto_download)
"""
RESIDENT = """
def resident():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))
"""
MINUTES = """
for minute in range(100):
    sky.az_alt(1.0, 2.0, 3.0, 4.0, 1.7e9 + 60 * minute)
print(resident() - bare)
"""
#: Not even asked for is the home where it would be found to be none, and what cannot be written to is not tried.
NO_HOME = """
def homeless(cls):
    touched.append("home")
    raise RuntimeError("there is no home")
pathlib.Path.home = classmethod(homeless)
"""
OLD = """
from gateway.astro.offline import go_offline
go_offline()
from astropy.time import Time
from astropy.utils import iers
iers.LeapSeconds._today = staticmethod(lambda: Time("2045-01-01", scale="tai", format="iso", out_subfmt="date"))
"""
GO_OFFLINE = "from gateway.astro.offline import go_offline\n"


@pytest.mark.skipif(sys.platform != "linux", reason="/proc is a home that nobody can write to, and tells the memory")
@pytest.mark.sampled(every=3)
@pytest.mark.parametrize(
    ("home", "before", "first"),
    [("/proc", GO_OFFLINE, NO_HOME), ("", "", ""), ("", "", OLD)],
    ids=["no home", "as it is", "in 2045"],
)
def test_sky_uses_neither_network_nor_disk_and_little_memory(
    home: str, before: str, first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor is anything printed: `run` makes every warning an error, and what is printed must be this."""
    if home:
        monkeypatch.setenv("HOME", home)
        monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    said, memory = run(RESIDENT + WATCHED + before + "bare = resident()\n" + first + ASKED + MINUTES).splitlines()
    assert said == "True [] False"
    assert int(memory) < 72 * 1024  # 58 MB on Python 3.11 and 3.12, 66 on 3.14
