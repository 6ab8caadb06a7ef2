"""One launch as bands of rows that threads share: on a CPU Warp runs a launch on one core.

A kernel says that it can be cut by a parameter ``begin``, which it adds to its index along the first dimension.
"""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import warp as wp

from .recording import CLEAR, FillCommand, Lanes, bind

BEGIN = "begin"
"""A kernel's parameter that says that a launch of it may be cut along its first dimension: the index at which a part
begins. Its threads write nothing that others of the launch read or write, but for what each lane has of its own."""

PIECES = 4
"""Parts of a launch for each thread, dealt out in turn: rows of a picture are not alike."""

LEAST_PIECE = 2**12
"""Values that a part of a launch goes through: with fewer, waking a thread takes longer than they do."""

MOST_PIECE = 2**22
"""Values of a part at most, even on one thread: some seconds, between which a frame can be interrupted."""

LEAST_FILL = 2**20
"""Values that are filled by one thread."""


def bind_lanes(
    kernel: wp.Kernel,
    dim: tuple[int, ...],
    values: Mapping[str, Any],
    device: str,
    threads: int,
    names: Mapping[str, str | None] | None = None,
    own: Sequence[Mapping[str, Any]] = (),
    block: int = 256,
    weight: int = 1,
    pass_name: str | None = None,
) -> Lanes:
    """Record a launch that threads share, cut along its first dimension, if its kernel has the parameter ``begin``.

    Parameters
    ----------
    kernel, dim, values, device, names, pass_name
        As :func:`bind`.
    threads : int
        That share it at most.
    own : sequence of mapping, optional
        What each lane alone has, as an accumulator; as many as there are threads.
    block : int
        Threads of a block, on a GPU and of kernels that work on tiles.
    weight : int
        Values that each thread goes through, as a row of a picture.

    Returns
    -------
    Lanes
        At most ``threads``; one where the launch cannot be cut, or is too small.
    """
    if BEGIN not in (argument.label for argument in kernel.adj.args):
        return [
            [bind(kernel, dim, _layered(*own[:1], values), device, names, pass_name, block, weight * math.prod(dim))]
        ]
    lanes: Lanes = [[] for _ in range(threads)]
    for number, (begin, end) in enumerate(_cuts(dim, threads, device, weight)):
        lane = number % threads
        part = _layered({BEGIN: begin}, own[lane] if own else {}, values)
        cut = (end - begin, *dim[1:])
        lanes[lane].append(bind(kernel, cut, part, device, names, pass_name, block, weight * math.prod(cut)))
    return [lane for lane in lanes if lane]


def fill_lanes(array: wp.array, value: Any, threads: int, pass_name: str = CLEAR) -> Lanes:
    """Fill an array by so many threads at most; less than :data:`LEAST_FILL` values are left to one."""
    rows = array.shape[0]
    parts = max(1, min(threads, rows, array.size // LEAST_FILL))
    if parts == 1:
        return [[FillCommand(array, value, pass_name)]]
    ends = [rows * part // parts for part in range(parts + 1)]
    return [[FillCommand(array[begin:end], value, pass_name)] for begin, end in pairwise(ends)]


def _layered(*values: Any) -> Mapping[str, Any]:
    """Give values of which the first mapping that has one has the say, without asking for those that make their own."""
    return ChainMap(*values)


def _cuts(dim: tuple[int, ...], threads: int, device: str, weight: int = 1) -> Iterator[tuple[int, int]]:
    """Begins and ends along the first dimension of a launch."""
    rows, size = dim[0], weight * math.prod(dim)
    parts = 1
    if device == "cpu":
        parts = -(-size // MOST_PIECE)
        if threads > 1:
            parts = max(parts, min(PIECES * threads, size // LEAST_PIECE))
    parts = max(1, min(parts, rows))
    ends = [rows * part // parts for part in range(parts + 1)]
    return pairwise(ends)
