"""From maps of steps to the caustic map: lanes added up, summed along the rows, scaled to irradiance."""

import functools

import warp as wp

RESIDUE = wp.constant(wp.float64(1.0e-9))
"""Of the steps of a row so far, all taken as positive: what is left of them when they have cancelled is less, and a
float32 beside them would not show it."""


@functools.cache
def make_resolve_steps(channels: int, colours: int) -> wp.Kernel:
    """Sum the lanes' steps along each row and scale them; ``colours`` of the map share ``channels`` of transport."""

    @wp.kernel(module="unique", enable_backward=False)
    def resolve(
        # In:
        begin: int,
        lanes: wp.array2d[wp.float64],
        columns: int,
        scale: wp.vec3d,
        # Out:
        map_out: wp.array[float],
    ):
        """One thread a row of the map, from row ``begin``."""
        row = wp.tid() + begin
        for c in range(wp.static(channels)):
            light = wp.float64(0.0)
            passed = wp.float64(0.0)
            for column in range(columns):
                at = (row * (columns + 1) + column) * wp.static(channels) + c
                step = wp.float64(0.0)
                for lane in range(lanes.shape[0]):
                    step += lanes[lane, at]
                light += step
                passed += wp.abs(step)
                shown = light
                if wp.abs(light) < RESIDUE * passed:
                    shown = wp.float64(0.0)
                out = (row * columns + column) * wp.static(colours)
                if wp.static(channels == 1):
                    for colour in range(wp.static(colours)):
                        map_out[out + colour] = float(shown * scale[colour])
                else:
                    map_out[out + c] = float(shown * scale[c])

    return resolve
