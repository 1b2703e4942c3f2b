"""The chart of the sky as it is seen: its text overprints nothing, and what it shows stands where astropy says."""

from __future__ import annotations

import datetime
import json
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser

from gateway.astro.offline import go_offline
from tests.support.sampling import as_a_rule

from ..processes import workshop_in
from ..sky import NORTH
from .page import DESK, PHONE, Console, Visit, new_page

#: Keeps the text that the last picture of the sky has: words, left, top, right, bottom.
KEEP = """(() => {
  const own = CanvasRenderingContext2D.prototype, { fillText, clearRect } = own;
  window.texts = [];
  own.clearRect = function (...area) {
    if (this.canvas.id === "sky") window.texts = [];
    return clearRect.apply(this, area);
  };
  own.fillText = function (words, x, y) {
    const { width } = this.measureText(words), half = 0.4 * parseFloat(/([\\d.]+)px/.exec(this.font)[1]);
    if (this.canvas.id === "sky") window.texts.push([words, x, y - half, x + width, y + half]);
    return fillText.apply(this, arguments);
  };
})()"""
#: Pairs of texts that meet, of the chart, its figures and its buttons; texts beyond its edge; and all texts.
MEETING = """() => {
  const chart = document.querySelector("#chart").getBoundingClientRect(), { texts } = window;
  const page = [...document.querySelectorAll("#glance dt, #glance dd, .chart-tools button")].map((one) => {
    const { left, top, right, bottom } = one.getBoundingClientRect();
    return [one.textContent, left - chart.left, top - chart.top, right - chart.left, bottom - chart.top];
  });
  const meet = (a, b) => a[1] < b[3] - 1 && b[1] < a[3] - 1 && a[2] < b[4] - 1 && b[2] < a[4] - 1;
  const off = ([, left, top, right, bottom]) => left < 0 || top < 0 || right > chart.width || bottom > chart.height;
  return [
    texts.flatMap((one, index) => [...texts.slice(index + 1), ...page].filter((other) => meet(one, other))
      .map((other) => `${one[0]} × ${other[0]}`)),
    texts.filter(off).map(([words]) => words),
    texts.map(([words]) => words),
  ];
}"""
SIZES = [PHONE, (320, 568), (844, 390), DESK, (360, 640), (1024, 768), (667, 375)]
TARGETS = ("NGC 104", "Castor", "Jupiter", "Saturn", "Polaris", "M42", "18:37:00 -70:00:00")


def drawn_well(page: Visit, name: str) -> bool:
    """Whether the chart shows an object by its name, and no text meets another one or the edge."""
    meeting, off, texts = page.page.evaluate(MEETING)
    named = name[2:3] == ":" or any(name.replace(" ", "") in one.replace(" ", "") for one in texts)
    return (meeting, off, named) == ([], [], True)


@pytest.mark.parametrize("up", ["north", "south", "zenith"])
@pytest.mark.parametrize("size", SIZES[: as_a_rule(3, whole=7)])
def test_chart_text_does_not_overlap(visit: Callable[..., Visit], size: tuple[int, int], up: str) -> None:
    page = visit(size, fresh=True, chart_up=up)
    page.page.add_init_script(KEEP)
    page.page.reload()
    page.until("the planets are drawn", lambda: "Jupiter" in page.page.evaluate("window.texts.map(([words]) => words)"))
    for name in TARGETS[: as_a_rule(3, whole=7)]:
        page.find(name)
        if page.page.locator("#chart").is_visible():  # on the smallest screen the card takes its place
            page.until(f"{name} is drawn, and no text meets another", lambda name=name: drawn_well(page, name))


#: A night with the Moon and two planets up. Its stars brighter than this are looked for, higher than that, degrees.
MOON_UP = datetime.datetime(2026, 1, 26, 18, 30, tzinfo=datetime.UTC)
BRIGHT, HIGH = 4.1, 3.0
#: Around a star, pixels: where it is looked for, and where no other star may be.
REACH, APART = 3, 7
STARS = Path(__file__).resolve().parents[3] / "gateway/console/page/data/stars.json"


@pytest.fixture(scope="module")
def moonlit(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, float]]:
    """The console's address, and how much later its night is than this computer's time, seconds."""
    with workshop_in(tmp_path_factory.mktemp("moonlit")) as shop:
        began = time.time()
        yield Console(shop, moment=MOON_UP).url, MOON_UP.timestamp() - began


def over_horizon(unix: float, places: Any) -> Any:
    """Altitudes and azimuths, degrees, of J2000 positions and of bodies by their names, as astropy has them."""
    go_offline()
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord, get_body
    from astropy.time import Time

    here, now = EarthLocation.from_geodetic(NORTH.longitude, NORTH.latitude), Time(unix, format="unix")
    if isinstance(places, str):
        found = get_body(places, now, here)
    else:
        found = SkyCoord(*np.transpose(places), unit="deg")
    at = found.transform_to(AltAz(obstime=now, location=here))
    return at.alt.deg, at.az.deg


