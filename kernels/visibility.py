"""The visibility buffer: one 64-bit key a pixel, so that one atomic minimum keeps the nearest triangle."""

import warp as wp

EMPTY = 0xFFFFFFFFFFFFFFFF  # key of a pixel that sees nothing: farther than any depth
SIGN = wp.constant(wp.uint32(1 << 31))  # sign bit of a float32
INDEX = wp.constant(wp.uint64((1 << 31) - 1))  # the bits of a key that hold the triangle


@wp.func
def depth_code(depth: float) -> wp.uint32:
    """Code of a depth that orders as the depth does, negative ones included."""
    bits = wp.cast(depth + 0.0, wp.uint32)  # + 0: one zero
    if (bits & SIGN) != wp.uint32(0):
        return ~bits
    return bits | SIGN


@wp.func
def code_depth(code: wp.uint32) -> float:
    """Inverse of :func:`depth_code`."""
    if (code & SIGN) != wp.uint32(0):
        return wp.cast(code ^ SIGN, wp.float32)
    return wp.cast(~code, wp.float32)


@wp.func
def visibility_key(depth: float, triangle: int) -> wp.uint64:
    """Depth code above, triangle below: the least key is the nearest triangle, the lowest index among equals."""
    return (wp.uint64(depth_code(depth)) << wp.uint64(32)) | wp.uint64(triangle)


@wp.func
def key_depth(key: wp.uint64) -> float:
    """Depth that a key holds."""
    return code_depth(wp.uint32(key >> wp.uint64(32)))


@wp.func
def key_triangle(key: wp.uint64) -> int:
    """Triangle that a key holds."""
    return int(key & INDEX)
