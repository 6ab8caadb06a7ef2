"""Bytes that a pass cannot do without: each array that its launches bind is read once, or written once, or both.

That is a floor. An array that a pass goes over again is taken to come from a cache, as is one that several strips,
bands or lanes share; a neighbourhood costs nothing more than its pixels. A step of simulated water is a sweep over all
cells, and counts at each launch. Arrays within structs (waves, nodes of height maps) are taken to be read whole; the
points and trees of meshes, which kernels know by a number, are not counted.
"""

from __future__ import annotations

import ast
import functools
import inspect
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import warp as wp

from ..recording import OUTPUT, FillCommand

STORES = ("tile_store",)
"""Functions of Warp that write into an array and do not read it; all others that are given an array may read it."""


@dataclass(frozen=True)
class Traffic:
    """Bytes read and written."""

    read: int = 0
    written: int = 0


@dataclass(frozen=True)
class Access:
    """What a launch does with an array that lies at an address."""

    address: int
    size: int
    reads: bool
    writes: bool


def accesses(command: Any) -> Iterator[Access]:
    """Give what a launch, or a fill, does with its arrays."""
    if isinstance(command, FillCommand):
        yield Access(command.array.ptr, _bytes(command.array), False, True)
        return
    for argument, value in zip(command.kernel.adj.args, command.fwd_args, strict=True):
        writes = argument.label.endswith(OUTPUT)
        reads = not writes or reads_output(command.kernel, argument.label)
        for array in _arrays(value):
            if array.size:
                yield Access(array.ptr, _bytes(array), reads, writes)


def traffic(commands: Iterable[Any]) -> Traffic:
    """Bytes of a pass: each array of its commands once."""
    read: dict[tuple[int, int], int] = {}
    written: dict[tuple[int, int], int] = {}
    for command in commands:
        for access in accesses(command):
            if access.reads:
                read[access.address, access.size] = access.size
            if access.writes:
                written[access.address, access.size] = access.size
    return Traffic(sum(read.values()), sum(written.values()))


@functools.cache
def reads_output(function: Any, name: str) -> bool:
    """Whether a kernel, or a function of Warp, looks at what is in an array that it writes, or adds to it.

    Parameters
    ----------
    function : wp.Kernel or wp.Function
        With the array as a parameter.
    name : str
        Of the parameter.
    """
    if getattr(function, "native_snippet", None) is not None:
        return bool(re.search(rf"\\b{name}\\b.*\\+=|atomic", function.native_snippet))
    for node in ast.walk(function.adj.tree):
        if isinstance(node, ast.AugAssign) and _subscripts(node.target, name):
            return True
        if _subscripts(node, name) and isinstance(node.ctx, ast.Load):  # type: ignore[attr-defined]
            return True
        if isinstance(node, ast.Call):
            for place, given in enumerate(node.args):
                if isinstance(given, ast.Name) and given.id == name and _call_reads(function, node.func, place):
                    return True
    return False


def _call_reads(caller: Any, called: ast.expr, place: int) -> bool:
    """Whether a call reads the array that it is given at this place; what cannot be looked into is taken to."""
    if isinstance(called, ast.Attribute):
        return called.attr not in STORES
    assert isinstance(called, ast.Name)
    known = inspect.getclosurevars(caller.adj.func)
    function = {**known.globals, **known.nonlocals}.get(called.id)
    if not isinstance(function, wp.Function) or function.adj is None:
        return True
    return reads_output(function, function.adj.args[place].label)


def _subscripts(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == name


def _arrays(value: Any) -> Iterator[Any]:
    """Give the arrays of an argument: itself, or those of a struct and of the structs in it."""
    if isinstance(value, wp.array):
        yield value
    elif hasattr(value, "_cls") and hasattr(value._cls, "vars"):
        for name in value._cls.vars:
            yield from _arrays(getattr(value, name))


def _bytes(array: Any) -> int:
    return int(array.size) * wp.types.type_size_in_bytes(array.dtype)
