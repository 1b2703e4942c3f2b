"""Explains a refusal to the user at a terminal: what happened, what it means, what to do.

Programs get a few words that fit a hand control's display; on a terminal there is room for the reason.
"""

from __future__ import annotations

from gateway.core import errors
from gateway.core.errors import Fault
from gateway.mount.policy import Limits

#: The explanation that follows the words for programs; the first row with the class of the fault is used.
MEANS: tuple[tuple[type[Fault] | tuple[type[Fault], ...], str], ...] = (
    (errors.BelowHorizon,
     "That is lower than the {limits.lowest:g} degrees that are allowed; wait until it has risen, or start the gateway "
     "with another --lowest."),
    (errors.WayBlocked, "From where it points now, every way to it leads beyond an altitude limit."),
    (errors.TooHigh,
     "That is higher than the {limits.highest:g} degrees that are allowed; start the gateway with another --highest if "
     "that is meant."),
    (errors.NearSun,
     "Nothing brings the tube within {limits.sun:g} degrees of the Sun while it is up; --sun changes that, for "
     "a tube with a solar filter."),
    (errors.PastMeridian, "--hour-angle-limit, with which the gateway was started, keeps the tube from the pier."),
    (errors.NotAligned, "Positions mean nothing before that: align it at the hand control, then ask again."),
    (errors.SyncTooFar,
     "A sync moves the sky, and turns an axis, by {limits.sync:g} degrees at most, all since the alignment together."),
    (errors.Asleep, "It ignores commands until it is woken: mount-gateway unpark, or its own keys."),
    ((errors.Garbled, errors.NoAnswer),
     "Is it switched on, and the cable in the hand control? mount-gateway status shows the state of the line."),
    (errors.Stopped, "A stop, or another order, came before it was done."),
    (errors.Busy, "Ask again in a moment."),
)  # fmt: skip
#: The explanation of a refusal by limits that a page has narrowed.
NARROWED = errors.BelowHorizon | errors.TooHigh | errors.WayBlocked | errors.NearSun | errors.PastMeridian
BY_PAGE = (
    "A page of the console has narrowed the limits until the gateway ends ({limits}); it can take that back under More."
)


def explain(fault: Fault, limits: Limits) -> str:
    """Return one or two sentences, beginning with the words that programs get."""
    if fault.brief:
        return str(fault)  # it says what to do
    means = next((words for kind, words in MEANS if isinstance(fault, kind)), "")
    if limits.by_page and isinstance(fault, NARROWED):
        means = BY_PAGE
    return f"{fault} {means.format(limits=limits)}" if means else str(fault)
