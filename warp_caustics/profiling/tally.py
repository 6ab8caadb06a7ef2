"""Floating-point operations of a launch, counted while it runs: the kernel is built again, with a counter in it.

Warp keeps the C++ that it generated of a kernel. There, arithmetic is calls of Warp's own functions, ``wp::mul(a, b)``;
here they become calls of functions of the same names that add to a counter first, by the type of their result. So loops
and branches count as they are taken, for this scene, and the count follows the kernels when they change. A counted
launch does to its arrays what the plain one does.

What counts: ``+ - * /`` and square roots one each component; a dot product, a length or a matrix product as many as
its sum has; a sine or another function of the mathematical library one, though it takes tens of instructions; additions
into the map one each component. Comparisons, minima, roundings, conversions and all integers count nothing, nor does
the way of a ray through the tree of a mesh. Operations in half, single and double precision count alike.

Native code (``wp.func_native``) is out of its sight. A native snippet says its own count where it makes it, in a line
``// flops: <expression in C++>`` of its own, a mere comment in the plain build: within a loop it counts as often as the
loop runs. A kernel with native code that says nothing, or with arithmetic of Warp's tiles, is not counted, transforms
apart: those count ``5 n log2 n``.
"""

from __future__ import annotations

import ctypes
import hashlib
import itertools
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import warp as wp
from warp._src import context
from warp._src.build import build_cpu

from ..errors import RenderError

_handles = itertools.count()
"""Objects are known to Warp's loader by a name, each of its own."""

ELEMENTWISE = ("add", "sub", "mul", "div", "cw_mul", "cw_div", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan",
               "atan2", "sinh", "cosh", "tanh", "exp", "log", "log2", "log10", "pow", "mod")  # fmt: skip
"""Functions that take one operation for each component of their result."""

IN_PLACE = ("add_inplace", "sub_inplace", "atomic_add", "atomic_sub")
"""Functions that add their last argument to something in memory."""

HEADER = """
static unsigned long long tally_count;
namespace tally {
template <class T> struct Width { static constexpr unsigned n = 0; };
template <> struct Width<wp::float16> { static constexpr unsigned n = 1; };
template <> struct Width<wp::float32> { static constexpr unsigned n = 1; };
template <> struct Width<wp::float64> { static constexpr unsigned n = 1; };
template <unsigned N, class T> struct Width<wp::vec_t<N, T>> { static constexpr unsigned n = N * Width<T>::n; };
template <unsigned R, unsigned C, class T> struct Width<wp::mat_t<R, C, T>> {
    static constexpr unsigned n = R * C * Width<T>::n;
};
// Plain functions take their arguments by reference and have a value as result: T is never a reference here.
template <class T> inline unsigned width(const T&) { return Width<T>::n; }
template <class A> inline unsigned last(const A& a) { return width(a); }
template <class A, class B, class... C> inline unsigned last(const A&, const B& b, const C&... c) {
    return last(b, c...);
}
// What a number of a product of matrices takes beyond its one operation: it is a dot product.
template <class... A> inline unsigned beyond(const A&...) { return 0; }
template <unsigned R, unsigned C, class T, class B> inline unsigned beyond(const wp::mat_t<R, C, T>&, const B&) {
    return 2 * C - 2;
}
template <unsigned R, unsigned C, class T> inline unsigned beyond(const wp::mat_t<R, C, T>&, const T&) { return 0; }
template <class A, class... B> inline unsigned sum(const A& a, const B&...) {
    return width(a) ? 2 * width(a) - 1 : 0;
}
"""
"""Components of a type, and what functions of them take."""

VALUE = """template <class... A> inline auto {name}(A&&... a) {{
    const auto value = wp::{name}(static_cast<A&&>(a)...);
    tally_count += {count};
    return value;
}}
"""
PLACE = """template <class... A> inline decltype(auto) {name}(A&&... a) {{
    tally_count += last(a...);
    return wp::{name}(static_cast<A&&>(a)...);
}}
"""
"""A function that counts: of values, and of a place in memory and what is added there."""

SYMBOL = "tally_total"
FOOTER = f'\nextern "C" {{ WP_API unsigned long long {SYMBOL}() {{ return tally_count; }} }}\n'

OPTIMISATION = 1
"""Of the counting build: less is quicker to compile, and it runs once or twice."""

NATIVE = "// flops:"
"""What a native snippet says its count with."""


VALUES = {
    **dict.fromkeys(ELEMENTWISE, "width(value)"),
    "mul": "width(value) * (1 + beyond(a...))",
    "dot": "sum(a...)",
    "length_sq": "sum(a...)",
    "length": "sum(a...) + 1",  # and the root
    "normalize": "sum(a...) + 1 + width(value)",  # and the divisions
    "cross": "9",
    "lerp": "3 * width(value)",
    "smoothstep": "8",
}
"""What functions of values count."""

