"""The exceptions that the gateway raises on purpose, in two families.

A ``UserError`` is a mistake in what a person typed (one line on stderr, exit code 2). A ``Fault`` is an operation that
was not carried out; the client's user reads its text. In ``commands.toml``, a reply that reports a fault names
its class with ``fault = "…"``.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable
from pathlib import Path

_FOLDER_REMEDY = "choose a folder that you may write to, or run this as its owner"
_DISK_REMEDY = "free space on that disk (df -h shows which is full), or choose a folder on another disk"
#: Error of the system -> what to do about it.
_REMEDY_BY_ERRNO = {
    errno.EACCES: _FOLDER_REMEDY, errno.EPERM: _FOLDER_REMEDY, errno.ENOSPC: _DISK_REMEDY, errno.EDQUOT: _DISK_REMEDY,
    errno.EROFS: "choose a folder on a disk that can be written to",
}  # fmt: skip


class GatewayError(Exception):
    """Base of every error that the gateway raises on purpose."""


class UserError(GatewayError):
    """Bad input from a person. The text gives the mistake, its place, and the correction."""

    #: The exit code of a command that ends with this error.
    exit_code = 2


class SunIsNoGoal(UserError):
    """The user named the Sun as a target. The input is valid, so the exit code is that of a refusal."""

    exit_code = 1


def explain_os_error(error: OSError) -> str:
    """Return what the system says of an error, and what to do about it if that is known."""
    text = error.strerror or str(error)
    return f"{text}; {step}" if (step := _REMEDY_BY_ERRNO.get(error.errno or 0)) else text


def explain_file_error(path: Path | str, error: OSError, *, reading: bool = False) -> str:
    """Return why a file cannot be written (with ``reading``: cannot be read), and what to do about it."""
    folder = Path(path).parent
    if error.errno == errno.ENOENT and not folder.is_dir():
        return f"there is no folder {folder}; make it first, or name another one"
    if error.errno == errno.ENOENT:
        return "there is no such file"
    if error.errno == errno.EISDIR:
        return "this is a folder: write the name of a file in it"
    if error.errno in (errno.EEXIST, errno.ENOTDIR):
        return "this is a file, and a folder is needed"
    if reading and error.errno == errno.EACCES:
        return f"{error.strerror}; ls -l {path} shows whose it is: run this as that user, or let yours read it"
    return explain_os_error(error)


def similar_words(word: str, candidates: Iterable[str], max_count: int = 1, min_similarity: float = 0.6) -> list[str]:
    """Return at most ``max_count`` candidates similar to a word, nearest first; ``min_similarity`` is from 0 to 1."""
    from difflib import get_close_matches  # imported here because only a mistake needs it

    return get_close_matches(word, list(candidates), max_count, min_similarity)


class MappingError(UserError):
    """A row of ``mappings/`` that cannot be used. The text names the file, the row and the reason."""

    def __init__(self, file: str, row: str, reason: str) -> None:
        super().__init__(f"{file}: [{row}]: {reason}")


class Fault(GatewayError):
    """An operation that was not carried out; ``str(fault)`` is the text for the client's user."""

    default_text = "Not possible."
    #: A longer explanation for a terminal or a page; {sun} and {sync} stand for the limits in degrees.
    explanation = ""
    #: Seconds that the mount took to reply, if the refusal is the mount's.
    reply_seconds = 0.0
    #: Whether the command may have reached the mount.
    is_sent = True

    #: Whether the log already shows and counts it as a refusal.
    is_logged = False

    #: A short text, at most 60 characters, for programs that show no more; the whole text then also says what to do.
    brief = ""

    def __init__(self, text: str | None = None, brief: str = "") -> None:
        super().__init__(text or self.default_text)
        if text or brief:
            self.brief = brief

    def with_summary(self, summary: str) -> str:
        """Return ``summary``, a colon and this error's text; the text alone if it already begins with ``summary``."""
        return str(self) if str(self).startswith(summary) else f"{summary}: {self}"


