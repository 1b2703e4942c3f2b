"""The conversation of both sides: paired, filtered, harmless; and a recording that the browser fetches."""

from __future__ import annotations

from collections.abc import Callable

from playwright.sync_api import Download

from .page import DESK, Console, Program, Visit

HOSTILE = b"<img src=x onerror=alert(1)><script>alert(2)</script>#"


def test_conversation_shows_each_command_beside_its_translation(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit(DESK)
    page.show("talk")
    with console.program() as program:
        page.listens(program)
        program.say(b":RS#:Mn#")
        rows = page.page.locator(".exchange", has_text=":Mn#")
        page.until("it is shown", lambda: rows.count() == 1)
        page.until("and what it became", lambda: "P\\x02" in (rows.locator(".mount-side").text_content() or ""))
        assert program.name in (rows.text_content() or "")
        program.say(b":Q#")


def test_protocol_log_is_shown_after_the_page_is_reloaded(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("talk")
    page.page.reload()
    with console.program() as program:
        page.listens(program)


def test_refusals_filter_shows_refusals_only(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("talk")
    with console.program() as program:
        page.listens(program)
        program.say(b":Sr18:37:00#:Sd-70*00:00#", 2)
        program.say(b":MS#", 5)
        page.until("all is shown", lambda: page.page.locator(".exchange").count() >= 3)
        page.page.get_by_role("radio", name="Refusals").click()
        page.until("only the refusal is", lambda: page.page.locator(".exchange").count() == 1)
        words = page.text(".exchange")
        assert ":MS#" in words and "below the lowest altitude" in words
        page.page.get_by_role("radio", name="Programs").click()
        page.page.get_by_label("Show only exchanges with this text").fill(":Sd")
        page.until("only that is", lambda: page.page.locator(".exchange").count() == 1)


def test_protocol_log_on_the_page_pauses_and_resumes(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("talk")
    with console.program() as program:
        page.listens(program)
        page.page.get_by_role("button", name="Pause").click()
        program.say(b":GVP#", 5)
        page.page.wait_for_timeout(600)
        assert page.page.locator(".exchange", has_text=":GVP#").count() == 0
        page.page.get_by_role("button", name="Go on").click()
        page.until(
            "what came meanwhile is shown", lambda: page.page.locator(".exchange", has_text=":GVP#").count() == 1
        )


def test_conversation_is_copied_to_the_clipboard(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("talk")
    with console.program() as program:
        page.listens(program)
        program.say(b":GVP#", 5)
        page.until("it is shown", lambda: page.page.locator(".exchange", has_text=":GVP#").count() == 1)
    page.page.evaluate(
        "document.addEventListener('copy', () => { window.copied = String(document.activeElement.value) })"
    )
    page.page.evaluate(
        "Object.defineProperty(navigator, 'clipboard', {value: undefined})"
    )  # as in a page of the network
    page.page.get_by_role("button", name="Copy").click()
    page.until("it is said", lambda: page.text("#notices").startswith("Copied"))
    assert ":GVP#" in page.page.evaluate("window.copied")


def test_markup_sent_by_a_program_is_shown_as_text(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("talk")
    with console.program() as program:
        page.listens(program)
        program.say(HOSTILE)
        program.say(b":GVP#", 5)
        page.until("it is shown", lambda: "<img src=x" in page.text("#conversation"))
        page.show("readings")
        page.until("the program is told of", lambda: program.name in page.text("#readings"))
    assert page.page.locator("main img").count() == page.page.locator("main script").count() == 0
    # a dialog would stand among the page's faults


def test_page_explains_a_command_of_the_conversation(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("talk")
    page.page.fill("#command", ":GR#")
    page.page.press("#command", "Enter")
    page.until("it is explained", lambda: "right ascension of the telescope" in page.text("#explained"))


def test_page_downloads_a_recording_and_its_report(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("talk")
    reports = page.page.get_by_role("button", name="Report", exact=True)

    def record(program: Program | None = None) -> None:
        page.page.click("#record")
        page.until("it runs", lambda: page.text("#record").startswith("End recording"))
        if program is not None:
            program.say(b":GR#", 9)
        with page.page.expect_download() as recording:
            page.page.click("#record")
        path = recording.value.path()
        assert recording.value.suggested_filename.endswith(".rec") and path.stat().st_size > 0
        page.until("it has ended", lambda: page.text("#record") == "Record")

    fetched: list[Download] = []
    page.page.on("download", lambda download: fetched.append(download))

    def told() -> bool:
        return "nothing happened in this recording" in page.text("#notices")

    for _ in range(20):  # on a busy computer something may happen meanwhile: the gateway reads the mount
        record()
        fetched.clear()
        reports.click()
        page.until("a report, or why there is none", lambda: fetched or told())
        if told():
            break
    assert told() and not fetched
    page.faults = [fault for fault in page.faults if "409 (Conflict)" not in fault]
    with console.program() as program:
        record(program)
    with page.page.expect_download() as report:
        reports.click()
    assert report.value.suggested_filename.endswith(".html")
    assert "<title>" in report.value.path().read_text("utf-8")
