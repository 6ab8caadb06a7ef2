"""Storage of unit normals in a G-buffer: three floats, yaw and pitch in half floats, or an octahedron in 16 bits each.

Bäcklund's thesis (3.3.2) tried yaw and pitch and gave them up for rounding errors. A normal of calm water has a pitch
near a right angle, where half floats step by 1e-3: that is the error, not the trigonometry. The octahedron (Meyer et
al. 2010, *On floating-point normal vectors*) has nearly the same small step everywhere.
"""

import warp as wp

ANGLES = wp.vec2h
"""Yaw and pitch [rad], float16 each."""

OCTAHEDRAL = wp.vec2s
"""Place on the unfolded octahedron, 16-bit signed normalised each."""

NORMAL_STORAGE = {"float3": wp.vec3, "angles": ANGLES, "octahedral": OCTAHEDRAL}
"""Element of a buffer of normals, by how they are stored."""

SNORM = wp.constant(32767.0)  # steps of 1 in 16 bits with a sign


@wp.func
def sign_or_one(value: float) -> float:
    """-1 below zero, else 1: the fold of the octahedron has no side that is neither."""
    return wp.where(value < 0.0, -1.0, 1.0)


@wp.func
def pack_angles(normal: wp.vec3) -> wp.vec2h:
    """Yaw from +x towards +y and pitch from the horizontal of a unit normal."""
    yaw = wp.atan2(normal[1], normal[0])
    pitch = wp.asin(wp.clamp(normal[2], -1.0, 1.0))
    return wp.vec2h(wp.float16(yaw), wp.float16(pitch))


@wp.func
def unpack_angles(packed: wp.vec2h) -> wp.vec3:
    """Unit normal of :func:`pack_angles`."""
    yaw = float(packed[0])
    pitch = float(packed[1])
    return wp.vec3(wp.cos(yaw) * wp.cos(pitch), wp.sin(yaw) * wp.cos(pitch), wp.sin(pitch))


@wp.func
def pack_octahedral(normal: wp.vec3) -> wp.vec2s:
    """Place of a unit normal on the unfolded octahedron, rounded to the nearest step."""
    n = normal / (wp.abs(normal[0]) + wp.abs(normal[1]) + wp.abs(normal[2]))
    x = n[0]
    y = n[1]
    if n[2] < 0.0:
        x = (1.0 - wp.abs(n[1])) * sign_or_one(n[0])
        y = (1.0 - wp.abs(n[0])) * sign_or_one(n[1])
    return wp.vec2s(wp.int16(wp.rint(x * SNORM)), wp.int16(wp.rint(y * SNORM)))


@wp.func
def unpack_octahedral(packed: wp.vec2s) -> wp.vec3:
    """Unit normal of :func:`pack_octahedral`."""
    x = float(packed[0]) / SNORM
    y = float(packed[1]) / SNORM
    z = 1.0 - wp.abs(x) - wp.abs(y)
    folded = wp.max(-z, 0.0)  # how far below the equator: unfolds the lower half
    return wp.normalize(wp.vec3(x - sign_or_one(x) * folded, y - sign_or_one(y) * folded, z))


@wp.func
def keep(normal: wp.vec3) -> wp.vec3:
    """Three floats hold a normal as it is."""
    return normal


PACK = {"float3": keep, "angles": pack_angles, "octahedral": pack_octahedral}
"""Unit normal to what a buffer holds, by storage."""

UNPACK = {"float3": keep, "angles": unpack_angles, "octahedral": unpack_octahedral}
"""What a buffer holds to a unit normal, by storage."""