CALLS = re.compile(rf"\bwp::({'|'.join((*VALUES, *IN_PLACE))})\(")
LAST_INCLUDE = re.compile(r'^#include "[\w.]+"\n(?!#include)', re.MULTILINE)
DECLARED = re.compile(rf"{NATIVE}(.+)$", re.MULTILINE)
NATIVE_FUNCTION = re.compile(r"^static CUDA_CALLABLE [^\n(]*?(\w+)\(\n.*?^}", re.MULTILINE | re.DOTALL)
TRANSFORM = re.compile(r"\btile_i?fft\(.*?, (\d+), \w+\);")
UNSEEN = re.compile(r"\btile_(?:add|sub|mul|matmul|map|reduce|sum|scan\w*|cholesky\w*|\w+_solve)\b")
"""Arithmetic of tiles that is not counted."""


def _header() -> str:
    values = "".join(VALUE.format(name=name, count=count) for name, count in VALUES.items())
    return HEADER + values + "".join(PLACE.format(name=name) for name in IN_PLACE) + "}\n"


def counted_source(source: str) -> str | None:
    """Give the C++ of a module with a counter in it; None where it does what cannot be counted."""
    # The adjoints of structs are declared like native functions, and a frame does not run them.
    natives = (native for native in NATIVE_FUNCTION.finditer(source) if not native[1].startswith("adj_"))
    silent = any(NATIVE not in native[0] for native in natives)
    if silent or UNSEEN.search(source):
        return None
    source = CALLS.sub(r"tally::\1(", source)
    source = DECLARED.sub(r"tally_count += (unsigned long long)(\1);", source)
    source = TRANSFORM.sub(lambda match: f"{match[0]} tally_count += {transform_operations(int(match[1]))};", source)
    return LAST_INCLUDE.sub(lambda match: match[0] + _header(), source, count=1) + FOOTER


def transform_operations(length: int) -> int:
    """Operations of a complex Fourier transform of this length, a power of two, as they are commonly counted."""
    return 5 * length * (length.bit_length() - 1)


class Tally:
    """Counts the operations of recorded launches on the CPU, one at a time: a kernel has one counter.

    Builds a kernel's counting form when it first meets it.
    """

    def __init__(self) -> None:
        self._built: dict[Any, tuple[Any, Callable[[], int]] | None] = {}

    def launch(self, command: Any, plain: Callable[[], None] | None = None) -> int | None:
        """Launch a command with its operations counted.

        Parameters
        ----------
        command : wp.Launch
            A recorded launch on the CPU.
        plain : callable, optional
            Launches a command that cannot be counted; its own launch when left out.

        Returns
        -------
        int or None
            Operations; None where they are not known.
        """
        counting = self._counting(command)
        if counting is None:
            (plain or command.launch)()
            return None
        hooks, total = counting
        before = total()
        invoke = context.invoke_cpu_blocks if command.block_dim > 1 else context.invoke
        invoke(command.kernel, hooks, command.params, False)
        return total() - before

    def _counting(self, command: Any) -> tuple[Any, Callable[[], int]] | None:
        kernel = command.kernel
        key = kernel, command.block_dim
        if key not in self._built:
            self._built[key] = _build(command)
        return self._built[key]


def _build(command: Any) -> tuple[Any, Callable[[], int]] | None:
    """Build the module of a launch with a counter in it, beside Warp's own build of it."""
    binary = Path(command.module_exec.binary_path)
    source = counted_source(next(binary.parent.glob("*.cpp")).read_text(encoding="utf-8"))
    if source is None:
        return None
    name = f"tally_{hashlib.sha256(source.encode()).hexdigest()[:16]}"
    built = binary.parent / f"{name}.o"
    if not built.exists():
        # Written under a name of this process, and moved: another may be building the same.
        made, text = (binary.parent / f"{name}.{os.getpid()}{suffix}" for suffix in (".o", ".cxx"))
        text.write_text(source, encoding="utf-8")
        build_cpu(str(made), str(text), block_dim=command.block_dim, optimization_level=OPTIMISATION)
        text.unlink()
        made.replace(built)
    llvm: Any = context.runtime.llvm  # type: ignore[attr-defined]  # typed as None before Warp starts
    handle = f"{name}_{next(_handles)}".encode()
    if llvm.wp_load_obj(str(built).encode(), handle, wp.config.legacy_cpu_linker) != 0:
        raise RenderError(f"cannot load the counting build of kernel {command.kernel.key}")

    def symbol(text: str) -> int:
        return int(llvm.wp_lookup(handle, text.encode()))

    entry = ctypes.CFUNCTYPE(None)(symbol(command.module_exec.get_kernel_mangled_name(command.kernel) + "_cpu_forward"))
    total = ctypes.CFUNCTYPE(ctypes.c_uint64)(symbol(SYMBOL))
    return context.KernelHooks(entry, None), total
