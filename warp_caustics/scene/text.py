"""Writing TOML: the little of it that a scene needs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def toml_text(tables: Mapping[str, Any]) -> str:
    """Return TOML for a mapping of values and tables; tables inside tables and lists are written inline."""
    plain = {key: value for key, value in tables.items() if not isinstance(value, Mapping)}
    lines = _entries(plain)
    for name, table in tables.items():
        if isinstance(table, Mapping):
            lines += ["", f"[{name}]", *_entries(table)] if lines else [f"[{name}]", *_entries(table)]
    return "\n".join(lines) + "\n"


def _entries(table: Mapping[str, Any]) -> list[str]:
    """Return one line for each key, and one for each table in a list of them."""
    lines = []
    for key, value in table.items():
        if isinstance(value, (list, tuple)) and value and isinstance(value[0], Mapping):
            lines += [f"{key} = [", *(f"  {_inline(item)}," for item in value), "]"]
        else:
            lines.append(f"{key} = {_inline(value)}")
    return lines


def _inline(value: Any) -> str:
    """Return a value on one line; Python's shortest form of a float reads back to the same float."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON escapes what TOML wants escaped, but for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_inline(item)}' for key, item in value.items())} }}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_inline(item) for item in value)}]"
    return repr(value)
