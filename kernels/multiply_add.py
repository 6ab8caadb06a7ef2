"""Multiply-adds that wait for nothing: how fast a device does arithmetic that its compiler can turn into vectors."""

import warp as wp

CHAINS = 128
"""Sums that a thread keeps going side by side: they fill the vectors of a core, and hide the time that each step takes.

Eight vectors of sixteen, or sixteen of eight; on a GPU, half of a thread's registers."""

FACTOR, TERM = 0.5, 1.0
"""Of a step; sums come to 2 and stay there."""


@wp.func_native(
    f"""
#if defined(__CUDA_ARCH__)
#define FUSED(a, b, c) fmaf(a, b, c)
#define IN_REGISTERS _Pragma("unroll")
#else
#define FUSED(a, b, c) __builtin_fmaf(a, b, c)
#define IN_REGISTERS
#endif
    float sums[{CHAINS}];
    IN_REGISTERS
    for (int i = 0; i < {CHAINS}; ++i)
        sums[i] = 1.0f / (i + 1);
    for (int step = 0; step < steps; ++step)
    {{
        IN_REGISTERS
        for (int i = 0; i < {CHAINS}; ++i)
            sums[i] = FUSED(sums[i], {FACTOR}f, {TERM}f);
        // flops: 2 * {CHAINS}
    }}
    float total = 0.0f;
    IN_REGISTERS
    for (int i = 0; i < {CHAINS}; ++i)
        total += sums[i];
#undef FUSED
#undef IN_REGISTERS
    return total;
    """
)
def sums_of_chains(steps: int) -> float:
    """Sum of all chains after so many steps."""


@wp.kernel(enable_backward=False)
def multiply_add(
    # In:
    steps: int,
    # Out:
    totals_out: wp.array[float],
):
    """One thread an element: the sum of all chains after so many steps, ``2 * CHAINS`` operations each."""
    totals_out[wp.tid()] = sums_of_chains(steps)
