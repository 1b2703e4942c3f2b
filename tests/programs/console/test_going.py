"""Finding a place and going there, what another program moves, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from playwright.sync_api import FilePayload

from ..sky import NIGHT, NORTH, Spot, separation, spot_at
from .page import AT_ALDEBARAN, UNHEARD, Console, Visit

#: Of date.
ALDEBARAN = Spot(69.35, 16.56)
#: A file with a list of one's own: the last two lines are no places.
OWN_LIST = "albireo\n05:34:32 +22:00:52 J2000\nXyzzyx\n5.588 -5.39\n"
OWN_FILE: FilePayload = {"name": "own.txt", "mimeType": "text/plain", "buffer": OWN_LIST.encode()}


def lx200(degrees: float, hours: bool) -> str:
    """As LX200 commands have it: HH:MM:SS, or sDD*MM:SS."""
    seconds = round(abs(degrees) / (15.0 if hours else 1.0) * 3600.0)
    text = f"{seconds // 3600:02d}{':' if hours else '*'}{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    return text if hours else f"{'-' if degrees < 0 else '+'}{text}"


def test_page_shows_the_position_during_a_goto_of_another_program(
    console: Console, visit: Callable[..., Visit]
) -> None:
    page = visit()
    page.show("readings")
    before = page.text("#readings .large dd")
    goal = spot_at(120.0, 50.0, NORTH, NIGHT)
    with console.program() as program:
        program.say(f":Sr{lx200(goal.ra, True)}#".encode(), 1)
        program.say(f":Sd{lx200(goal.dec, False)}#".encode(), 1)
        assert program.say(b":MS#", 1) == b"0"
        page.until("it slews", lambda: page.does("Slewing"))
        seen = {before}
        page.until("the position moves", lambda: seen.add(page.text("#readings .large dd")) or len(seen) > 3)
        assert program.name in page.text("#readings")
        page.until("it has arrived", lambda: page.does("Tracking"))


def test_page_finds_an_object_and_goes_there(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.page.fill("#object", "alde")
    page.until("it is offered", lambda: page.page.locator("#suggestions li").count() > 0)
    page.page.press("#object", "ArrowDown")
    page.page.press("#object", "Enter")
    page.until("its card", lambda: page.text("#place h3") == "Aldebaran")
    start = console.truth.position()
    page.page.click("#go")
    page.until("it slews", lambda: page.does("Slewing"))
    page.until("the mount itself goes", lambda: console.moved_from(start))
    page.until("it says where to", lambda: page.text("#notices") == "It goes to Aldebaran.")
    page.until("and that it goes there already", lambda: page.text("#go") == "On its way…")
    page.page.click("#stop")
    page.until("which it does no longer", lambda: page.text("#go") == "Go there")
    page.until("it stands", lambda: page.does("Tracking"))
    page.page.click("#go")
    page.until("it is told that it is there", lambda: page.text("#notices") == "It is there: Aldebaran.")
    assert page.text("#go") == "Go again" and page.page.locator("#sync.primary").count() == 0
    page.page.click("#sync")
    page.page.click("#ask-yes")
    page.until("what is centred is named", lambda: page.text("#notices") == "Synced on Aldebaran.")


def test_page_shows_no_stop_message_after_a_newer_motion(visit: Callable[..., Visit]) -> None:
    """The gateway answers a STOP when the mount rests: after the motion that was ordered next."""
    page = visit(told={'{"id":': '{"unheard":'})
    page.show("control")
    page.page.click("#stop")
    page.until("it stops", lambda: page.text("#stop-says") == "stopping…")
    page.page.click("#pad [data-go=north]")
    page.until("it moves by that order", lambda: page.text("#stop-says") == "all motion")


def test_page_shows_an_arrival_while_values_are_being_read_again(visit: Callable[..., Visit]) -> None:
    """At rest the gateway asks for status and position once more; until they are answered it tells none."""
    page = visit(told=UNHEARD)
    page.find("Aldebaran")
    page.hear_of_mount(slewing=True, moves=True, target=AT_ALDEBARAN)
    page.until("it goes there", lambda: page.text("#go") == "On its way…")
    page.hear_of_mount(slewing=False, moves=False, target=None, position=AT_ALDEBARAN, aligned=None)
    page.until("it stands", lambda: page.text("#go") != "On its way…")
    page.hear_of_mount(aligned=True)
    page.until("it is told", lambda: page.text("#notices") == "It is there: Aldebaran.")
    for unknown in ({"position": None}, {"position": AT_ALDEBARAN, "aligned": None}):
        page.hear_of_mount(**unknown, wanted=[f"{unknown}"])
        page.until(
            "the page has heard it",
            lambda told=f"{unknown}": told in (page.page.locator("#readings").text_content() or ""),
        )
        assert page.text("#go") == "Go again"
    page.hear_of_mount(position={**AT_ALDEBARAN, "ra2000": 69.1}, aligned=True, wanted=["Centred by hand"])
    page.until("it is heard", lambda: "Centred by hand" in (page.page.locator("#readings").text_content() or ""))
    assert page.text("#go") == "Go again"
    page.hear_of_mount(aligned=True, position={**AT_ALDEBARAN, "ra2000": 70.0})
    page.until("it was moved away", lambda: page.text("#go") == "Go there")


def test_page_announces_no_arrival_after_a_small_step_off_the_target(visit: Callable[..., Visit]) -> None:
    page = visit(told=UNHEARD)
    page.find("Aldebaran")
    beside = {**AT_ALDEBARAN, "dec": 16.577, "dec2000": 16.527}
    # As the page found it, it may still slew.
    page.hear_of_mount(position=AT_ALDEBARAN, aligned=True, slewing=False, moves=False, target=None)
    page.until("it is there", lambda: page.text("#go") == "Go again")
    page.hear_of_mount(slewing=True, moves=True, target=beside)
    page.until("it goes a minute of arc", lambda: page.text("#go") == "Go there")
    page.hear_of_mount(slewing=False, moves=False, target=None, position=beside)
    page.until("it stands", lambda: page.text("#go") == "Go again")
    assert page.text("#notices") == ""


def test_page_refuses_a_sync_while_the_mount_moves(visit: Callable[..., Visit]) -> None:
    page = visit(told=UNHEARD)
    page.find("Aldebaran")
    page.hear_of_mount(slewing=True, moves=True)
    page.until("it slews", lambda: page.page.get_attribute("#sync", "aria-disabled") == "true")
    page.page.click("#sync", force=True)
    page.until("it is said why", lambda: page.text("#notices").startswith("The mount moves: sync when it has arrived"))
    assert not page.page.locator("#ask").is_visible()
    page.page.click("#notices button")
    page.hear_of_mount(slewing=False, moves=False)
    page.until("it stands", lambda: page.page.get_attribute("#sync", "aria-disabled") == "false")
    page.page.click("#sync")
    page.until("it asks", lambda: page.text("#ask-title") == "Sync on Aldebaran?")
    page.hear_of_mount(slewing=True, moves=True)
    page.until("another program moves it", lambda: page.page.get_attribute("#sync", "aria-disabled") == "true")
    page.page.click("#ask-yes")
    page.until("it is said again", lambda: page.text("#notices").startswith("The mount moves"))


@pytest.mark.parametrize(
    ("told", "heading", "state"),
    [
        ({'"state":"up"': '"state":"down"', '"moves":false': '"moves":true', '"slewing":false': '"slewing":true'},
         "The mount does not answer", "down"),
        ({'"aligned":true': '"aligned":false'}, "Not aligned", "up"),
    ],
)  # fmt: skip
def test_page_says_lost_and_not_slewing_and_greys_unknown_numbers(
    visit: Callable[..., Visit], told: dict[str, str], heading: str, state: str
) -> None:
    greys = (
        "[...document.querySelectorAll('.glance dd, #control-at, #readings :is(.large, .where) dd')]"
        ".map(one => getComputedStyle(one).fontStyle)"
    )
    dot = "getComputedStyle(document.querySelector('.who'), '::before').backgroundColor"
    known = visit()
    assert set(known.page.evaluate(greys)) == {"normal"}
    green = known.page.evaluate(dot)
    page = visit(told=told)
    assert page.does(heading) and page.page.evaluate("document.body.dataset.mount") == state
    assert page.page.title().startswith(heading)
    assert set(page.page.evaluate(greys)) == {"italic"} and page.page.evaluate(dot) != green
    assert page.page.locator("#readings .where").count() == 3


def test_page_shows_parked_after_parking(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("control")
    page.page.click("#orders >> text=Park…")
    page.until("it says where to", lambda: "altitude 10.5°, azimuth 0.0° N" in page.text("#ask-words"))
    page.page.click("#ask-yes")
    page.until("it is parked, and nobody else asks the mount", lambda: page.does("Parked"))
    page.show("sky")
    page.find("Aldebaran")
    assert "the arrows move it" in page.text("#banners p")
    page.page.click("#banners button")
    page.until("it is in service", lambda: page.does("Tracking"))
    page.until("which is over", lambda: "unpark" not in page.text("#banners"))


def test_tapping_a_star_on_the_chart_selects_it(visit: Callable[..., Visit]) -> None:
    page = visit()
    box = page.page.locator("#sky").bounding_box()
    assert box is not None
    page.page.touchscreen.tap(box["x"] + box["width"] / 2 + 40, box["y"] + box["height"] / 2 + 30)
    page.until("a card", lambda: page.page.locator("#place").is_visible())
    assert page.page.locator("#go").is_enabled()


def test_page_shows_the_reason_when_a_target_is_below_the_horizon(
    console: Console, visit: Callable[..., Visit]
) -> None:
    page = visit()
    page.find("18:37:00 -70:00:00")
    assert not page.page.locator("#go").is_enabled()
    assert "below the lowest altitude, 10°" in page.text("#place .why")
    with console.program() as program:  # and what another program is refused stands among the readings
        program.say(b":Sr18:37:00#:Sd-70*00:00#", 2)
        assert program.say(b":MS#", 1) != b"0"
    page.show("readings")
    page.until("it is told", lambda: "below the lowest altitude" in page.text("#readings"))


def test_page_asks_for_confirmation_before_a_sync(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.find("Aldebaran")
    before = console.truth.position()
    page.page.click("#sync")
    page.until("it asks", lambda: page.text("#ask-title") == "Sync on Aldebaran?")
    told = re.match(r"It is ([\d.]+)([°′]) from where the mount believes that it points\. ", page.text("#ask-words"))
    assert told is not None
    degrees = float(told[1]) / (60.0 if told[2] == "′" else 1.0)
    assert degrees == pytest.approx(separation(before, ALDEBARAN), abs=0.1)
    assert page.page.locator("#stop").is_enabled() and not page.page.evaluate("document.querySelector('#stop').inert")
    page.page.click("#ask-no")
    page.until("it is gone", lambda: not page.page.locator("#ask").is_visible())
    assert not console.moved_from(before)


def test_unknown_or_ambiguous_object_name_cannot_start_a_goto(visit: Callable[..., Visit]) -> None:
    """A name that nobody knows, and coordinates that can be meant in two ways, leave no target."""
    page = visit()
    page.find("m 31")
    assert page.text("#place h3") == "M31" and "Andromeda Galaxy" in page.text("#place")
    page.page.fill("#object", "Xyzzyx")
    page.page.press("#object", "Enter")
    page.until("it is said", lambda: "Xyzzyx" in page.text("#notices"))
    assert not page.page.locator("#place").is_visible()
    page.find("Capella")
    before = page.page.locator("#go").bounding_box()
    page.page.fill("#object", "Vega")
    page.until("the card of Capella starts nothing", lambda: not page.page.locator("#go, #sync").first.is_enabled())
    assert not page.page.locator("#sync").is_enabled() and page.page.locator("#search .primary").count() == 1
    assert page.page.locator("#place").get_attribute("title").startswith("Press Find")
    assert page.page.locator("#go").bounding_box() == before, "nothing jumps while one types"
    page.show("control")
    page.page.get_by_role("button", name="Sync…").click()
    page.until("neither does the pad's side", lambda: "find by name" in page.text("#notices"))
    page.show("sky")
    page.page.fill("#object", "Capella")
    page.until("it is the card's again", lambda: page.page.locator("#go").is_enabled())
    page.page.fill("#object", "5.588 -5.39")
    page.page.press("#object", "Enter")
    page.until("it asks", lambda: page.text("#asks") == "Which one: hours or degrees?")
    assert not page.page.locator("#place").is_visible()
    page.page.locator("#suggestions li").first.dispatch_event("pointerdown")
    page.until("the one that was chosen", lambda: "05h 35m 17s" in page.text("#place .equinox"))
    assert page.text("#place .equinox [aria-pressed=true]") == "of date" and page.text("#asks") == ""
    page.page.click("#place .equinox >> text=J2000")
    page.until("it is of 2000", lambda: page.text("#place .equinox [aria-pressed=true]") == "J2000")
    page.page.fill("#object", "Vega")
    page.until("its equinox is not another's", lambda: not page.page.locator("#place .equinox .chip").last.is_enabled())
    page.find("alt 60 az 180")
    page.until("that place", lambda: page.text("#place .figures").startswith("Altitude60.0°Azimuth180.0° S"))


def test_page_offers_a_similar_name_to_tap(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.page.fill("#object", "Aldebarn")
    page.page.click("#search [type=submit]")
    page.until("it is asked", lambda: page.text("#asks") == "Did you mean this?")
    page.page.locator("#suggestions li", has_text="Aldebaran").tap()
    page.until("its card", lambda: page.text("#place h3") == "Aldebaran")
    assert page.text("#asks") == "" and not page.page.locator("#suggestions").is_visible()


def test_list_of_tonights_objects_opens_a_target_and_keeps_the_users_marks(visit: Callable[..., Visit]) -> None:
    """From the list to a target; its night, its field, the observer's marks and own list, which the browser keeps."""
    page = visit(optics='{"telescope": 1000, "eyepiece": 25, "apparent": 60}')
    assert not any("deepsky" in url for url in page.asked)
    page.page.click("#tonight-button")
    rows = page.page.locator("#tonight-rows li")
    page.until("the list", lambda: rows.count() == 100)
    assert "CC-BY-SA" in page.text("#tonight") and page.text("#tonight-says").startswith("Now and within two hours")
    page.page.click("#tonight-kinds >> text=Galaxies")
    page.until("galaxies", lambda: page.text("#tonight-rows li b") == "M31")
    page.page.evaluate("document.getElementById('tonight').scrollTop = 700")
    page.page.click("#tonight-button")
    page.page.click("#tonight-button")
    page.until("where it was left", lambda: page.page.evaluate("document.getElementById('tonight').scrollTop") == 700)
    page.page.locator("#tonight-rows li button").first.click()
    page.until("its card", lambda: page.text("#place h3") == "M31")
    page.until("its night", lambda: page.page.locator("#place .curve").is_visible())
    assert "Moon" in page.text("#place .legend")
    assert re.search(r"Culminates\d\d:\d\d \S+, \d+°", page.text("#place .figures"))
    assert "178′ × 70′" in page.text("#place .kind")
    assert page.text("#field") == "Field 1.5°: it is larger"
    page.page.click("#mark-favourites")
    page.page.click("#mark-seen")
    page.until("it is marked", lambda: page.text("#mark-seen") == "✓ Seen")
    page.page.click("#tonight-button")
    page.page.click("#tonight-kinds >> text=Mine")
    page.until("the favourites", lambda: page.text("#tonight-says").endswith("horizon.") and rows.count() == 1)
    assert "1 of 1 is up. The Moon" in page.text("#tonight-says")
    page.page.click("#tonight summary")
    page.page.set_input_files("#own-file", OWN_FILE)
    page.until("the file is read", lambda: page.page.input_value("#own-list") == OWN_LIST)
    page.page.click("text=Keep this list")
    page.until("the own list", lambda: rows.count() == 5)
    texts = [row.text_content() or "" for row in rows.all()]
    assert "★ M31" in texts[0] and "✓ seen" in texts[0]
    page.until("why one is not known", lambda: "'Xyzzyx' is not a place" in (rows.nth(3).text_content() or ""))
    assert texts[4] == "5.588 -5.39Which one: hours or degrees?"
    assert "2 of 5 are up. The Moon" in page.text("#tonight-says"), "and nothing of an order, which is the user's"
    rows.nth(2).locator("button").click()
    page.until("the place of the list", lambda: "05h 34m 32s" in page.text("#place .equinox"))
    page.page.click("#tonight-button")
    page.find("Capella")  # what is found by name is seen, too
