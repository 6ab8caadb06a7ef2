"""Faults of a scene: how one is worded, where it stands, and how all of them become one `InputError`."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from warp_caustics.errors import InputError

#: Longest value that a message repeats; more would hide the message.
LONGEST_SHOWN: Final = 60
_BARE_KEY: Final = re.compile(r"[A-Za-z0-9_-]+")

Location = tuple[int | str, ...]


def fault(message: str, location: Location = ()) -> InitErrorDetails:
    """Return one fault with its finished text, for `faults_error`."""
    return InitErrorDetails(type=refusal(message), loc=location, input=None)


def refusal(message: str) -> PydanticCustomError:
    """Return the exception that a validator raises to refuse its value with this text."""
    # The text goes in as a value, since pydantic would read braces in a template.
    return PydanticCustomError("fault", "{message}", {"message": message})


def faults_error(title: str, faults: Sequence[InitErrorDetails]) -> ValidationError:
    """Return pydantic's exception with these faults, which it hands on with the path of whoever raised it."""
    return ValidationError.from_exception_data(title, list(faults))


def input_error(error: ValidationError, source: str) -> InputError:
    """Return the one `InputError` that lists every fault.

    Parameters
    ----------
    error
        What pydantic found.
    source
        Where the values came from: a file, or the model's name.
    """
    lines = [f"{_dotted(line['loc'])}: {line['msg']}" if line["loc"] else line["msg"] for line in error.errors()]
    return gathered(lines, source)


def gathered(lines: Sequence[str], source: str) -> InputError:
    """Return an `InputError` with one line a fault, headed by their source and number."""
    if len(lines) == 1:
        return InputError(f"{source}: {lines[0]}")
    return InputError("\n".join([f"{source}: {len(lines)} faults", *(f"  {line}" for line in lines)]))


def _dotted(location: Iterable[int | str]) -> str:
    """Return a location as a path in the file: `water.waves[2].amplitude`."""
    path = ""
    for part in location:
        if isinstance(part, int):
            path += f"[{part}]"
        else:
            path += ("." if path else "") + (part if _BARE_KEY.fullmatch(part) else json.dumps(part))
    return path


def shown(value: Any) -> str:
    """Return a value as a scene file would write it, shortened."""
    text = _written(value)
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 1] + "…"


def _written(value: Any) -> str:
    """Return a value as a scene file would write it."""
    if hasattr(value, "tolist"):  # NumPy's numbers and arrays, without importing NumPy for an error's sake
        value = value.tolist()
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_written(item) for item in value)}]"
    try:
        return str(value)
    except ValueError:  # an integer of thousands of digits, which Python refuses to print
        return "a number too long to print"


def listed(names: Iterable[str], joint: str = "or") -> str:
    """Return names in words: `a, b or c`."""
    *most, last = names
    return f"{', '.join(most)} {joint} {last}" if most else last


def quoted(names: Iterable[str]) -> str:
    """Return names in words, each in quotation marks."""
    return listed(f'"{name}"' for name in names)


def did_you_mean(name: str, known: Iterable[str]) -> str | None:
    """Return `did you mean "level"?` for the closest known name, or None when none is close."""
    by_lower = {candidate.lower(): candidate for candidate in known}
    close = difflib.get_close_matches(name.lower(), by_lower, n=1)
    return f'did you mean "{by_lower[close[0]]}"?' if close else None
