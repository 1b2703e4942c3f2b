"""Explains a refusal to the user at a terminal: what happened, what it means, what to do.

Programs get a few words that fit a hand control's display; on a terminal there is room for the reason.
"""

from __future__ import annotations

from gateway.core import errors
from gateway.core.errors import Fault
from gateway.mount.policy import Limits

#: The explanation that follows the words for programs; the first row with the class of the fault is used.
MEANS: tuple[tuple[type[Fault] | tuple[type[Fault], ...], str], ...] = (
    (errors.WayBlocked, "Every way there from where it points now leads beyond an altitude limit."),
    (errors.NearSun,
     "By day the gateway keeps the tube {limits.sun:g}° from the Sun; with a solar filter, --sun changes that."),
    (errors.PastMeridian, "The hour angle limit keeps the tube from the pier."),
    (errors.NotAligned, "Align it at the hand control, then ask again."),
    (errors.SyncTooFar, "All syncs since the last alignment may add up to {limits.sync:g}°."),
    (errors.Asleep, "It ignores commands until it is woken: mount-gateway unpark, or its own keys."),
    ((errors.Garbled, errors.NoAnswer),
     "Is it switched on, and the cable in the hand control? mount-gateway status shows the state of the line."),
    (errors.Stopped, "A stop or another order came before it was done."),
    (errors.Busy, "Ask again in a moment."),
)  # fmt: skip
#: The explanation of a refusal by limits that a page has narrowed.
NARROWED = errors.BelowHorizon | errors.TooHigh | errors.WayBlocked | errors.NearSun | errors.PastMeridian
BY_PAGE = (
    "A page of the console has narrowed the limits until the gateway ends ({limits}); it can take that back under More."
)


def explain(fault: Fault, limits: Limits) -> str:
    """Return one or two sentences, beginning with the words that programs get."""
    means = next((words for kind, words in MEANS if isinstance(fault, kind)), "")
    if limits.by_page and isinstance(fault, NARROWED):
        means = BY_PAGE
    elif fault.brief:
        return str(fault)  # it says what to do
    return f"{fault} {means.format(limits=limits)}" if means else str(fault)
