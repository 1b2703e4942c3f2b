"""Gives the safety rules what they may know and do; the rules themselves do not know the controller."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gateway.core import operations as op
from gateway.mount.motion.moving import Moving
from gateway.mount.readings.cache import RENEW
from gateway.mount.safety.admission.motions import Admission
from gateway.mount.safety.admission.questions import Questions
from gateway.mount.safety.at_start import doubts
from gateway.mount.safety.inputs import MountInputs
from gateway.mount.safety.rules.sync_sum import SyncSum
from gateway.mount.safety.tracking_at_limit import Actions
from gateway.mount.safety.watch import LimitWatch

if TYPE_CHECKING:
    from gateway.mount.controller import MountController


def make_rules(controller: MountController) -> tuple[LimitWatch, Admission]:
    """What watches the limits of a mount, and what decides on a motion before it begins."""

    def forget_syncs() -> None:
        controller.synced = SyncSum()

    inputs = _inputs(controller)
    actions = Actions(
        controller.begin_stop,
        lambda: controller.perform(op.SetTracking(on=False)),
        lambda: controller.read(op.GetStatus()),
        lambda: controller.reader.shared(op.GetStatus()),
        lambda: controller.spawn(controller.tube_side()),
        forget_syncs,
        controller.spawn,
    )
    watch = LimitWatch(inputs, actions, controller.ends, controller.loop)
    questions = Questions(
        lambda operation: controller.read(operation), lambda operation: controller.anew(operation), controller.tube_side
    )
    return watch, Admission(inputs, questions, watch, controller.sources, lambda: controller.synced, controller.hold)


def say_doubts(controller: MountController) -> None:
    """What does not fit together, once the mount has said who and where it is."""
    words = doubts_of(controller)
    if words:
        controller.transcript.note_once("mount", words)


def doubts_of(controller: MountController) -> str:
    """The same; nothing where all fits."""
    return doubts(_inputs(controller), controller.sources)


def _inputs(controller: MountController) -> MountInputs:
    return MountInputs(
        controller.driver,
        controller.now,
        controller.snapshot,
        controller.derived,
        controller.suns,
        lambda: _moving(controller),
        lambda: controller.policy.limits,
        lambda: controller.line.typical,
        controller.transcript,
        RENEW[op.Position],
        controller.policy.own_park,
        controller.policy.unaligned,
        lambda: controller.settings.sync.sets_sky,
    )


def _moving(controller: MountController) -> Moving:
    return Moving(controller.slewing, controller.motions.by_hand, controller.motions.ending)
