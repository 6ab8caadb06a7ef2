"""Render one caustic map, look at its numbers, and write it as EXR and as PNG."""

import numpy as np

import warp_caustics as wc

scene = wc.load_scene("pool")
result = wc.render(scene)

caustic_map = result.caustic_map  # float32 [rows, columns], row 0 at map.origin, in the units of sun.irradiance
print(f"{result.method} on {result.device}: {caustic_map.shape[1]} x {caustic_map.shape[0]} pixels")
print(f"irradiance: mean {caustic_map.mean():.3f}, largest {caustic_map.max():.3f}")

result.save("pool.exr")
result.save("pool.png")
assert np.array_equal(wc.load_map("pool.exr"), caustic_map)  # bit for bit