@pytest.mark.parametrize("size", [DESK, PHONE])
def test_chart_shows_the_sky_where_astropy_computes_it(
    moonlit: tuple[str, float], browser: Browser, size: tuple[int, int]
) -> None:
    """Two pixels at most: planets, the Moon, and fifty stars, of a picture without text."""
    url, later = moonlit
    page = Visit(new_page(browser, size), url, size, {"light-mode": "day", "light-shown": "day"})
    page.page.add_init_script(
        "for (const name of ['fillText', 'strokeText']) CanvasRenderingContext2D.prototype[name] = () => {}"
    )
    page.page.reload()
    page.until("planets are known", lambda: "Jupiter" in (page.page.locator("#sky").get_attribute("aria-label") or ""))
    page.page.set_viewport_size({"width": size[0], "height": size[1] - 2})  # it is drawn anew
    found: list[tuple[float, int, float]] = []

    def fits() -> bool:
        """Whether the picture is that of the new size: it shows everything where it is."""
        found.append(_errors(page, time.time() + later))
        body, stars, star = found[-1]
        return body <= 2.0 and stars >= 50 and star <= 2.0

    page.until("the chart shows everything where it is", fits)
    print(f"{found[-1][1]} stars, {found[-1][2]:.2f} px at most, bodies {found[-1][0]:.2f} px")
    page.close()


def _errors(page: Visit, unix: float) -> tuple[float, int, float]:
    """Return by how many pixels the picture is off: of the bodies at most, of how many stars, and of these at most."""
    seen = np.asarray(page.picture()).astype(float)
    box = page.page.locator("#sky").bounding_box()
    assert box is not None
    centre, radius = (
        (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2),
        min(box["width"], box["height"]) / 2 - 26,
    )

    def point(alt: float, az: float) -> tuple[float, float]:
        far = radius * math.tan(math.radians(90.0 - alt) / 2)
        return centre[0] - far * math.sin(math.radians(az)), centre[1] - far * math.cos(math.radians(az))

    def off(x: float, y: float, reach: int, weigh: Callable[[Any], Any]) -> float:
        """How far the middle of what is drawn there is from a point, pixels."""
        left, top = round(x) - reach, round(y) - reach
        weights = weigh(seen[top : top + 2 * reach + 1, left : left + 2 * reach + 1])
        down, right = np.mgrid[: 2 * reach + 1, : 2 * reach + 1] + 0.5
        if not weights.sum():
            return math.inf
        return math.hypot(left + np.average(right, weights=weights) - x, top + np.average(down, weights=weights) - y)

    def coloured(*colours: str) -> Callable[[Any], Any]:
        known = [[int(one[at : at + 2], 16) for at in (0, 2, 4)] for one in colours]
        return lambda part: sum(np.abs(part - one).max(axis=2) < 16 for one in known)

    hidden, worst = [point(45.0, 180.0)], 0.0  # behind the tube, or behind a body
    for body, colours in {"moon": ("f4f0e2", "3b4763"), "jupiter": ("ffc98a",), "saturn": ("ffc98a",)}.items():
        alt, az = over_horizon(unix, body)
        assert alt > HIGH
        hidden.append(point(alt, az))
        worst = max(worst, off(*hidden[-1], 10 if body == "moon" else 6, coloured(*colours)))

    stars = [one for one in json.loads(STARS.read_text("utf-8"))["stars"] if one[2] < 4.7]
    points = [point(alt, az) for alt, az in np.transpose(over_horizon(unix, [one[:2] for one in stars]))]
    above = over_horizon(unix, [one[:2] for one in stars])[0]
    alone = [
        at
        for one, at, alt in zip(stars, points, above, strict=True)
        if one[2] < BRIGHT and alt > HIGH and all(math.dist(at, other) > 25 for other in hidden)
        and sum(math.dist(at, other) < APART for other in points) == 1
    ]  # fmt: skip
    far = sorted(off(*at, REACH, lambda part: np.clip(part.min(axis=2) - 112, 0, None)) for at in alone)
    return worst, len(far), far[-1]


def test_chart_is_redrawn_in_the_frame_in_which_it_is_resized(visit: Callable[..., Visit]) -> None:
    """A canvas whose size is set is empty, and would be seen so until the next frame."""
    page = visit()
    painted = page.page.evaluate("""() => new Promise((told) => {
      const chart = document.querySelector("#chart"), sky = document.querySelector("#sky"), wide = sky.height;
      new ResizeObserver(() => {
        if (sky.height === wide) return;
        const { data } = sky.getContext("2d").getImageData(0, 0, sky.width, sky.height);
        told(data.filter((one, index) => index % 4 === 3 && one).length);
      }).observe(chart);
      chart.style.flex = "none";
      chart.style.height = "250px";
    })""")
    assert painted > 10_000
