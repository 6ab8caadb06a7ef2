"""The camera's screen map: where it looks, what it reads there, and that a map alone makes nothing of it."""

from __future__ import annotations

import numpy as np
import pytest

import warp_caustics as wc

# Bilinear look-up between pixels and float32 depth: a smooth map of slope 1 per metre is read to 1e-4 of a metre.
LOOKED_UP = 1e-3


def scene(receiver: dict[str, object]) -> wc.Scene:
    eye = {
        "position": (1.0, 1.0, 5.0),
        "target": (1.0, 1.0, 0.0),
        "vertical_fov": 22.0,
        "resolution": (24, 16),
    }
    return wc.Scene(
        water={"level": 1.0, "waves": [{"amplitude": 0.01, "wavevector": (4.0, 2.0)}]},
        receiver=receiver,
        sun={"direction": (0.2, 0.0, -1.0)},
        medium={"ior": 1.333},
        map={"origin": (0.0, 0.0), "size": (2.0, 2.0), "resolution": (32, 32)},
        camera=eye,
    )


def with_ramp(result: wc.Result) -> wc.Result:
    """A result whose map is x + 10 y at each pixel's middle, so that what is read says where from."""
    at = (np.arange(32) + 0.5) / 16.0
    result.caustic_map[:] = at[None, :] + 10.0 * at[:, None]
    return result


def test_looking_straight_down_reads_the_map_where_it_looks(device: str) -> None:
    seen = with_ramp(wc.render(scene({"plane": 0.0}), device=device)).screen_map
    assert seen is not None and seen.shape == (16, 24) and seen.dtype == np.float32
    # Half the picture's height is 5 m tan 11°; columns run with x and rows with y under an eye that looks down.
    half = 5.0 * np.tan(np.radians(11.0))
    rows = 1.0 + half * ((np.arange(16) + 0.5) / 8.0 - 1.0)
    columns = 1.0 + half * ((np.arange(24) + 0.5) / 8.0 - 1.5)
    inside = (np.abs(columns - 1.0) < 0.95)[None, :] & (np.abs(rows - 1.0) < 0.95)[:, None]
    expected = columns[None, :] + 10.0 * rows[:, None]
    assert inside.any() and not inside.all()
    np.testing.assert_allclose(seen[inside], expected[inside], atol=LOOKED_UP)
    assert (seen[:, np.abs(columns - 1.0) > 1.0] == 0.0).all()  # beside the map there is no light to see


def test_a_leaning_floor_has_the_same_light_on_more_area(device: str) -> None:
    result = wc.render(scene({"terrain": {"base": 0.0, "slope": (0.3, -0.4)}}), device=device)
    result.caustic_map[:] = 1.0
    seen = result.screen_map
    assert seen is not None
    np.testing.assert_allclose(seen[8, 12], 1.0 / np.sqrt(1.25), rtol=1e-5)


def test_without_a_camera_there_is_none() -> None:
    eyeless = scene({"plane": 0.0}).model_dump(exclude_unset=True, exclude_none=True)
    del eyeless["camera"]
    assert wc.render(wc.Scene(**eyeless), device="cpu").screen_map is None


def test_a_map_alone_rasterizes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    import warp_caustics.screen as screen

    calls = []
    monkeypatch.setattr(screen, "rasterize", lambda *_, **__: calls.append(1))
    result = wc.render(scene({"plane": 0.0}), device="cpu")
    assert result.caustic_map.any() and not calls
    with pytest.raises(AttributeError):
        _ = result.screen_map
    assert calls
