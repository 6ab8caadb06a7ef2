"""The renderer: allocates what the plan kept, once; compiles; launches; reads back only when asked."""

from __future__ import annotations

import functools
import os
from dataclasses import dataclass
from threading import RLock
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from .crew import Crew
from .dispersed_recording import DispersedRecording
from .dispersion import DispersedPlan
from .errors import InputError
from .lattice_recording import LatticeRecording
from .plan import Plan, make_plan
from .playback import Playback
from .program import Program
from .recording import CopyCommand, Recording, Stages
from .result import Result
from .scene import Scene, load_scene
from .sequence import Sequence
from .sequence_recording import SequenceRecording
from .state import SceneState
from .water import check_time

if TYPE_CHECKING:
    from collections.abc import Callable

    from .reference.renderer import ReferenceRenderer
    from .scene import Camera


@dataclass(frozen=True)
class Frame:
    """A frame on the device; its arrays are the renderer's own and hold until the next frame.

    Attributes
    ----------
    caustic_map, screen_map : wp.array or None
        float32 ``[rows, columns]`` or ``[rows, columns, 3]``, as :attr:`Result.caustic_map` and, for methods that look,
        :attr:`Result.screen_map`; None for what the method does not make.
    time : float
        [s].
    """

    caustic_map: wp.array | None
    screen_map: wp.array | None
    time: float


