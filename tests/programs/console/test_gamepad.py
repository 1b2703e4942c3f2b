"""A gamepad at the page: an arrow while its shoulder button is held, and none when it or the focus is lost."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from .page import Console, Visit

PAD = """
window.pad = { index: 0, mapping: 'standard', axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
navigator.getGamepads = () => (window.gone ? [null] : [window.pad]);
"""
HOLD = "(pad.axes = [0, -1, 0, 0], pad.buttons[5] = { pressed: true, value: 1 })"
#: What ends it, besides its release.
LOSSES = {
    "release": "pad.buttons[5] = { pressed: false, value: 0 }",
    "unplugged": "(window.gone = true, dispatchEvent(new Event('gamepaddisconnected')))",
    "focus": "(document.hasFocus = () => false)",
    "STOP": "pad.buttons[1] = { pressed: true, value: 1 }",
}


@pytest.mark.parametrize("loss", LOSSES)
def test_it_moves_while_its_shoulder_button_is_held(console: Console, visit: Callable[..., Visit], loss: str) -> None:
    page = visit()
    page.show("control")
    page.page.evaluate(f"{PAD}; dispatchEvent(new Event('gamepadconnected'))")
    page.page.wait_for_timeout(150)
    start = console.truth.position()
    page.page.evaluate(HOLD)
    page.until("it moves", lambda: console.moved_from(start))
    page.page.evaluate(LOSSES[loss])
    console.at_rest()
