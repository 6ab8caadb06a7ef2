"""Frames with a clock around each launch, beside the renderer's own way to run them, which knows nothing of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import Any, Protocol

import warp as wp

from ..recording import Command
from ..renderer import Renderer

LEAST_FRAMES, MOST_FRAMES, ENOUGH_SECONDS = 3, 30, 5.0
"""Frames that are run each way: so many at least, and no more after so long."""

Launched = tuple[Any, float]
"""A command and its seconds."""


class Clock(Protocol):
    """Marks moments, and tells the seconds between two of them once the work is done."""

    def mark(self) -> Any:
        """Mark this moment."""

    def between(self, start: Any, end: Any) -> float:
        """Seconds from one mark to another."""


class HostClock:
    """Of launches that are over when they return."""

    def mark(self) -> float:
        """Mark this moment."""
        return perf_counter()

    def between(self, start: float, end: float) -> float:
        """Seconds from one mark to another."""
        return end - start


class EventClock:
    """Of a CUDA stream: its events stand between the launches, and the host need not wait for them."""

    def __init__(self, device: str) -> None:
        self._device = device

    def mark(self) -> wp.Event:
        """Mark this moment of the stream."""
        event = wp.Event(self._device, enable_timing=True)
        wp.get_stream(self._device).record_event(event)
        return event

    def between(self, start: wp.Event, end: wp.Event) -> float:
        """Seconds from one mark to another; waits for the later one."""
        return 1e-3 * float(wp.get_event_elapsed_time(start, end))


def make_clock(device: str) -> Clock:
    """Clock of a device."""
    return HostClock() if device == "cpu" else EventClock(device)


@dataclass(frozen=True)
class TracedStage:
    """A stage's lanes, and the seconds that all of it took."""

    lanes: list[list[Launched]]
    seconds: float


@dataclass(frozen=True)
class TracedFrame:
    """Seconds of a frame's parts.

    Attributes
    ----------
    host : float
        Spent on writing the phases, the sun and the clock, launches of simulated water aside.
    water : TracedStage
        Those launches, as one lane in order.
    stages : list of TracedStage
        As the renderer's.
    """

    host: float
    water: TracedStage
    stages: list[TracedStage]

    @property
    def seconds(self) -> float:
        """Of the frame."""
        return self.host + self.water.seconds + sum(stage.seconds for stage in self.stages)


def lane_seconds(lane: Iterable[Launched]) -> float:
    """Seconds of commands one after the other."""
    return sum(seconds for _, seconds in lane)


def traced_frame(renderer: Renderer, time: float) -> TracedFrame:
    """Run a frame at a time [s] with a clock around each launch."""
    wp.synchronize_device(renderer.plan.device)
    clock = make_clock(renderer.plan.device)
    water: list[tuple[Any, Any, Any]] = []

    def run(command: Any, launch: Callable[[], None]) -> None:
        start = clock.mark()
        launch()
        water.append((command, start, clock.mark()))

    first = clock.mark()
    with watched_launches(run):
        renderer.write(time)
    second = clock.mark()

    def run_lane(lane: list[Command]) -> list[Any]:
        marks = [clock.mark()]
        for command in lane:
            command.launch()
            marks.append(clock.mark())
        return marks

    threads = renderer.plan.threads
    # On a GPU one thread launches all lanes, as the renderer does: they are one stream.
    with ThreadPoolExecutor(threads) as pool:
        spread = pool.map if threads > 1 else map
        marks, ends = [], [clock.mark()]
        for stage in renderer.stages:
            marks.append(list(spread(run_lane, stage)))
            ends.append(clock.mark())
    launched = [(command, clock.between(start, end)) for command, start, end in water]
    stages = [
        TracedStage(
            [
                [(command, clock.between(*moments)) for command, moments in zip(lane, pairwise(of_lane), strict=True)]
                for lane, of_lane in zip(stage, of_stage, strict=True)
            ],
            clock.between(*around),
        )
        for stage, of_stage, around in zip(renderer.stages, marks, pairwise(ends), strict=True)
    ]
    whole = clock.between(first, second)
    # Launches side by side are longer than the time that they took.
    water_seconds = min(lane_seconds(launched), whole)
    return TracedFrame(whole - water_seconds, TracedStage([launched], water_seconds), stages)


def plain_frame(renderer: Renderer, time: float) -> float:
    """Run a frame at a time [s] as the renderer does, and give its seconds."""
    wp.synchronize_device(renderer.plan.device)
    clock = make_clock(renderer.plan.device)
    start = clock.mark()
    renderer.render(time)
    return clock.between(start, clock.mark())


@dataclass(frozen=True)
class Film:
    """Frames of a film, each way in turn: the fastest of both, and how many there were each way."""

    plain: float
    traced: TracedFrame
    frames: int


def run_film(renderer: Renderer, time: float, fps: float) -> Film:
    """Run the frames that follow one at a time [s], as they are and traced in turn."""
    plain, traced = [], []
    start, frames = perf_counter(), 0
    while frames < LEAST_FRAMES or (frames < MOST_FRAMES and perf_counter() - start < ENOUGH_SECONDS):
        plain.append(plain_frame(renderer, time + (2 * frames + 1) / fps))
        traced.append(traced_frame(renderer, time + (2 * frames + 2) / fps))
        frames += 1
    return Film(min(plain), min(traced, key=lambda frame: frame.seconds), frames)


@contextmanager
def watched_launches(run: Callable[[Any, Callable[[], None]], None]) -> Iterator[None]:
    """Have every recorded launch go through a function while a block runs: simulated water makes its own.

    Parameters
    ----------
    run : callable
        Is given a command and what launches it.
    """
    kind: Any = wp.Launch
    plain = kind.launch

    def launch(command: Any) -> None:
        run(command, lambda: plain(command))

    kind.launch = launch
    try:
        yield
    finally:
        kind.launch = plain
