"""The rest of Mitsuba's scene: light, floor and sensor, about the water in the middle of the map."""

from __future__ import annotations

from typing import Any

import numpy as np

from oracle.setting import Setting
from oracle.surfaces import Array
from peer.water import SCALE, make_mesh, middle_of

SENSOR_HEIGHT = 0.75
"""Of the sensor over the floor, in depths; it must stay below the troughs. Its value changes no figure."""

EMITTER_HEIGHT = 0.25
"""Of the emitter's lowest corner over the highest crest, in depths. Its value changes no figure."""


def make_emitter(mi: Any, setting: Setting, low: Array, high: Array) -> Any:
    """Make the parallelogram whose light covers the rectangle from ``low`` to ``high`` at rest level, and no more."""
    middle = middle_of(setting)
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    places = np.array([(x, y, setting.water.base) for x, y in corners]) - middle
    # Each corner goes up against the light, on to one plane across it, whose lowest corner is over the crests.
    way = places @ setting.direction
    clear = setting.water.swing + EMITTER_HEIGHT * setting.rest_depth
    back = way - way.min() - clear / setting.direction[2]
    places = places - back[:, None] * setting.direction
    radiance = {"type": "rgb", "value": float(setting.irradiance[0])}
    light = mi.load_dict({"type": "directionalarea", "radiance": radiance})
    return make_mesh(mi, SCALE * places, np.array([[0, 2, 1], [0, 3, 2]]), emitter=light)


def make_floor(mi: Any, setting: Setting) -> dict[str, Any]:
    # A square from -1 to 1, scaled: twice as wide as the map, whose edges must not be the floor's.
    half = SCALE * max(setting.size)
    place = mi.ScalarTransform4f().translate([0.0, 0.0, -SCALE * setting.rest_depth]).scale([half, half, 1.0])
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}
    return {"type": "rectangle", "to_world": place, "bsdf": white}


def make_sensor(mi: Any, setting: Setting) -> dict[str, Any]:
    columns, rows = setting.resolution
    height = SENSOR_HEIGHT * setting.rest_depth
    down = -SCALE * setting.rest_depth
    look = mi.ScalarTransform4f().look_at(
        origin=[0.0, 0.0, down + SCALE * height], target=[0.0, 0.0, down], up=[0.0, 1.0, 0.0]
    )
    film = {"type": "hdrfilm", "width": columns, "height": rows, "pixel_format": "rgb", "component_format": "float32"}
    return {
        "type": "perspective",
        "fov_axis": "x",
        "fov": float(2.0 * np.degrees(np.arctan(0.5 * setting.size[0] / height))),
        "to_world": look,
        "near_clip": 0.1 * SCALE * height,
        "far_clip": 10.0 * SCALE * max(height, *setting.size),
        "film": {**film, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent"},
    }
