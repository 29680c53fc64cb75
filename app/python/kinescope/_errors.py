# SPDX-License-Identifier: Apache-2.0
"""What goes wrong, as exceptions; each is one exit code of the program."""

from __future__ import annotations

from typing import Any


class InputWarning(UserWarning):
    """What is odd about an input and was worked around."""


class Error(Exception):
    """One line that names the place, what is wrong and the remedy.

    Attributes
    ----------
    exit_code: int
        That of the program.
    result: dict or None
        What ``--json`` prints, where the command came so far.
    """

    exit_code = 1

    def __init__(self, message: str, result: dict[str, Any] | None = None):
        super().__init__(message)
        self.result = result


class InternalError(Error):
    """A mistake of Kinescope's own."""


class BadRequest(Error, ValueError):
    """An argument that makes no sense, or an output that cannot be written."""

    exit_code = 2


class BadInput(Error):
    """An input that cannot be read."""

    exit_code = 3


class Undetermined(Error):
    """The data cannot determine what was asked; says what to record instead."""

    exit_code = 4


class OutsideLimits(Error):
    """Done, but outside limits set with ``fail_on``."""

    exit_code = 5


_CLASSES = {
    kind.exit_code: kind
    for kind in (InternalError, BadRequest, BadInput, Undetermined, OutsideLimits)
}


def error_of(code: int, message: str, result: dict[str, Any] | None = None) -> Error:
    return _CLASSES.get(code, InternalError)(message, result)
