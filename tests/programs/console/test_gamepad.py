"""A gamepad at the page: an arrow while its shoulder button is held, and none when it or the focus is lost."""

from __future__ import annotations

from collections.abc import Callable

from ..sky import Spot
from .page import Console, Visit

PAD = """
window.pad = { index: 0, mapping: 'standard', axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
navigator.getGamepads = () => (window.gone ? [null] : [window.pad]);
"""
HOLD = "(pad.axes = [0, -1, 0, 0], pad.buttons[5] = { pressed: true, value: 1 })"
SHOWN = "Object.defineProperty(document, 'hidden', { value: false, configurable: true })"
#: What ends it, besides its release.
LOSSES = {
    "release": "pad.buttons[5] = { pressed: false, value: 0 }",
    "unplugged": "(window.gone = true, dispatchEvent(new Event('gamepaddisconnected')))",
    "STOP": "pad.buttons[1] = { pressed: true, value: 1 }",
    "hidden": "(Object.defineProperty(document, 'hidden', { value: true, configurable: true }), "
    "document.dispatchEvent(new Event('visibilitychange')))",
    "focus": "(document.hasFocus = () => false)",
}


def test_gamepad_moves_the_mount_only_while_its_shoulder_button_is_held(
    console: Console, visit: Callable[..., Visit]
) -> None:
    page = visit()
    page.page.evaluate("() => { navigator.getGamepads = () => (window.asked = true, []) }")
    page.show("more")
    page.page.wait_for_timeout(500)
    assert not page.page.evaluate("window.asked"), "a browser that is asked for gamepads looks for them all the time"
    page.page.get_by_role("button", name="Use a gamepad here").click()
    page.show("control")
    for loss in LOSSES.values():
        start = console.truth.position()

        def held(at: Spot = start) -> bool:
            """Whether it moves; once more where the page was too busy to see the stick at rest before."""
            page.page.evaluate(f"{PAD}; window.gone = false; {SHOWN}; dispatchEvent(new Event('gamepadconnected'))")
            page.page.wait_for_timeout(150)
            page.page.evaluate(HOLD)
            for _ in range(50):
                page.page.wait_for_timeout(100)
                if console.moved_from(at):
                    return True
            return False

        page.until("it moves", held)
        page.page.evaluate(loss)
        console.at_rest()