class Renderer:
    """Renders frames of one scene by one method.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file.
    method, device, threads
        As for :func:`~warp_caustics.make_plan`.

    Attributes
    ----------
    plan : Plan
        What it does, and what it leaves out.
    stages : Stages
        All that a frame launches: lanes of commands, stage by stage; what a simulation does to reach a time apart.
    playback : Playback
        What runs them, as graphs.
    compile_seconds : float
        Time that building and loading the kernels, and recording the launches, took.

    Raises
    ------
    InputError
        As :func:`~warp_caustics.make_plan`.
    """

    def __init__(
        self,
        scene: Scene | str | os.PathLike[str],
        method: str | None = None,
        device: str | None = None,
        threads: int | None = None,
    ) -> None:
        plan = make_plan(scene, method, device, threads)
        if not isinstance(plan, Plan | DispersedPlan):
            raise InputError("method: a reference is converged anew for each frame; use warp_caustics.render(...)")
        self.plan: Plan | DispersedPlan = plan
        self._states: list[SceneState] = []
        self._camera: Camera | None = None  # where it was moved to
        self._crew = Crew(plan.threads)
        # Frames share all arrays: of two at once, each would change under the other's feet what it has checked.
        self._rendering = RLock()
        # Pinned on the host, so that the copy can be part of a graph; on a CPU it is the device's own.
        pinned = plan.device != "cpu"
        host_clock = wp.zeros(1, dtype=wp.float64, device="cpu", pinned=pinned)
        self._host_time = host_clock.numpy()
        self._clock = wp.zeros(1, dtype=wp.float64, device=plan.device) if pinned else host_clock
        # After it the frame has read all that the host wrote for it.
        self._done = wp.Event(plan.device) if pinned else None
        start = perf_counter()
        self._recording = self._record()
        uploads: Stages = [[[CopyCommand(self._clock, host_clock)]]] if pinned else []
        self.stages: Stages = [
            *uploads, *(stage for state in self._states for stage in state.stages), *self._recording.stages,
        ]  # fmt: skip
        self.playback = Playback(self.stages, plan.device, self._crew)
        self.compile_seconds = perf_counter() - start
        self._time: float | None = None
        self._asked = 0.0
        self._seconds = 0.0

    def render(self, time: float = 0.0, progress: Callable[[float], None] | None = None) -> Frame:
        """Render the frame at a time [s]: no allocation, no read-back.

        Parameters
        ----------
        time : float
            [s].
        progress : callable, optional
            Called on this thread, now and then, with the share of the frame that is done.

        Returns
        -------
        Frame
            On the device; on a GPU the work may still be under way.

        Raises
        ------
        InputError
            If the time is not finite, so late that the waves' phases are not known, or one that the water's
            simulation does not reach.
        """
        with self._rendering:
            self.write(time)
            self._asked, self._time = time, None  # a frame that is interrupted is none
            start = perf_counter()
            self.playback.run(progress)
            device = wp.get_device(self.plan.device)
            if self._done is not None and not device.is_capturing:
                device.stream.record_event(self._done)
            self._time, self._seconds = time, perf_counter() - start
        return Frame(self._recording.caustic_map, self._recording.screen_map, time)

    def write(self, time: float) -> None:
        """Do a frame's part that is not in :attr:`stages`, as :meth:`render` does first; raises as it does."""
        check_time(time)
        if self._done is not None and not wp.get_device(self.plan.device).is_capturing:
            wp.synchronize_event(self._done)
        for state in self._states:
            state.prepare(time)
        self._host_time[0] = time

    def look_from(self, camera: Camera) -> None:
        """Move the camera of a method that looks; the next frame is seen from there.

        Allocates nothing on the device.

        Raises
        ------
        InputError
            If the method does not look, or the camera has another resolution.
        """
        if not isinstance(self._recording, SequenceRecording) or self._recording.screen_map is None:
            raise InputError(f'method "{self.plan.method}" does not look through a camera')
        was = self.plan.facts.scene.camera
        if was is not None and camera.resolution != was.resolution:
            raise InputError(
                f"camera.resolution: expected {list(was.resolution)}, which buffers are made for, got "
                f"{list(camera.resolution)}"
            )
        self._recording.look_from(camera)
        self._camera = camera

    def result(self) -> Result:
        """Read back the last frame; render it first if there is none, or it was interrupted."""
        if self._time is None:
            self.render(self._asked)
        start = perf_counter()
        wp.synchronize_device(self.plan.device)
        waited = perf_counter() - start if self.plan.device != "cpu" else 0.0
        facts, recording = self.plan.facts, self._recording
        waters = [state.simulated for state in self._states if state.simulated is not None]
        return Result(
            scene=facts.scene if self._camera is None else facts.scene.model_copy(update={"camera": self._camera}),
            method=self.plan.method,
            device=self.plan.device,
            time=self._time or 0.0,
            plan=self.plan,
            caustic_map=_read(recording.caustic_map),
            energy=recording.energy(),
            seconds=self._seconds + waited,
            assets=facts.assets,
            own_screen_map=_read(recording.screen_map),
            notes=tuple(dict.fromkeys(note for water in waters for note in water.warnings())),
        )

    def _record(self) -> Recording:
        plan = self.plan
        if isinstance(plan, DispersedPlan):
            return DispersedRecording(plan, [self._record_lattice(channel) for channel in plan.plans])
        if isinstance(plan.program, Sequence):
            # What the kernels know of the scene is made when the first of them asks for it.
            state = functools.cache(lambda: self._scene_state(plan))
            return SequenceRecording(plan, plan.program, state, self._clock)
        return self._record_lattice(plan)

    def _record_lattice(self, plan: Plan) -> LatticeRecording:
        assert isinstance(plan.program, Program)
        return LatticeRecording(plan, plan.program, self._scene_state(plan))

    def _scene_state(self, plan: Plan) -> SceneState:
        self._states.append(SceneState(plan.facts, plan.device, self._crew))
        return self._states[-1]


def _read(array: wp.array | None) -> np.ndarray | None:
    return None if array is None else array.numpy().copy()


def make_renderer(
    scene: Scene | str | os.PathLike[str],
    method: str | None = None,
    device: str | None = None,
    threads: int | None = None,
) -> Renderer | ReferenceRenderer:
    """Make the renderer of a method: the reference has one of its own.

    Raises
    ------
    InputError
        As :func:`~warp_caustics.make_plan`.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    if (scene.method.name if method is None else method) == "reference":
        from .reference.renderer import ReferenceRenderer

        return ReferenceRenderer(scene, device, threads)
    return Renderer(scene, method, device, threads)


def render(
    scene: Scene | str | os.PathLike[str],
    method: str | None = None,
    device: str | None = None,
    threads: int | None = None,
    time: float = 0.0,
) -> Result:
    """Render one caustic map.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file.
    method, device, threads
        As for :func:`~warp_caustics.make_plan`.
    time : float
        [s].

    Returns
    -------
    Result

    Raises
    ------
    InputError
        As :func:`~warp_caustics.make_plan`.
    """
    renderer = make_renderer(scene, method, device, threads)
    renderer.render(time)
    return renderer.result()
