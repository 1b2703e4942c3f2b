"""The page on a phone, a tablet and a desk; with the keyboard alone; how soon it is there, and how large it is."""

from __future__ import annotations

import gzip
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from ..processes import wait_until
from .page import AT_ALDEBARAN, DESK, PHONE, TABLET, UNHEARD, VIEWS, Visit

PAGE = Path(__file__).resolve().parents[3] / "gateway/console/page"
#: Bytes of all files that every visit loads, packed one by one; seconds to the first paint.
LARGEST, FIRST = 150_000, 1.0
#: For ``visit``: the page hears of a doubt, which is a banner.
DOUBTED = {'"clock_doubt":""': '"clock_doubt":"the computer says that it is another night"'}


def test_no_view_is_wider_than_the_screen(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.find("Aldebaran")
    for size in page.sizes(PHONE, (360, 640), (844, 390), TABLET, DESK):
        for view in VIEWS:
            page.show(view)
            wide = page.page.evaluate(
                "[...document.querySelectorAll('html, main, .conversation')]"
                ".filter(one => one.scrollWidth > one.clientWidth + 1)"
                ".map(one => one.id || one.className || one.tagName)"
            )
            assert wide == [], view
            box = page.page.locator("#stop").bounding_box()
            assert box is not None and box["width"] >= 200 and box["height"] >= 48
            assert 0 <= box["x"] <= size[0] - box["width"] and 0 <= box["y"] <= size[1] - box["height"], view
            centre = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
            assert page.page.evaluate(
                "([x, y]) => document.elementFromPoint(x, y).closest('#stop') !== null", centre
            ), view


def test_phone_on_its_side_shows_the_sky_and_all_controls(visit: Callable[..., Visit]) -> None:
    page = visit(told=DOUBTED)
    page.find("Aldebaran")
    for _ in page.sizes((844, 390), (667, 375)):
        assert page.page.locator(".banner").count() == 1, "the doubt of the clock"
        assert page.page.get_by_role("heading", level=1).count() == 1
        for view, whole in (
            ("sky", "#chart, #search, #go, #sync"),
            ("control", "#pad, #rate, #orders"),
            ("talk", "#explain"),
        ):
            page.show(view)
            assert page.overlapping() == [], view
            scrolls = page.page.evaluate(
                "(main => main.scrollHeight - main.clientHeight)(document.querySelector('main'))"
            )
            assert scrolls <= 0, view
            hidden = page.page.evaluate(
                "one => [...document.querySelectorAll(one)].filter(one => one.getBoundingClientRect().bottom > "
                "document.querySelector('.views').getBoundingClientRect().top).map(one => one.id)",
                whole,
            )
            assert hidden == [], view


def test_page_messages_cover_no_control_and_a_tablet_shows_every_panel(visit: Callable[..., Visit]) -> None:
    page = visit(told=DOUBTED)
    needed = "#does, #stop, #go, #sync, #search, .views a, [data-go], #rate, #orders button, #chart-up"
    covered = (
        "([one, needed]) => { const at = document.querySelector(one).getBoundingClientRect(); return "
        "[...document.querySelectorAll(needed)].filter(other => { const box = other.getBoundingClientRect(); "
        "const low = Math.min(box.bottom, other.closest('main')?.getBoundingClientRect().bottom ?? 9999); return "
        "other.checkVisibility() && at.left < box.right && box.left < at.right && at.top < low && box.top < at.bottom"
        "}).map(other => other.id || other.textContent) }"
    )
    for size in page.sizes((320, 568), (844, 390), (1024, 768)):
        page.find("Aldebaran")
        assert page.page.locator(".banner").count() == 1, "the doubt of the clock"
        assert page.overlapping() == []
        page.page.fill("#object", "Xyzzyx")
        page.page.press("#object", "Enter")
        page.until("it is refused", lambda: page.page.locator(".notice.refused").is_visible())
        assert page.page.evaluate(covered, [".notice.refused", needed]) == []
        page.page.click("#stop")
        page.until("a success is told", lambda: page.page.locator(".notice.done").is_visible())
        assert page.page.evaluate(covered, [".notice.done", needed]) == []
        if size == (1024, 768):
            chart, pad, orders, stop = (
                page.page.locator(one).bounding_box() for one in ("#chart", "#pad", "#orders", "#stop")
            )
            assert chart and pad and orders and stop
            assert chart["x"] + chart["width"] <= pad["x"] and orders["y"] + orders["height"] <= stop["y"]


@pytest.mark.parametrize("size", [(320, 568), PHONE, (844, 390), (1024, 768)])
def test_target_card_buttons_stay_put_during_a_goto(visit: Callable[..., Visit], size: tuple[int, int]) -> None:
    """Before a goto, on its way and at its end; then no button is the next thing to press."""
    page = visit(size, told=UNHEARD)
    page.find("Aldebaran")
    page.until("the whole card", lambda: page.page.locator("#place .details").is_visible())

    def boxes() -> list[object]:
        return [page.page.locator(one).bounding_box() for one in ("#go", "#sync", "#place .close", "#chart")]

    page.until("they are drawn, and not just drawn again", lambda: all(boxes()[:3]))
    before, going = boxes(), {"slewing": True, "moves": True, "target": AT_ALDEBARAN}
    go, sync, close = before[:3]
    assert isinstance(go, dict) and isinstance(sync, dict) and isinstance(close, dict)
    assert go["y"] == sync["y"] and go["x"] + go["width"] <= sync["x"] and go["width"] == sync["width"]
    assert max(one["x"] + one["width"] for one in (sync, close)) <= size[0]
    for state, words, blue in (
        (going, "On its way…", "go"),
        (
            {"slewing": False, "moves": False, "target": None, "position": AT_ALDEBARAN, "aligned": True},
            "Go again",
            None,
        ),
    ):
        page.hear_of_mount(**state)
        page.until(words, lambda words=words: page.text("#go") == words)
        page.until("they are where they were", lambda: boxes() == before)
        assert page.page.evaluate("document.querySelector('#place .primary')?.id") == blue


def test_parked_mount_has_one_unpark_button(visit: Callable[..., Visit]) -> None:
    page = visit(told={'"parked":false': '"parked":true', '"clock_doubt":"': '"clock_doubt":"","told":"'})
    for _ in page.sizes(PHONE, (844, 390)):
        page.show("sky")
        unparks = page.page.get_by_role("button", name="Unpark")
        assert unparks.count() == 1 and page.page.locator(".banner.parked").is_visible(), "beside the sky"
        page.show("control")
        assert unparks.count() == 1
        box, stop = unparks.bounding_box(), page.page.locator(".stop-bar").bounding_box()
        assert box and stop and (box["y"] + box["height"] <= stop["y"] or box["x"] + box["width"] <= stop["x"])
        assert page.overlapping() == []


def test_longest_question_fits_a_small_screen(visit: Callable[..., Visit]) -> None:
    """The longest one: nothing of it is beyond the screen for good, and STOP covers none of its buttons."""
    page = visit(told={'"equatorial":false': '"equatorial":true'})
    for _ in page.sizes((320, 568), (667, 375), (844, 390), (900, 560)):
        page.show("more")
        page.page.get_by_role("button", name="Narrow the limits…").click()
        seen = (
            "one => { const box = document.querySelector(one).getBoundingClientRect(); "
            "return document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2)?.id }"
        )
        assert [page.page.evaluate(seen, f"#ask-{one}") for one in ("yes", "no")] == ["ask-yes", "ask-no"]
        for one in ("title", "lowest", "highest", "sun", "hour_angle"):
            page.page.evaluate("one => document.querySelector(one).scrollIntoView({block: 'nearest'})", f"#ask-{one}")
            assert page.page.evaluate(seen, f"#ask-{one}") == f"ask-{one}"
        page.page.click("#ask-no")


def test_keyboard_reaches_every_control(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.find("Aldebaran")

    def not_reached() -> set[str]:
        """The controls that Tab does not come to; those that were drawn again meanwhile count among them."""
        wanted = page.page.evaluate(
            "window.reached || document.addEventListener('focusin', event => reached.add(event.target.dataset.reach));"
            "window.reached = new Set(); document.activeElement.blur();"
            "[...document.querySelectorAll('button, input, a[href], canvas[tabindex]')].filter(one => "
            "one.checkVisibility() && !one.disabled && one.tabIndex >= 0)"
            ".map((one, index) => one.dataset.reach = String(index)).length"
        )
        for _ in range(wanted + 12):
            page.page.keyboard.press("Tab")
        reached = page.page.evaluate(
            "document.querySelectorAll('[data-reach]').forEach(one => delete one.dataset.reach); [...window.reached]"
        )
        return {str(index) for index in range(wanted)}.difference(reached)

    for _ in page.sizes(PHONE, TABLET, DESK):
        for view in VIEWS:
            page.show(view)
            page.until(f"every control of {view} is reached", lambda: not not_reached())


def test_every_control_has_a_name_for_screen_readers(visit: Callable[..., Visit]) -> None:
    page = visit(DESK)
    page.find("Aldebaran")
    for view in VIEWS:
        page.show(view)
        for role in ("button", "textbox", "combobox", "slider", "radio", "link"):
            for one in page.page.get_by_role(role).all():  # type: ignore[arg-type]
                name = one.evaluate(
                    "one => one.getAttribute('aria-label') || one.textContent.trim() || one.labels?.[0]?.textContent"
                )
                assert name, (view, role, one.evaluate("one => one.outerHTML"))


def test_page_loads_within_a_second(visit: Callable[..., Visit]) -> None:
    """On a loaded computer not at the first visit."""

    def paints() -> bool:
        first = visit(fresh=True).page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
        print(f"first paint after {first:.0f} ms")
        return bool(first <= FIRST * 1000)

    wait_until("it is there in time", paints)


def test_page_loads_with_few_requests_and_reloads_with_none(visit: Callable[..., Visit]) -> None:
    """So it is there within a second at 0.15 s of round trip: two for the page, two for its script and the socket."""
    page = visit()
    loaded = "performance.getEntriesByType('resource').map(one => [one.name.split('/').at(-1), one.transferSize])"
    names = ["all.js", "stars.json"]  # a browser without a window loads no icon
    page.until("all is loaded", lambda: sorted(name for name, _ in page.page.evaluate(loaded)) == names)
    sockets: list[str] = []
    page.page.on("websocket", lambda opened: sockets.append(opened.url))
    page.page.reload()
    page.until("it shows the mount", lambda: page.text("#name").startswith("Celestron"))
    assert sum(size for _, size in page.page.evaluate(loaded)) == 0
    assert len(sockets) == 1, "the modules take over the connection that was begun before them"


def test_page_files_stay_below_their_byte_limits() -> None:
    """Packed, with the stars of the chart; the catalogue of deep sky objects is loaded when somebody wants the list."""
    files = [
        path for path in PAGE.rglob("*") if path.suffix in (".html", ".css", ".js", ".svg") or path.name == "stars.json"
    ]
    sizes = [len(gzip.compress(path.read_bytes(), 6)) for path in files]
    print(f"{sum(sizes)} bytes packed in {len(sizes)} files")
    assert sum(sizes) <= LARGEST


def test_page_scripts_parse_nothing_as_markup() -> None:
    for path in PAGE.rglob("*.js"):
        text = path.read_text("utf-8")
        for word in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("):
            assert word not in text, path


def test_page_leaks_no_memory_when_values_change(visit: Callable[..., Visit]) -> None:
    """A minute of changes, as fast as they can be drawn; by hand it was watched for twenty minutes."""
    page = visit(DESK, told={"never": "told"})
    page.find("Aldebaran")
    browser = page.page.context.new_cdp_session(page.page)
    browser.send("Performance.enable")

    def heap() -> float:
        for _ in range(2):
            browser.send("HeapProfiler.collectGarbage")
        metrics = {one["name"]: one["value"] for one in browser.send("Performance.getMetrics")["metrics"]}
        return float(metrics["JSHeapUsedSize"])

    def change(times: int) -> None:
        for step in range(times):
            at = {
                "ra": step % 360,
                "dec": 10,
                "ra2000": step % 360,
                "dec2000": 10,
                "alt": 50,
                "az": step % 360,
                "age": 0,
            }
            page.hear_of_mount(position=at, lst=step % 360)
            page.page.wait_for_timeout(8)

    change(100)
    before = min(heap() for _ in range(3))  # some things go at a later collection only
    change(300)
    page.until("nothing of it stays", lambda: heap() - before < 300_000)


def test_console_labels_are_all_in_the_labels_file() -> None:
    """Also names for screen readers; the page itself has but what must be there before its scripts."""
    made = re.compile(
        r'(?:\bbutton|\bgroup|\brow|\bchips|\blist)\([`"]\w|\bel\("(?:h\d|dt|label|summary)", \{[^}]*\}, "'
        r'|(?:"aria-label"|placeholder|title|yes): "|^ +\["\w[^"]*", \(', re.M
    )  # fmt: skip
    for path in PAGE.rglob("*.js"):
        if path.name != "labels.js":
            assert not made.findall(path.read_text("utf-8")), path
    page = (PAGE / "index.html").read_text("utf-8")
    assert not re.findall(r' (?:aria-label|placeholder)="', page)
    texts = set(re.findall(r">\s*([^<>{}]*\w[^<>{}]*?)\s*<", page.partition("<body")[2].partition("<noscript>")[0]))
    assert texts == {"Connecting…", "mount-gateway", "STOP", "all motion"}
