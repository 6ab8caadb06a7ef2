"""Fourier transforms of the rows of an array, on Warp's ``tile_fft``; columns are rows once the array is turned.

The sums are those of ``numpy.fft`` without a division:
``X[k] = sum_n x[n] exp(-2 pi i k n / N)``, its inverse with the other sign. Warp has three roads to it: a sequential
one on the CPU, a cooperative one on the GPU, and cuFFTDx. The last is switched off here: its sizes and blocks depend on
how Warp was built, and the second takes every power of two.
"""

import functools

import warp as wp

MOST_THREADS = 256
"""Threads of a GPU block that share a row."""

SHORTEST, LONGEST = 2, 4096
"""Values of a row: 4096 in float64 take 64 KB of a GPU's shared memory, or of the stack."""


def fft_block(length: int, device: str) -> int:
    """Threads that share a row of this length: one on the CPU, which goes through it in sequence."""
    return 1 if device == "cpu" else min(length, MOST_THREADS)


@functools.cache
def make_fft_rows(length: int, inverse: bool = False) -> wp.Kernel:
    """Transform each row of ``length`` complex float64 in place.

    Launch dim ``(rows, block)``, from row ``begin``, in blocks of :func:`fft_block`'s size.
    """
    assert SHORTEST <= length <= LONGEST and length & (length - 1) == 0

    @wp.kernel(enable_backward=False, module="unique", module_options={"enable_mathdx_fft": False})
    def fft_rows(
        # In:
        begin: int,
        # Out:
        rows_out: wp.array2d[wp.vec2d],
    ):
        row, _ = wp.tid()
        row += begin
        values = wp.tile_load(rows_out, shape=(1, length), offset=(row, 0))
        if wp.static(inverse):
            wp.tile_ifft(values)
        else:
            wp.tile_fft(values)
        wp.tile_store(rows_out, values, offset=(row, 0))

    return fft_rows
