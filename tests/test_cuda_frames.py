"""What a GPU's benchmark measures, gone through on any device at tiny sizes."""

import pytest
from cuda_frames import COLOURS, SCREENS, TEXELS, cases, passes

import warp_caustics as wc

DIVISOR = 64  # screens of 30 x 16 pixels, light views of 32 texels
SMALL = ("gather 400x300", "cascades pool 1080p mono point")
PLENTY = 1e9  # bytes a second


def test_all_that_was_promised_is_there():
    scenes = {case.name: case.scene(1) for case in cases()}
    assert len(scenes) == 3 + 2 * len(SCREENS) * len(COLOURS) * 2
    for name, scene in scenes.items():
        if name.startswith("gather"):
            assert scene.method.gather.n == 7 and scene.method.gather.m == 6
            assert name == "gather {}x{}".format(*scene.map.resolution)
        else:
            assert scene.method.cascaded.count == 4 and scene.method.cascaded.resolution == TEXELS
            assert scene.camera.resolution in ((1920, 1080), (3840, 2160))
            channels = wc.make_plan(case_small(name), device="cpu").facts.spec.channels
            assert channels == (1 if "mono" in name else 3)


def case_small(name):
    return next(case for case in cases() if case.name == name).scene(DIVISOR)


@pytest.mark.parametrize("name", SMALL)
def test_passes_are_timed_and_their_bytes_counted(device, name):
    renderer = wc.Renderer(case_small(name), device=device, threads=1)
    result = renderer.result()
    light = result.caustic_map if result.screen_map is None else result.screen_map
    assert light.sum() > 0.0
    timed = passes(renderer, PLENTY)
    launches = sum(len(lane) for stage in renderer._recording.stages for lane in stage)
    assert sum(each.launches for each in timed) == launches
    assert all(each.seconds > 0.0 and each.bytes > 0 for each in timed)
    assert all(each.share == pytest.approx(each.bytes / PLENTY / each.seconds) for each in timed)
    # An array is counted once, and none is larger than what the plan allocates.
    assert max(each.bytes for each in timed) < 2 * renderer.plan.bytes
    assert "gather" in name or "cascade_photons" in {each.name for each in timed}
