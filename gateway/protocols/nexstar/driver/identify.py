"""Finding out which hand control and which mount this is: version first, then only what that version has."""

from __future__ import annotations

from gateway.driver import Ask, Steps
from gateway.errors import Fault, NoDevice
from gateway.operations import Identity, Operation, Tracking
from gateway.protocols.nexstar.driver.state import NexStar
from gateway.protocols.nexstar.driver.tracking import read_status
from gateway.tables import show_version

STARSENSE, STARSENSE_BEFORE = 19, (2, 0)
#: What a GT hand control's number stands for, by the manual: before 104.0 treat it as 1.2, from then on as 4.03.
GT_OLD, GT_NEW = (1, 2), (4, 3)
AZM, ALT, FOCUSER = 16, 17, 18
#: What a hand control too old to tell its model may have behind it.
PARTS = {"gps": 176, "rtc": 178}


def identity(mount: NexStar, _: Operation) -> Steps:
    """Get Version, variant, model, motor firmware; then how the mount stands. -> Identity."""
    answer = yield Ask("V")
    raw = (answer["major"], answer["minor"])
    mount.version_text = show_version(raw)
    mount.version = raw
    if raw[0] >= 100:
        mount.version = GT_NEW if raw[0] >= 104 else GT_OLD
        mount.model = mount.named_model or "gt"
    elif (raw[0] == 1 and raw[1] >= 18) or raw >= (5, 28):
        yield from _variant(mount)
    if mount.knows("m") and raw[0] < 100:
        yield from _model(mount)
    if mount.knows("device_version"):
        yield from _motors(mount)
    yield from read_status(mount)
    if mount.tracking not in (None, Tracking.OFF):
        mount.parked = False  # remembered from an earlier run, and meanwhile taken up again by somebody
    return who(mount)


def who(mount: NexStar) -> Identity:
    """The mount in words."""
    variant = "StarSense" if mount.starsense else "NexStar"
    motors = tuple(show_version(version) for version in mount.motors.values())
    return Identity(product=f"Celestron {variant}", version=mount.version_text, model=mount.model or "unknown",
                    motors=motors)


def _variant(mount: NexStar) -> Steps:
    """A StarSense counts its versions from 1.18 on, yet has everything a modern hand control has.

    Nothing else has counted there, so one that does not say what it is hibernates.
    """
    try:
        starsense = (yield Ask("v"))["variant"] == STARSENSE
    except Fault:
        starsense = mount.version is not None and mount.version < STARSENSE_BEFORE
    if starsense:
        mount.starsense = True
        mount.version = (4, 21)


def _model(mount: NexStar) -> Steps:
    answer = yield Ask("m")
    by_id = {row["id"]: name for name, row in mount.protocol.models.items()}
    mount.model = by_id.get(answer["model"], f"unknown ({answer['model']})")


def _motors(mount: NexStar) -> Steps:
    for device in (AZM, ALT, FOCUSER):
        try:
            answer = yield Ask("device_version", {"device": device})
        except Fault:
            continue
        version = (answer["major"], answer["minor"])
        if device == FOCUSER:
            mount.focuser = version != (0, 0)
        else:
            mount.motors[device] = version
    if mount.model is None:
        for part, device in PARTS.items():
            try:
                yield Ask("device_version", {"device": device})
            except NoDevice:
                continue
            mount.found.add(part)
