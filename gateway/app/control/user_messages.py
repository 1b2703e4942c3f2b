"""Messages for the user, one line each: some when the mount is identified, and one when the gateway ends.

Those for an identified mount say what was found, whose site and clock are in use, and then what does not fit, the most
serious last: another model than the user named, a mount not aligned, sites and clocks that contradict each other.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from msgspec import Struct

from gateway.app.mount_state import RECENT_AGE, mount_state
from gateway.core import operations as op
from gateway.mount.controller import MountController
from gateway.mount.safety.admission.contradictions import contradiction_warning
from gateway.mount.safety.hour_angle import NO_LIMIT_MESSAGE


class UserMessage(Struct, frozen=True):
    """A message, or a warning about which the user should do something."""

    text: str
    is_warning: bool = False


def first_messages(controller: MountController, model: str | None, version: str | None) -> Iterator[UserMessage]:
    """Yield the messages for an identified mount; ``model`` and ``version`` are those that the user named, or None."""
    state = mount_state(controller)
    identity, status = state.identity, state.look.status
    if identity is None:
        return
    yield UserMessage(f"found {state.to_state().identity_text}")
    where = f"site {state.site}" if state.site else "site not known (--site LAT,LON sets it)"
    yield UserMessage(f"{where}; clock {state.time or 'not known'}")
    if warning := _model_warning(controller, identity, model, version):
        yield UserMessage(warning, is_warning=True)
    if status is not None and not status.aligned:
        yield UserMessage(
            "the mount is not aligned, so its position and limits mean nothing yet; align it at its hand control",
            is_warning=True,
        )
    if not state.site:
        yield UserMessage(
            "the site is not known: gotos are not checked against the horizon, and a program that asks for it or for "
            "the sidereal time gets no answer; --site LAT,LON sets it (north and east are positive)",
            is_warning=True,
        )
    if state.german and state.policy.limits.hour_angle is None:
        yield UserMessage("hour-angle-limit is not set: nothing keeps the tube of this German mount from its pier")
    if state.policy.limits.hour_angle is not None and not state.can_enforce_hour_angle:
        yield UserMessage(NO_LIMIT_MESSAGE, is_warning=True)
    if warning := contradiction_warning(controller.context):
        yield UserMessage(warning.removeprefix("WARNING: "), is_warning=True)


def _model_warning(controller: MountController, identity: op.Identity, model: str | None, version: str | None) -> str:
    """Return the warning about a named model or version that the mount contradicts; empty if none."""
    reported = controller.driver.reported_model(identity)
    if model is not None and reported is not None and reported != model:
        return f"you named the mount {model}, and it reports {reported}: leave the model out, or write {reported}"
    if version is not None and identity.version[:1].isdecimal() and _numbers(version) != _numbers(identity.version):
        return f"you gave the hand control version {version}, and it reports {identity.version}: leave the version out"
    return ""


def _numbers(version: str) -> list[int]:
    """Return the numbers of a version: ``starsense-1.20`` and ``1.20`` are the same."""
    return [int(number) for number in re.findall(r"\d+", version)]


def last_message(controller: MountController, was_moving: bool) -> UserMessage | None:
    """Return the message at the end, None if no mount was found; ``was_moving``: there was a motion to stop."""
    state = mount_state(controller)
    status = state.look.status
    if state.identity is None:
        return None
    if state.wanted.stop_owed:
        return UserMessage(
            "the mount has not acknowledged the stop: look at it, and switch it off if it moves", is_warning=True
        )
    outcome = "stopped the mount" if was_moving else "the mount was not moving"
    if status is None:
        return UserMessage(outcome)
    how, age = (
        "off" if status.tracking is op.Tracking.OFF else "on",
        controller.cache.age(op.GetStatus, controller.now()),
    )
    return UserMessage(
        f"{outcome}; tracking is {how}" if age <= RECENT_AGE else f"{outcome}; tracking was {how} at its last report"
    )
