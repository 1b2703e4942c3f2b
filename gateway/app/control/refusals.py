"""A refusal in words for a person at the keyboard: what happened, what it means, what to do.

Programs are told a few words that fit a hand control's display; whoever sits at a terminal has room for the reason.
"""

from __future__ import annotations

from gateway.core import errors
from gateway.core.errors import Fault
from gateway.mount.policy import Limits


def no(fault: Fault, limits: Limits) -> str:
    """One or two sentences, beginning with what the gateway tells programs."""
    found = _means(fault, limits)
    return f"{fault} {found}" if found else str(fault)


def _means(fault: Fault, limits: Limits) -> str:
    match fault:
        case errors.BelowHorizon():
            return (
                f"It lies, or the way to it leads, lower than the {limits.lowest:g} degrees that are allowed; wait "
                "until it has risen, or start the gateway with another --lowest."
            )
        case errors.TooHigh():
            return (
                f"It lies, or the way to it leads, higher than the {limits.highest:g} degrees that are allowed; "
                "start the gateway with another --highest if that is meant."
            )
        case errors.NearSun():
            return (
                f"Nothing brings the tube within {limits.sun:g} degrees of the Sun while it is up; --sun changes "
                "that, for somebody with a filter on the tube."
            )
        case errors.PastMeridian():
            return "--hour-angle-limit, with which the gateway was started, keeps the tube from the pier."
        case errors.NotAligned():
            return "Positions mean nothing before that: align it at the hand control, then ask again."
        case errors.SyncTooFar():
            return (
                f"A sync moves the sky by {limits.sync:g} degrees at most, all since the alignment together: align "
                "the mount anew, or start the gateway with another --sync-limit."
            )
        case errors.Held():
            return "Nothing moves it until then."
        case errors.Asleep():
            return "It hears nothing until it is woken: mount-gateway unpark, or its own keys."
        case errors.Garbled() | errors.NoAnswer():
            return "Is it switched on, and the cable in the hand control? mount-gateway status tells how the line is."
        case errors.Stopped():
            return "A stop, or another order, came before it was done."
        case errors.Busy():
            return "Ask again in a moment."
        case errors.Unsupported() if str(fault) == errors.Unsupported.words:
            return "mount-gateway tables lists what this model and version can do."
    return ""