class Invalid(Fault):
    """A value outside its range, or a field that cannot be read."""

    default_text = "Invalid value."


class Disturbed(Fault):
    """A motion command was refused because the command before it was truncated: more bytes may have been lost."""

    default_text = "A command before this one was damaged."


class NoTarget(Fault):
    """A goto or sync without a target: none was set, or the last target was refused."""

    default_text = "No target set."


class BelowHorizon(Fault):
    """The target is lower than the lowest altitude allowed."""

    default_text = "Object Below Horizon."


class TooHigh(Fault):
    """The target is higher than the highest altitude allowed."""

    default_text = "Object Below Higher."


class WayBlocked(TooHigh):
    """The target is allowed, but every path to it leads beyond an altitude limit; the text says where to slew first.
    Protocols that distinguish too low from too high reply that the target is too high.
    """

    default_text = "The way there leaves the limits."


class NearSun(Fault):
    """The target, or the path to it, is nearer to the Sun than the operator allows."""

    default_text = "Too close to the Sun."
    explanation = "By day the gateway keeps the tube {sun:g}° from the Sun; with a solar filter, --sun changes that."


class Contradicted(Fault):
    """The sources of site and time disagree: one puts the target within the altitude limits, another beyond them."""

    default_text = "Site or time is doubtful."


class PastMeridian(Fault):
    """The target is farther from the meridian than the operator's limit of the hour angle."""

    default_text = "Beyond the hour angle limit."
    explanation = "The hour angle limit keeps the tube from the pier."


class NotAligned(Fault):
    """The hand control is not aligned, so its coordinates mean nothing."""

    default_text = "Mount not aligned."
    explanation = "Align it at the hand control, then try again."


class SyncTooFar(Fault):
    """A sync, or the sum of all since the alignment, exceeds ``sync_limit``, and the sync does not reduce that sum."""

    default_text = "Sync too far from present position."
    explanation = "All syncs since the last alignment may add up to {sync:g}°."


class Stopped(Fault):
    """A stop, or another request, ended the motion, or came before it could be started."""

    default_text = "Stopped."
    explanation = "A stop or another request came first."


class Unsupported(Fault):
    """This mount, or this version of its hand control, does not support the operation."""

    default_text = "Not possible on this mount."


class NoAnswer(Fault):
    """The mount did not reply, or its line is lost."""

    default_text = "No answer from mount."
    explanation = (
        "Is it switched on, and the cable in the hand control? mount-gateway status shows the state of the line."
    )


class Asleep(NoAnswer):
    """The mount hibernates: the command was not sent, because the mount would not answer."""

    default_text = "The mount is asleep."
    explanation = "Unpark it, or wake it at the hand control."


class Garbled(NoAnswer):
    """The mount sent bytes that are not a valid reply to the request."""

    default_text = "Garbled answer from the mount."


class Silence(Fault):
    """No reply to a request that a mount of this kind may leave unanswered."""

    default_text = "The mount does not know this command."


class Held(Fault):
    """The user holds the mount with ``mount-gateway stop --hold``: no client moves it until the user releases it."""

    default_text = "The mount is held: release it first (mount-gateway stop --release)."
    brief = "The mount is held: type mount-gateway stop --release."


class Busy(Fault):
    """The mount cannot take this command now: it replied so (LX200GPS, NAK), or it is known to be busy."""

    default_text = "The mount is busy."
    explanation = "Try again in a moment."


class NoDevice(Fault):
    """The hand control answered, but the device it was asked to reach did not."""

    default_text = "No such device on the mount."


class ReadOnly(Fault):
    """The client may read, and stop the mount, but neither move it nor set anything."""

    default_text = "Read only."


class NotFromNetwork(Fault):
    """A network client sent a command that network clients may send only if the operator allows it."""

    default_text = "Not allowed over a network."


class Refused(Fault):
    """The mount itself, or a check of the gateway, refused the operation."""

    default_text = "Refused by the mount."
