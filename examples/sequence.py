"""Render moving water: everything is planned, compiled and allocated once, and each frame stays on the device."""

import warp as wp

import warp_caustics as wc

FRAMES_PER_SECOND = 24
FRAMES = 48

renderer = wc.Renderer(wc.load_scene("beach"))
print(renderer.plan)

for index in range(FRAMES):
    frame = renderer.render(index / FRAMES_PER_SECOND)
    # The map is a Warp array: torch.from_dlpack, cupy.from_dlpack and others take it as it is, without a copy.
    assert isinstance(frame.caustic_map, wp.array)

renderer.result().save("beach_last.png")  # only this reads the last frame back
