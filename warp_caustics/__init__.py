"""Water caustics by the real-time techniques of the literature, on NVIDIA Warp kernels, CUDA and CPU.

The public names are loaded when they are first used: importing the package does not initialise Warp, import a plotting
or file library, or change a global setting.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from warp_caustics.errors import InputError, RenderError, WarpCausticsError

if TYPE_CHECKING:
    from warp_caustics.comparison import Comparison, compare
    from warp_caustics.exr import load_map
    from warp_caustics.plan import Plan, make_plan
    from warp_caustics.profiling import Profile, profile
    from warp_caustics.reference import Reference, make_reference
    from warp_caustics.renderer import Renderer, render
    from warp_caustics.result import Result
    from warp_caustics.scene import Scene, bundled_scenes, load_scene
    from warp_caustics.texture import Texture, make_texture

__version__ = "0.1.0"

__all__ = [
    "Comparison",
    "InputError",
    "Plan",
    "Profile",
    "Reference",
    "RenderError",
    "Renderer",
    "Result",
    "Scene",
    "Texture",
    "WarpCausticsError",
    "__version__",
    "bundled_scenes",
    "compare",
    "load_map",
    "load_scene",
    "make_plan",
    "make_reference",
    "make_texture",
    "profile",
    "render",
]

# Public name -> the module that defines it.
_HOMES = {
    "Comparison": "comparison",
    "Plan": "plan",
    "Profile": "profiling",
    "Reference": "reference",
    "Renderer": "renderer",
    "Result": "result",
    "Scene": "scene",
    "Texture": "texture",
    "bundled_scenes": "scene",
    "compare": "comparison",
    "load_map": "exr",
    "load_scene": "scene",
    "make_plan": "plan",
    "make_reference": "reference",
    "make_texture": "texture",
    "profile": "profiling",
    "render": "renderer",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
