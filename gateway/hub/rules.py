"""Hands the rules that keep a mount within its limits what they may know and do; they themselves know no hub."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gateway import operations as op
from gateway.hub.snapshot import RENEW
from gateway.mount.motion.moving import Moving
from gateway.mount.safety.admission import Admission
from gateway.mount.safety.at_start import doubts
from gateway.mount.safety.inputs import MountInputs
from gateway.mount.safety.questions import Questions
from gateway.mount.safety.sync_sum import SyncSum
from gateway.mount.safety.tracking_at_limit import Actions
from gateway.mount.safety.watch import LimitWatch

if TYPE_CHECKING:
    from gateway.hub.core import Hub


def make_rules(hub: Hub) -> tuple[LimitWatch, Admission]:
    """What watches the limits of a mount, and what decides on a motion before it begins."""

    def forget_syncs() -> None:
        hub.synced = SyncSum()

    inputs = _inputs(hub)
    actions = Actions(
        hub.begin_stop, lambda: hub.perform(op.SetTracking(on=False)), lambda: hub.read(op.GetStatus()),
        lambda: hub.reader.shared(op.GetStatus()), lambda: hub.spawn(hub.tube_side()), forget_syncs, hub.spawn)
    watch = LimitWatch(inputs, actions, hub.ends, hub.loop)
    questions = Questions(lambda operation: hub.read(operation), lambda operation: hub.anew(operation), hub.tube_side)
    return watch, Admission(inputs, questions, watch, hub.sources, lambda: hub.synced, hub.hold)


def say_doubts(hub: Hub) -> None:
    """What does not fit together, once the mount has said who and where it is."""
    words = doubts_of(hub)
    if words:
        hub.transcript.note_once("mount", words)


def doubts_of(hub: Hub) -> str:
    """The same; nothing where all fits."""
    return doubts(_inputs(hub), hub.sources)


def _inputs(hub: Hub) -> MountInputs:
    return MountInputs(
        hub.driver, hub.now, hub.snapshot, hub.derived, hub.suns, lambda: _moving(hub), lambda: hub.policy.limits,
        lambda: hub.line.typical, hub.transcript, RENEW[op.Position], hub.policy.own_park, hub.policy.unaligned,
        lambda: hub.settings.sync.sets_sky)


def _moving(hub: Hub) -> Moving:
    return Moving(hub.slewing, hub.motions.by_hand, hub.motions.ending)
