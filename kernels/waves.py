"""Waves: the height of a sum of sines, its slope and its curvature, at one point."""

import warp as wp

vec6 = wp.types.vector(length=6, dtype=float)


@wp.struct
class Wave:
    """One sine: ``a sin(k . x + phase)``, its phase already taken at the time and at the map's origin."""

    amplitude: float  # [m]
    wavevector: wp.vec2  # [rad/m]
    phase: float  # [rad]
    wavevector_rest: wp.vec2  # what float32 leaves out of the two above: added in float64 they have
    phase_rest: float  # the host's digits, which tables need where light comes from many wavelengths away


@wp.func
def wave_sum(waves: wp.array[Wave], x: float, y: float) -> wp.vec3:
    """Displacement and slope (z, z_x, z_y) of the sum of sines at (x, y), metres from the map's origin."""
    total = wp.vec3(0.0, 0.0, 0.0)
    for i in range(waves.shape[0]):
        wave = waves[i]
        angle = wave.wavevector[0] * x + wave.wavevector[1] * y + wave.phase
        rise = wave.amplitude * wp.cos(angle)
        total += wp.vec3(wave.amplitude * wp.sin(angle), rise * wave.wavevector[0], rise * wave.wavevector[1])
    return total


@wp.func
def wave_sum_curved(waves: wp.array[Wave], x: float, y: float) -> vec6:
    """Displacement, slope and second derivatives (z, z_x, z_y, z_xx, z_xy, z_yy) of the sum of sines."""
    total = vec6()
    for i in range(waves.shape[0]):
        wave = waves[i]
        k = wave.wavevector
        angle = k[0] * x + k[1] * y + wave.phase
        height = wave.amplitude * wp.sin(angle)
        rise = wave.amplitude * wp.cos(angle)
        total += vec6(
            height, rise * k[0], rise * k[1], -height * k[0] * k[0], -height * k[0] * k[1], -height * k[1] * k[1]
        )
    return total
