"""Compile every kernel for CUDA, without a GPU: ``python bench/compile_cuda.py [--arch N ...] [-o DIR] [NAME ...]``.

Prints, for each kernel and architecture, the seconds of NVRTC and of its assembler, the bytes of PTX and of the binary,
and what a thread of it takes: registers, and local memory, into which registers spill. With ``-o`` the same as JSON.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

from cubin import resources

ARCHITECTURES = (80, 90, 100)
"""From the oldest that this library is meant for to the newest that it is: A100, H100 and H200, B200."""

TESTS = Path(__file__).parent.parent / "tests"


@dataclass(frozen=True)
class Compiled:
    """One kernel's module for one architecture; of several kernels in a module, the largest counts.

    Attributes
    ----------
    name : str
        As in the tests.
    arch : int
        Compute capability, 90 for 9.0.
    seconds : float
        Of generating code, NVRTC and assembler.
    ptx_bytes, cubin_bytes : int
        Sizes of the files.
    registers : int
        A thread.
    local_bytes : int
        A thread.
    """

    name: str
    arch: int
    seconds: float
    ptx_bytes: int
    cubin_bytes: int
    registers: int
    local_bytes: int


def compile_one(name: str, arch: int) -> Compiled:
    """Compile one of the tests' kernels."""
    if str(TESTS) not in sys.path:
        sys.path.insert(0, str(TESTS))
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    from test_cuda_compile import KERNELS

    with tempfile.TemporaryDirectory() as folder:
        start = perf_counter()
        for ptx in (True, False):
            module = KERNELS[name]().module
            wp.compile_aot_module(module, device=None, arch=arch, module_dir=folder, use_ptx=ptx)
        seconds = perf_counter() - start
        (ptx_file,), (cubin_file,) = (list(Path(folder).glob(f"*.{kind}")) for kind in ("ptx", "cubin"))
        taken = resources(cubin_file).values()
        return Compiled(
            name, arch, seconds, ptx_file.stat().st_size, cubin_file.stat().st_size,
            max(each.registers for each in taken), max(each.frame for each in taken),
        )  # fmt: skip


def main() -> None:
    """Compile what is asked for, side by side, and print a table."""
    sys.path.insert(0, str(TESTS))
    from test_cuda_compile import KERNELS

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="kernels, all by default")
    parser.add_argument("--arch", type=int, nargs="+", default=ARCHITECTURES)
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="write compile_cuda.json there")
    asked = parser.parse_args()
    unknown = sorted(set(asked.names) - set(KERNELS))
    if unknown:
        parser.error(f"no such kernel: {', '.join(unknown)}; expected some of {', '.join(KERNELS)}")
    jobs = [(name, arch) for name in asked.names or KERNELS for arch in asked.arch]
    start = perf_counter()
    # A fresh interpreter each: Warp's threads do not survive a fork.
    with ProcessPoolExecutor(os.cpu_count(), mp_context=multiprocessing.get_context("spawn")) as pool:
        done = list(pool.map(compile_one, *zip(*jobs, strict=True)))
    print(f"{'kernel':34} arch  seconds  PTX kB  binary kB  registers  local bytes")
    for each in done:
        print(
            f"{each.name:34} {each.arch:4} {each.seconds:8.2f} {each.ptx_bytes / 1e3:7.0f} "
            f"{each.cubin_bytes / 1e3:10.0f} {each.registers:10} {each.local_bytes:12}"
        )
    for arch in asked.arch:
        own = [each for each in done if each.arch == arch]
        spilling = [each.name for each in own if each.local_bytes]
        print(
            f"sm_{arch}: {len(own)} kernels, {sum(each.seconds for each in own):.0f} s, "
            f"{sum(each.cubin_bytes for each in own) / 1e6:.1f} MB, at most {max(each.registers for each in own)} "
            f"registers; local memory: {', '.join(spilling) or 'none'}"
        )
    print(f"{perf_counter() - start:.0f} s in all, {os.cpu_count()} side by side")
    if asked.output is not None:
        asked.output.mkdir(parents=True, exist_ok=True)
        (asked.output / "compile_cuda.json").write_text(json.dumps([asdict(each) for each in done], indent=1) + "\n")


if __name__ == "__main__":
    main()
