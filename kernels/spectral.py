"""Water as a sum of its modes: each turned by its own frequency to any time, exactly; then Fourier transforms.

In water that starts at rest a mode stands, ``h(k, t) = h(k, 0) cos(w t)``; in a sea it travels,
``h(k, t) = h(k, 0) exp(-i w t)``. No step is taken, and none can be unstable. Periodic water is a sum of
``exp(i k x)`` with whole waves in its rectangle; water between walls a sum of ``cos(kx x) cos(ky y)`` with half waves,
which is the real part of a transform of twice the length, its upper half zero:
``sum_k c_k cos(pi k (n + 1/2) / N) = Re sum_k (c_k e^(i pi k / 2N)) e^(2 pi i k n / 2N)``.
"""

import functools

import warp as wp


@wp.struct
class Dispersion:
    """What the frequency of a wave depends on beside its length."""

    gravity: wp.float64  # [m/s^2]
    tension: wp.float64  # surface tension by density [m^3/s^2]
    depth: wp.float64  # [m]
    unit: wp.float64  # of which frequencies of a sea that loops are whole multiples [rad/s]


@wp.func
def angular_frequency(dispersion: Dispersion, wavevector: wp.vec2d) -> wp.float64:
    """Gravity-capillary waves over a finite depth: w^2 = (g k + sigma/rho k^3) tanh(k d) (Lamb)."""
    k = wp.length(wavevector)
    return wp.sqrt((dispersion.gravity * k + dispersion.tension * k * k * k) * wp.tanh(k * dispersion.depth))


@wp.func
def mode_number(index: int, count: int, mirrored: bool) -> wp.float64:
    """Waves (periodic, signed) or half waves (mirrored) of a mode in the rectangle."""
    if not mirrored and 2 * index > count:
        return wp.float64(index - count)
    return wp.float64(index)


@functools.cache
def make_evolve(mirrored: bool) -> wp.Kernel:
    """Take each mode to a time; one thread a value of ``modes_out``, whose values past the spectrum's are padding.

    ``wavenumbers`` are those of the longest wave (or half wave) along x and y [rad/m].
    """

    @wp.kernel(enable_backward=False, module="unique")
    def evolve(
        # In:
        begin: int,
        spectrum: wp.array2d[wp.vec2d],
        wavenumbers: wp.vec2d,
        dispersion: Dispersion,
        clock: wp.array[wp.float64],
        # Out:
        modes_out: wp.array2d[wp.vec2d],
    ):
        row, column = wp.tid()
        row += begin
        value = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
        if column < spectrum.shape[1]:
            wavevector = wp.vec2d(
                mode_number(column, spectrum.shape[1], wp.static(mirrored)) * wavenumbers[0],
                mode_number(row, spectrum.shape[0], wp.static(mirrored)) * wavenumbers[1],
            )
            value = wp.cos(angular_frequency(dispersion, wavevector) * clock[0]) * spectrum[row, column]
        modes_out[row, column] = value

    return evolve


@functools.cache
def make_travel(looped: bool) -> wp.Kernel:
    """Take each mode of a sea to a time, by a frequency that is a whole multiple of one where it loops.

    One thread a value of ``modes_out``. A mode and its opposite are waves that run each its own way: the surface is the
    real part of their sum.
    """

    @wp.kernel(enable_backward=False, module="unique")
    def travel(
        # In:
        begin: int,
        spectrum: wp.array2d[wp.vec2d],
        wavenumbers: wp.vec2d,
        dispersion: Dispersion,
        clock: wp.array[wp.float64],
        # Out:
        modes_out: wp.array2d[wp.vec2d],
    ):
        row, column = wp.tid()
        row += begin
        wavevector = wp.vec2d(
            mode_number(column, spectrum.shape[1], False) * wavenumbers[0],
            mode_number(row, spectrum.shape[0], False) * wavenumbers[1],
        )
        frequency = angular_frequency(dispersion, wavevector)
        if wp.static(looped):
            turns = wp.max(wp.round(frequency / dispersion.unit), wp.float64(1.0))
            frequency = turns * dispersion.unit
        c = wp.cos(frequency * clock[0])
        s = wp.sin(frequency * clock[0])
        mode = spectrum[row, column]
        modes_out[row, column] = wp.vec2d(mode[0] * c + mode[1] * s, mode[1] * c - mode[0] * s)

    return travel


@functools.cache
def make_turn(mirrored: bool) -> wp.Kernel:
    """Turn rows into columns between the two transforms; one thread a value of ``turned_out``.

    Between walls, what was summed along x is real, and enters the sum along y with that sum's own phase.
    """

    @wp.kernel(enable_backward=False, module="unique")
    def turn(
        # In:
        begin: int,
        modes: wp.array2d[wp.vec2d],
        # Out:
        turned_out: wp.array2d[wp.vec2d],
    ):
        column, row = wp.tid()
        column += begin
        if wp.static(mirrored):
            value = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
            if row < modes.shape[0]:
                phase = wp.float64(wp.PI) * wp.float64(row) / wp.float64(turned_out.shape[1])
                value = modes[row, column][0] * wp.vec2d(wp.cos(phase), wp.sin(phase))
            turned_out[column, row] = value
        else:
            turned_out[column, row] = modes[row, column]

    return turn


@wp.kernel(enable_backward=False)
def spectral_surface(
    # In:
    begin: int,
    turned: wp.array2d[wp.vec2d],
    # Out:
    height_out: wp.array2d[wp.float64],
):
    """Height of the water at the nodes [m], the real part of its sum; one thread a node."""
    row, column = wp.tid()
    row += begin
    height_out[row, column] = turned[column, row][0]
