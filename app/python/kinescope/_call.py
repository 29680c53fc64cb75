# SPDX-License-Identifier: Apache-2.0
"""A command's arguments as the words of its command line, and its result."""

from __future__ import annotations

import json
import numbers
import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Union

from . import _kinescope
from ._errors import InputWarning, error_of

Value = Union[str, "os.PathLike[str]", int, float]
Values = Union[Value, Sequence[Value]]
Progress = Callable[[str, int, int], Any]


def _is_single(value: Any) -> bool:
    return isinstance(value, (str, bytes, os.PathLike, numbers.Real))


def _word(value: Any) -> str:
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        return repr(float(value))
    if isinstance(value, (str, bytes, os.PathLike)):
        word = os.fsdecode(value)
        if "\0" not in word:
            return word
        raise error_of(2, f"{word!r} holds a character of code 0 (leave it out)")
    raise TypeError(f"{value!r} is no text, path or number")


def commas(values: Any) -> str | None:
    """Several values as one word."""
    if values is None or _is_single(values):
        return values
    return ",".join(_word(value) for value in values)


def _option(name: str, value: Any) -> Iterable[str]:
    if value is None or value is False:
        return []
    if value is True:
        return [name]
    words = [_word(value)] if _is_single(value) else [_word(one) for one in value]
    # A value that looks like an option must stand in its option's word.
    return [
        part
        for word in words
        for part in ([f"{name}={word}"] if word.startswith("-") else [name, word])
    ]


def _positionals(values: Sequence[Any]) -> list[str]:
    words = []
    for value in values:
        words += [_word(value)] if _is_single(value) else [_word(one) for one in value]
    return ["--", *words] if any(word.startswith("-") for word in words) else words


def _problems(result: dict[str, Any] | None) -> str:
    return "; ".join((result or {}).get("problems", [])) or "no result"


def call(
    command: str,
    positionals: Sequence[Any],
    options: Sequence[tuple[str, Any]],
    progress: Progress | None,
) -> dict[str, Any]:
    named = [word for name, value in options for word in _option(name, value)]
    places = _positionals(positionals)
    words = [command, *named, *places] if "--" in places else [command, *places, *named]
    code, message, text, warned = _kinescope.call([os.fsencode(word) for word in words], progress)
    result = json.loads(text) if text else None
    for warning in warned:
        warnings.warn(warning, InputWarning, stacklevel=3)
    if code != 0:
        raise error_of(code, message or _problems(result), result)
    return result
