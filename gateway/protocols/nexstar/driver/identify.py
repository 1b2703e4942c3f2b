"""Identify the hand control and the mount: ask for the version first, then use only commands of that version."""

from __future__ import annotations

from gateway.core.errors import Fault, NoDevice
from gateway.core.operations import Identity, Operation, Tracking
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.nexstar.driver.state import NexStar
from gateway.protocols.nexstar.driver.tracking import read_status
from gateway.protocols.nexstar.versions import GT_FROM, STARSENSE_END, STARSENSE_OLDEST, STARSENSE_VARIANT, counts_as
from gateway.protocols.wireformat.rows import format_version

#: From this version on a hand control may be a StarSense as well.
MAYBE_STARSENSE_FROM = (5, 28)
#: Numbers of the devices on the mount's bus: both motors and the focuser.
AZM, ALT, FOCUSER = 16, 17, 18
#: Devices that may be on the bus of a hand control too old to report its model.
DEVICE_BY_PART = {"gps": 176, "rtc": 178}


def identity(mount: NexStar, _: Operation) -> Steps:
    """Read version, variant, model and motor firmware, then the mount's status. Return Identity."""
    answer = yield Send("V")
    raw = tuple(answer.values())
    mount.dialect = "synscan" if "patch" in answer else None
    mount.version_text = format_version(raw)
    mount.version, mount.reported_version, mount.starsense = raw, raw, False
    if STARSENSE_OLDEST <= raw < STARSENSE_END or MAYBE_STARSENSE_FROM <= raw < (GT_FROM,):
        yield from _detect_starsense(mount)
    mount.version = counts_as(raw, starsense=mount.starsense, synscan=mount.dialect is not None)
    if raw[0] >= GT_FROM:
        mount.model = mount.named_model or "gt"
    elif mount.supports("m"):
        yield from _read_model(mount)
    if mount.supports("device_version"):
        yield from _read_motor_versions(mount)
    yield from read_status(mount)
    if mount.tracking not in (None, Tracking.OFF):
        mount.parked = False  # remembered from an earlier run; it has been unparked meanwhile
    maker = mount.model_facts.get("maker", "Celestron")
    hand_control = "StarSense" if mount.starsense else mount.model_facts.get("hand_control", "NexStar")
    motors = tuple(format_version(version) for version in mount.firmware.values())
    return Identity(
        product=f"{maker} {hand_control}", version=mount.version_text, model=mount.model or "unknown", motors=motors
    )


def _detect_starsense(mount: NexStar) -> Steps:
    """Find out whether this is a StarSense, whose versions begin at 1.18 though it has all modern commands.

    No other hand control used those numbers: one with such a number that is silent on ``v`` is hibernating.
    """
    try:
        mount.starsense = (yield Send("v"))["variant"] == STARSENSE_VARIANT
    except Fault:
        mount.starsense = mount.version is not None and mount.version < STARSENSE_END


def _read_model(mount: NexStar) -> Steps:
    answer = yield Send("m")
    mount.model_number = answer["model"]
    mount.model = mount.model_by_number(answer["model"]) or f"unknown ({answer['model']})"


def _read_motor_versions(mount: NexStar) -> Steps:
    for device in (AZM, ALT, FOCUSER) if mount.supports("move_pos") else (AZM, ALT):
        try:
            answer = yield Send("device_version", {"device": device})
        except Fault:
            continue
        version = (answer["major"], answer["minor"])
        if device == FOCUSER:
            mount.has_focuser = version != (0, 0)
        else:
            mount.firmware[device] = version
    if mount.model is None:
        for part, device in DEVICE_BY_PART.items():
            try:
                yield Send("device_version", {"device": device})
            except NoDevice:
                continue
            mount.found_parts.add(part)
