"""The recorded frame of a :class:`~warp_caustics.sequence.Sequence`.

Each launch is a stage, cut into bands of rows where its kernel can be; launches that a sequence has in lanes of their
own stand side by side. What launches of all bands add to exists once a band, and is added up where the lanes end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import warp as wp

from .bands import bind_lanes, fill_lanes
from .kernels.deposit import ACCUMULATOR
from .kernels.resolve import make_add_lanes
from .recording import DTYPES, Lanes, Stages, shaped
from .sequence import Fill, Lane, Sequence, Step

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
        self._others = dict(_others(plan, sequence))
        self.look_from(plan.facts.scene.camera)
        values = _Values({**sequence.values, **self.arrays, "clock": clock}, state)
        self.stages: Stages = [lanes for stage in sequence.stages for lanes in self._record(stage, values)]
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

    def _record(self, stage: tuple[Lane, ...], values: Mapping[str, Any]) -> Iterator[Lanes]:
        """Give the launches of a stage, side by side where they are of several lanes; then what adds up their sums."""
        for steps in side_by_side(stage):
            yield [lane for step in steps for lane in self._lanes(step, values)]
        summed = {name: None for lane in stage for step in lane for name in _sums(step) if name in self._others}
        lanes = [lane for name in summed for lane in self._add_up(name)]
        if lanes:
            yield lanes

    def _lanes(self, step: Step | Fill, values: Mapping[str, Any]) -> Lanes:
        device, threads = self._plan.device, self._plan.threads
        if isinstance(step, Fill):
            lanes = fill_lanes(self.arrays[step.buffer], step.value, threads, step.name)
            if step.buffer in self._others:
                lanes += fill_lanes(self._others[step.buffer], step.value, threads, step.name)
            return lanes
        dim = step.dim(device) if callable(step.dim) else step.dim
        own: list[dict[str, Any]] = []
        sums = _sums(step)
        if sums:
            threads = self._sequence.copies(threads)
            own = [{name: self._share(name, lane) for name in sums} for lane in range(threads)]
        return bind_lanes(
            step.kernel(), dim, values, device, threads, step.bind, own, weight=step.weight, pass_name=step.name
        )

    def _share(self, name: str, lane: int) -> Any:
        """What a lane adds to: the first to the buffer itself."""
        return self._others[name][lane - 1].reshape(self.arrays[name].shape) if lane else self.arrays[name]

    def _add_up(self, name: str) -> Lanes:
        total = self.arrays[name].flatten()
        kernel = make_add_lanes(_FORMATS[total.dtype])
        values = {"others": self._others[name], "total": total}
        return bind_lanes(kernel, total.shape, values, self._plan.device, self._plan.threads)


_FORMATS = {dtype: name for name, dtype in ACCUMULATOR.items()}


def side_by_side(stage: tuple[Lane, ...]) -> Iterator[list[Step | Fill]]:
    """Give the first launches of all lanes together, then the second ones, and so on, each after what it has filled.

    Lanes that differ by a fill keep step.
    """
    for turns in zip_longest(*map(_turns, stage), fillvalue=()):
        for kind in (Fill, Step):
            steps = [step for turn in turns for step in turn if isinstance(step, kind)]
            if steps:
                yield steps


def _turns(lane: Lane) -> Iterator[Lane]:
    """Cut a lane after each launch."""
    turn: Lane = ()
    for step in lane:
        turn = (*turn, step)
        if isinstance(step, Step):
            yield turn
            turn = ()
    if turn:
        yield turn


def _sums(step: Step | Fill) -> tuple[str, ...]:
    """Buffers that a launch adds to."""
    if isinstance(step, Fill):
        return ()
    names = (step.bind.get(parameter, parameter) for parameter in step.sums)
    return tuple(name for name in names if name is not None)


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


def _others(plan: Plan, sequence: Sequence) -> Iterator[tuple[str, Any]]:
    """Give the shares of all lanes but the first of what is added up, flat."""
    others = sequence.copies(plan.threads) - 1
    if not others:
        return
    for buffer in sequence.buffers:
        if buffer.per_lane:
            size = math.prod(buffer.shape)
            yield buffer.name, wp.zeros((others, size), dtype=DTYPES[buffer.dtype], device=plan.device)
