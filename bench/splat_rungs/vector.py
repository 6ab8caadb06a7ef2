"""Splats whose taps are added four at a time, by the vector atomics of sm_90 and later.

``red.global.add.v4.f32`` adds four neighbouring floats whose address is a multiple of 16. A map of one float a pixel
seldom has a box's taps at such a place, and a thread that asks where they are goes a way of its own: of a warp's
photons a quarter would take each. So the map is laid out for the atomics, and put right in a pass of its own:

- ``quads``: four maps of blocks of two by two pixels, which begin at an even or odd column and row. A box of a pixel
  lies in one block of one of them: one atomic a photon and channel in place of four, no border to mind, for four
  times the memory.
- ``rgba``: a pixel of four floats, the last unused: one atomic a tap in place of three, for a third more memory.
"""

import functools

import warp as wp

from warp_caustics.kernels.deposit import FLUX
from warp_caustics.kernels.splat import NARROWEST

from .landed import Command, Fill, Landed, record

LANES = 4
"""Floats of a vector atomic."""

BORDER = 2
"""Columns, and rows, that blocks have beyond a map's: a box on the border reaches a pixel out on either side."""


@wp.func_native("""
    float* p = map.data + first;
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    asm volatile("red.global.add.v4.f32 [%0], {%1, %2, %3, %4};"
                 :: "l"(__cvta_generic_to_global(p)), "f"(a), "f"(b), "f"(c), "f"(d) : "memory");
#elif defined(__CUDA_ARCH__)
    atomicAdd(p, a); atomicAdd(p + 1, b); atomicAdd(p + 2, c); atomicAdd(p + 3, d);
#else
    p[0] += a; p[1] += b; p[2] += c; p[3] += d;
#endif
""")
def add_four(map: wp.array[float], first: int, a: float, b: float, c: float, d: float):
    """Add to four contiguous elements; ``first`` is a multiple of four, and the map an allocation of its own."""
    ...


NOWHERE = wp.constant(-2.0)
"""First column (row) of a box that does not meet the map, whose first may be -1."""


@wp.func
def pair(x: float, width: float, count: int) -> wp.vec2:
    """First column (row) of a box of a pixel or less, or NOWHERE, and the share of the box in the one after it."""
    whole = wp.floor(x)
    if not (whole >= -1.0 and whole <= float(count)):  # no number is neither
        return wp.vec2(NOWHERE, 0.0)
    # From the pixel that it falls in, so that its sides keep their digits.
    x = x - whole
    first = wp.floor(x - 0.5 * width)
    if not (whole + first >= -1.0 and whole + first < float(count)):
        return wp.vec2(NOWHERE, 0.0)
    return wp.vec2(whole + first, wp.max(x + 0.5 * width - (first + 1.0), 0.0) / wp.max(width, wp.static(NARROWEST)))


@functools.cache
def make_splat_quads(channels: int) -> wp.Kernel:
    """Splat boxes of a pixel or less into blocks of two by two pixels."""
    flux_type = FLUX[channels]

    @wp.kernel(module="unique", enable_backward=False)
    def splat_quads(
        # In:
        x: wp.array[float],
        y: wp.array[float],
        flux: wp.array[flux_type],
        each: int,
        width: float,
        size: wp.vec2i,
        blocks: wp.vec2i,
        # Out:
        blocks_out: wp.array[float],
    ):
        """One thread ``each`` photons; ``blocks`` across and up of each of the four maps."""
        start = wp.tid() * each
        for i in range(start, wp.min(start + each, x.shape[0])):
            across = pair(x[i], width, size[0])
            up = pair(y[i], width, size[1])
            if across[0] != NOWHERE and up[0] != NOWHERE:
                right = across[1]
                upper = up[1]
                # From 0, so that halves and remainders are what they seem.
                column = int(across[0]) + 1
                row = int(up[0]) + 1
                phase = (row & 1) * 2 + (column & 1)
                block = (phase * blocks[1] + (row >> 1)) * blocks[0] + (column >> 1)
                amount = flux[i]
                for c in range(wp.static(channels)):
                    lower_flux = amount[c] * (1.0 - upper)
                    upper_flux = amount[c] * upper
                    add_four(
                        blocks_out, (block * wp.static(channels) + c) * wp.static(LANES), lower_flux * (1.0 - right),
                        lower_flux * right, upper_flux * (1.0 - right), upper_flux * right,
                    )  # fmt: skip

    return splat_quads


