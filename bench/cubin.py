"""What a compiled CUDA binary says of its kernels: registers, local and shared memory."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

SECTION_TABLE_AT, SECTION_SIZE_AT = 0x28, 0x3A
"""Offsets in the header of a 64-bit ELF file: of the section table, and of its entries' size, count and names."""

SECTION = struct.Struct("<IIQQQQIIQQ")
"""An entry of it: name, type, flags, address, offset, size, link, info, alignment, entry size."""

SYMBOL = struct.Struct("<IBBHQQ")
"""A symbol: name, info, other, section, value, size."""

REGISTERS, FRAME = 0x2F, 0x11
"""Attributes of ``.nv.info``: a kernel's registers a thread, and its stack frame in local memory [bytes]."""

SIZED = 0x04
"""Format of an attribute that is followed by as many bytes as it says."""


@dataclass(frozen=True)
class Resources:
    """What one kernel takes.

    Attributes
    ----------
    registers : int
        A thread.
    frame : int
        Bytes of local memory a thread: arrays, and what registers spill.
    shared : int
        Bytes of shared memory a block, fixed when compiled.
    """

    registers: int
    frame: int
    shared: int


def resources(path: Path) -> dict[str, Resources]:
    """Read what the kernels of a cubin file take, by name."""
    data = path.read_bytes()
    (table,) = struct.unpack_from("<Q", data, SECTION_TABLE_AT)
    size, count, names = struct.unpack_from("<HHH", data, SECTION_SIZE_AT)
    entries = [SECTION.unpack_from(data, table + i * size) for i in range(count)]
    strings = entries[names][4]
    sections = {_text(data, strings + entry[0]): entry for entry in entries}
    symbols = _symbols(data, sections, entries)
    found: dict[int, dict[int, int]] = {}
    _, _, _, _, at, length, *_ = sections[".nv.info"]
    end = at + length
    while at < end:
        kind, attribute, size = struct.unpack_from("<BBH", data, at)
        if kind == SIZED and attribute in (REGISTERS, FRAME):
            symbol, value = struct.unpack_from("<II", data, at + 4)
            found.setdefault(symbol, {})[attribute] = value
        at += 4 + (size if kind == SIZED else 0)
    return {
        symbols[symbol]: Resources(
            values[REGISTERS], values.get(FRAME, 0), sections.get(f".nv.shared.{symbols[symbol]}", (0,) * 6)[5]
        )
        for symbol, values in found.items()
        if REGISTERS in values and f".text.{symbols[symbol]}" in sections
    }


def _symbols(data: bytes, sections: dict[str, tuple[int, ...]], entries: list[tuple[int, ...]]) -> list[str]:
    _, _, _, _, at, size, link, *_ = sections[".symtab"]
    strings = entries[link][4]
    return [_text(data, strings + SYMBOL.unpack_from(data, at + i)[0]) for i in range(0, size, SYMBOL.size)]


def _text(data: bytes, at: int) -> str:
    return data[at : data.index(b"\0", at)].decode()
