"""What the log says of settings: which have gone to the mount and by whom, which are kept here, which were lost."""

from __future__ import annotations

from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.safety.admission.contradictions import contradiction_warning, site_text
from gateway.mount.site.pending_settings import Setting

_NAMES: dict[type[op.Operation], str] = {
    op.SetSite: "site",
    op.SetClock: "clock",
    op.SetGuideRate: "guide rate",
    op.Backlash: "backlash",
    op.PeriodicError: "periodic error correction",
}


def name(operation: op.Operation) -> str:
    return _NAMES[type(operation)]


def note(mount: Context, operation: op.Operation, text: str) -> None:
    """Log what has become of a setting."""
    mount.note(f"the {name(operation)} that was set: {text}")


def note_kept(mount: Context, setting: Setting, why: str) -> None:
    """Log, once for each host, that the mount does not get a site or clock."""
    mount.note_once(
        f"{why}: the {name(setting.value)} that was set is kept in the gateway, for {setting.by or 'this computer'} "
        "alone; everyone else reads the mount's"
    )


def note_set(mount: Context, setting: Setting, ahead: float | None = None) -> None:
    """Log who has set the mount's site, or its clock (``ahead`` by so many seconds), and what contradicts it."""
    by, value = setting.by or "the gateway", setting.value
    if isinstance(value, op.SetSite) and value.latitude is not None and value.longitude is not None:
        mount.note(
            f"{by} has set the mount's site, for everyone: {site_text(op.Place(value.latitude, value.longitude))}"
        )
    elif ahead is not None:
        mount.note(f"{by} has set the mount's clock, for everyone: {ahead:+.0f} s")
    if warning := contradiction_warning(mount):
        mount.note_once(warning)