@functools.cache
def make_sum_quads(channels: int) -> wp.Kernel:
    """Add up what a pixel has in the four maps of blocks."""

    @wp.kernel(module="unique", enable_backward=False)
    def sum_quads(
        # In:
        blocks_of: wp.array[float],
        each: int,
        size: wp.vec2i,
        blocks: wp.vec2i,
        # Out:
        map_out: wp.array[float],
    ):
        """One thread ``each`` pixels of a row; launch dims (rows, columns over that)."""
        row, run = wp.tid()
        for column in range(run * each, wp.min((run + 1) * each, size[0])):
            pixel = row * size[0] + column
            for c in range(wp.static(channels)):
                total = float(0.0)
                for phase in range(4):
                    up = row + 1 - (phase >> 1)
                    across = column + 1 - (phase & 1)
                    block = (phase * blocks[1] + (up >> 1)) * blocks[0] + (across >> 1)
                    lane = (up & 1) * 2 + (across & 1)
                    total += blocks_of[(block * wp.static(channels) + c) * wp.static(LANES) + lane]
                map_out[pixel * wp.static(channels) + c] = total

    return sum_quads


@wp.func
def add_pixel(map: wp.array[float], size: wp.vec2i, column: int, row: int, flux: wp.vec3, share: float):
    """Add to a pixel of four floats, if it is on the map."""
    if column >= 0 and column < size[0] and row >= 0 and row < size[1]:
        at = (row * size[0] + column) * wp.static(LANES)
        add_four(map, at, flux[0] * share, flux[1] * share, flux[2] * share, 0.0)


@wp.kernel(enable_backward=False)
def splat_rgba(
    # In:
    x: wp.array[float],
    y: wp.array[float],
    flux: wp.array[wp.vec3],
    each: int,
    width: float,
    size: wp.vec2i,
    # Out:
    pixels_out: wp.array[float],
):
    """One thread ``each`` photons; points, and boxes of a pixel or less."""
    start = wp.tid() * each
    for i in range(start, wp.min(start + each, x.shape[0])):
        across = pair(x[i], width, size[0])
        up = pair(y[i], width, size[1])
        if across[0] != NOWHERE and up[0] != NOWHERE:
            column = int(across[0])
            row = int(up[0])
            if width > wp.static(NARROWEST):
                right = across[1]
                upper = up[1]
                add_pixel(pixels_out, size, column, row, flux[i], (1.0 - right) * (1.0 - upper))
                add_pixel(pixels_out, size, column + 1, row, flux[i], right * (1.0 - upper))
                add_pixel(pixels_out, size, column, row + 1, flux[i], (1.0 - right) * upper)
                add_pixel(pixels_out, size, column + 1, row + 1, flux[i], right * upper)
            else:
                add_pixel(pixels_out, size, column, row, flux[i], 1.0)


@wp.kernel(enable_backward=False)
def drop_fourth(
    # In:
    pixels: wp.array[float],
    each: int,
    # Out:
    map_out: wp.array[float],
):
    """One thread ``each`` pixels; three floats of four."""
    start = wp.tid() * each
    for i in range(start, wp.min(start + each, map_out.shape[0] / 3)):
        for c in range(3):
            map_out[i * 3 + c] = pixels[i * wp.static(LANES) + c]


def check(photons: Landed, name: str) -> None:
    """Refuse what a form of this file cannot add.

    Raises
    ------
    ValueError
        If the map is not float32, or a box is wider than a pixel.
    """
    if photons.accumulate != "float32":
        raise ValueError(f"{name}: vector atomics add float32, not {photons.accumulate}")
    if photons.width > 1.0:
        raise ValueError(f"{name}: a box of {photons.width} pixels has more than four taps")


def quads(photons: Landed, image: wp.array) -> list[Command]:
    """On sm_90 and later, for boxes, where photons a pixel are enough to pay for four maps: from about two."""
    check(photons, "quads")
    if photons.width <= NARROWEST:
        raise ValueError("quads: a point has one tap")
    device, channels, (columns, rows) = photons.device, photons.channels, photons.resolution
    blocks = wp.vec2i(-(-(columns + BORDER) // 2), -(-(rows + BORDER) // 2))
    scratch = wp.zeros(4 * blocks[0] * blocks[1] * LANES * channels, dtype=float, device=device)
    size = wp.vec2i(columns, rows)
    each, run = (photons.count, columns) if device == "cpu" else (1, 1)
    inputs = [photons.x, photons.y, photons.flux, each, photons.width, size, blocks]
    return [
        Fill(scratch),
        record(make_splat_quads(channels), -(-photons.count // each), inputs, [scratch], device),
        record(make_sum_quads(channels), (rows, columns // run), [scratch, run, size, blocks], [image], device),
    ]


def rgba(photons: Landed, image: wp.array) -> list[Command]:
    """On sm_90 and later, for three channels, points included."""
    check(photons, "rgba")
    if photons.channels != 3:
        raise ValueError("rgba: for three channels")
    device, (columns, rows) = photons.device, photons.resolution
    scratch = wp.zeros(rows * columns * LANES, dtype=float, device=device)
    each, run = (photons.count, rows * columns) if device == "cpu" else (1, 1)
    inputs = [photons.x, photons.y, photons.flux, each, photons.width, wp.vec2i(columns, rows)]
    return [
        Fill(scratch),
        record(splat_rgba, -(-photons.count // each), inputs, [scratch], device),
        record(drop_fourth, rows * columns // run, [scratch, run], [image], device),
    ]
