"""Checking PLY files before VTK reads them: its reader kills the process on a file that is cut short.

After G. Turk, The PLY Polygon File Format, 1994.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from warp_caustics.errors import InputError

#: PLY's types, by both families of names, as `struct` writes them.
_FAMILIES: Final = (
    "char uchar short ushort int uint float double",
    "int8 uint8 int16 uint16 int32 uint32 float32 float64",
)
_TYPES: Final = {name: code for names in _FAMILIES for name, code in zip(names.split(), "bBhHiIfd", strict=True)}
_ENDIAN: Final = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
#: VTK holds the number of a face's corners in one byte.
_MOST_CORNERS: Final = 255


@dataclass
class _Element:
    """One element of the header: how many there are, and the types of their properties; lists are pairs of types."""

    count: int
    properties: list[str | tuple[str, str]] = field(default_factory=list)


def check_ply(path: Path) -> None:
    """Raise `InputError` unless all that the header of a PLY file promises is there."""
    data = path.read_bytes()
    head, mark, rest = data.partition(b"end_header")
    if not data.startswith(b"ply") or not mark:
        raise InputError(f"{path}: expected a PLY file, got something else")
    try:
        endian, elements = _header(head.decode("ascii"))
        complete = _is_complete(rest, endian, elements)
    except (ValueError, KeyError):
        raise InputError(f"{path}: expected a PLY file, got one with a damaged header or damaged lists") from None
    except (IndexError, struct.error):
        complete = False  # the length of a list lies past the end
    if not complete:
        raise InputError(f"{path}: the PLY file is cut short")


def _header(text: str) -> tuple[str, list[_Element]]:
    """Return the byte order and the elements, the vertices first: VTK misreads any other order."""
    endian, elements, names = "", [], []
    for words in (line.split() for line in text.splitlines()):
        match words:
            case ["format", kind, *_]:
                endian = _ENDIAN[kind]
            case ["element", name, count]:
                elements.append(_Element(int(count)))
                names.append(name)
            case ["property", "list", count_type, item_type, _]:
                elements[-1].properties.append((_TYPES[count_type], _TYPES[item_type]))
            case ["property", value_type, _]:
                elements[-1].properties.append(_TYPES[value_type])
    if names[:1] != ["vertex"] or any(element.count < 0 for element in elements):
        raise ValueError
    return endian, elements


def _is_complete(rest: bytes, endian: str, elements: list[_Element]) -> bool:
    """Return whether the body is as long as the elements need, in words of text or in bytes."""
    if not endian:
        words = rest.split()
        return _end(elements, dict.fromkeys(_TYPES.values(), 1), lambda at, _: int(words[at])) <= len(words)
    body = rest[rest.index(b"\n") + 1 :]
    sizes = {code: struct.calcsize(endian + code) for code in _TYPES.values()}
    return _end(elements, sizes, lambda at, code: struct.unpack_from(endian + code, body, at)[0]) <= len(body)


def _end(elements: list[_Element], sizes: dict[str, int], number_at: Callable[[int, str], int]) -> int:
    """Return where the last element ends, given the size of each type and how to read the length of a list."""
    at = 0
    for element in elements:
        lists = [each for each in element.properties if isinstance(each, tuple)]
        if not lists:
            at += element.count * sum(sizes[each] for each in element.properties if isinstance(each, str))
            continue
        for _ in range(element.count):
            for each in element.properties:
                if isinstance(each, str):
                    at += sizes[each]
                    continue
                length = number_at(at, each[0])
                if not 0 <= length <= _MOST_CORNERS:
                    raise ValueError
                at += sizes[each[0]] + length * sizes[each[1]]
    return at
