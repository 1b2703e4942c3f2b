"""What every operation is: a frozen value, generic in what the mount answers to it.

``Operation[T]`` says by its type that ``perform`` returns a T; ``Operation`` alone is one of which that is not known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Generic

from msgspec import Struct

if TYPE_CHECKING:
    from typing_extensions import TypeVar

    AnswerT = TypeVar("AnswerT", covariant=True, default=object)
else:
    from typing import TypeVar  # which has no defaults before Python 3.13; they are for type checkers alone

    AnswerT = TypeVar("AnswerT", covariant=True)

#: The named values of a frame, as its fields write and read them: numbers, texts, dates.
Values = dict[str, Any]
#: The same, frozen.
Fields = tuple[tuple[str, object], ...]


class Operation(Struct, Generic[AnswerT], frozen=True):
    """Base of all operations. What ``survives_abort`` is no motion: a stop leaves it alone."""

    survives_abort: ClassVar[bool] = False


class Read(Operation[AnswerT], frozen=True):
    """Base of the operations that change nothing; ``answers`` is the struct a driver fills from reply fields."""

    answers: ClassVar[type[Struct] | None] = None
