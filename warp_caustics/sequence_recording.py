"""The recorded frame of a :class:`~warp_caustics.sequence.Sequence`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import warp as wp

from .recording import DTYPES, Command, FillCommand, Stages, bind, shaped
from .sequence import Fill, Sequence, Step

if TYPE_CHECKING:
    from .energy import Energy
    from .plan import Plan
    from .scene import Camera
    from .state import SceneState


class SequenceRecording:
    """Stages of launches over buffers by name.

    Attributes
    ----------
    stages, caustic_map, screen_map
        As :class:`~warp_caustics.recording.Recording`.
    arrays : mapping
        Every buffer, upload and view, by name.
    """

    def __init__(self, plan: Plan, sequence: Sequence, state: Callable[[], SceneState], clock: wp.array) -> None:
        self._plan, self._sequence = plan, sequence
        self.arrays: dict[str, Any] = dict(_allocated(plan, sequence))
        self.look_from(plan.facts.scene.camera)
        values = _Values({**sequence.values, **self.arrays, "clock": clock}, state)
        self.stages: Stages = [
            [[self._command(step, values) for step in lane] for lane in stage] for stage in sequence.stages
        ]
        scene, colours = plan.facts.scene, len(plan.facts.irradiance)
        self.caustic_map = self.screen_map = None
        if sequence.caustic_map is not None:
            columns, rows = scene.map.resolution
            self.caustic_map = shaped(self.arrays[sequence.caustic_map], rows, columns, colours)
        if sequence.screen_map is not None and scene.camera is not None:
            columns, rows = scene.camera.resolution
            self.screen_map = shaped(self.arrays[sequence.screen_map], rows, columns, colours)

    def look_from(self, camera: Camera | None) -> None:
        """Write what follows the camera; allocates arrays the first time alone."""
        if self._sequence.views is None or camera is None:
            return
        for name, host in self._sequence.views(camera).items():
            if name in self.arrays:
                wp.copy(self.arrays[name], host)
            else:
                self.arrays[name] = wp.clone(host, device=self._plan.device)

    def energy(self) -> Energy | None:
        """Read back the ledger; None for a method that follows no light."""
        return None if self._sequence.energy is None else self._sequence.energy(self.arrays)

    def _command(self, step: Step | Fill, values: Mapping[str, Any]) -> Command:
        if isinstance(step, Fill):
            return FillCommand(self.arrays[step.buffer], step.value)
        device = self._plan.device
        dim = step.dim(device) if callable(step.dim) else step.dim
        return bind(step.kernel(), dim, values, device, step.bind)


class _Values(dict[str, Any]):
    """Values by name; what follows from the scene alone is only made when a kernel asks for it."""

    def __init__(self, values: Mapping[str, Any], state: Callable[[], SceneState]) -> None:
        super().__init__(values)
        self._state = state

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or name in ("scene", "suns")

    def __missing__(self, name: str) -> Any:
        return getattr(self._state(), name)


def _allocated(plan: Plan, sequence: Sequence) -> Iterator[tuple[str, Any]]:
    for buffer in sequence.buffers:
        yield buffer.name, wp.zeros(buffer.shape, dtype=DTYPES[buffer.dtype], device=plan.device)
    for name, make in sequence.uploads.items():
        yield name, make(plan.device)
