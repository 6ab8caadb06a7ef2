"""The reference in a renderer's place: a map is converged anew for each time."""

from __future__ import annotations

import os
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from ..plan import make_plan
from ..result import Result
from .plan import ReferencePlan

if TYPE_CHECKING:
    from ..renderer import Frame
    from ..scene import Scene
    from . import Reference


class ReferenceRenderer:
    """Converges frames of one scene; as :class:`~warp_caustics.Renderer`, but slow, and read back each time.

    Parameters
    ----------
    scene, device, threads
        As for :func:`~warp_caustics.make_plan`.

    Attributes
    ----------
    plan : ReferencePlan
        What it does, and what it leaves out.
    compile_seconds : float
        0: kernels are built, where there is no answer on the disk, within the first frame.
    """

    compile_seconds = 0.0

    def __init__(
        self, scene: Scene | str | os.PathLike[str], device: str | None = None, threads: int | None = None
    ) -> None:
        plan = make_plan(scene, "reference", device, threads)
        assert isinstance(plan, ReferencePlan)
        self.plan = plan
        self._made: tuple[float, float, Reference] | None = None

    def render(self, time: float = 0.0) -> Frame:
        """Converge the map at a time [s], or read it from the disk.

        Raises
        ------
        InputError
            If the time is not finite, or so late that the waves' phases are not known.
        """
        from ..renderer import Frame
        from . import make_reference

        plan, start = self.plan, perf_counter()
        reference = make_reference(plan.facts.scene, time, device=plan.device, threads=plan.threads)
        self._made = (time, perf_counter() - start, reference)
        return Frame(wp.array(reference.caustic_map, dtype=wp.float32, device=plan.device), None, time)

    def result(self) -> Result:
        """Give the last frame; converge the one at time 0 first if there is none."""
        if self._made is None:
            self.render(0.0)
        assert self._made is not None
        time, seconds, reference = self._made
        settings = self.plan.facts.scene.method.reference
        plan = self.plan
        if reference.error_bar > settings.tolerance:
            plan = replace(
                plan,
                warnings=(
                    *plan.warnings,
                    f"method.reference: rays ran out at an error bar of {reference.error_bar:.1e}, above the tolerance "
                    f"of {settings.tolerance:g}; more rays would bring it down",
                ),
            )
        return Result(
            scene=plan.facts.scene, method="reference", device=plan.device, time=time, plan=plan,
            caustic_map=reference.caustic_map.astype(np.float32), energy=reference.energy,
            seconds=seconds, assets=plan.facts.assets, error_bar=reference.error_bar,
            notes=reference.notes,
        )  # fmt: skip
