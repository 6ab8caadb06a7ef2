"""Recorded stages made ready to be run frame after frame: as graphs, which Warp replays without the interpreter.

On a CPU each lane of a stage is cut into graphs of bounded work, so that a long frame can be interrupted, and tell how
far it is, between them. On a GPU all stages are one graph, uploads from pinned memory included.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from threading import Lock
from typing import TYPE_CHECKING

import warp as wp

from .recording import Command, Stages, launches, work_of

if TYPE_CHECKING:
    from .crew import Calls, Crew

GRAPH_WORK = 2**20
"""Threads of the launches of a graph at most, unless one launch has more: some tenths of a second of photons."""

MOST_CAPTURED = 1024
"""Launches of a playback at most that are captured: a capture takes as long as a hundred launches from the interpreter,
and so many launches take so long by themselves that nobody would notice."""

_CAPTURING = Lock()
"""Warp captures one graph at a time."""


class Playback:
    """Stages of lanes of commands, ready to run.

    Parameters
    ----------
    stages : Stages
        One after the other; the lanes of a stage may run side by side.
    device : str
        Where they run.
    crew : Crew
        Who runs the lanes.

    Attributes
    ----------
    graphs : int
        How many were captured.
    refused : str
        Why launches are made one by one instead; empty where they are not.
    """

    def __init__(self, stages: Stages, device: str, crew: Crew) -> None:
        self._stages, self._device, self._crew = stages, wp.get_device(device), crew
        self.graphs, self.refused = 0, ""
        self._played = self._captured()
        self._calls = sum(len(lane) for lanes in self._played for lane in lanes)

    def run(self, progress: Callable[[float], None] | None = None) -> None:
        """Run all stages and, on a CPU, wait for them.

        Parameters
        ----------
        progress : callable, optional
            Called on this thread between graphs, with the share of them that has run.
        """
        if self._device.is_capturing and not _CAPTURING.locked():
            # The caller records a graph of his own, on this thread: graphs do not nest. On a CPU, Warp says that it
            # captures to all threads, and what another one has a playback for is not the caller's.
            for command in _commands(self._stages):
                command.launch()
            return
        before = 0
        for lanes in self._played:
            if progress is None:
                self._crew.run(lanes)
                continue
            self._crew.run(lanes, partial(_tell_share, progress, before, self._calls))
            before += sum(map(len, lanes))

    def _captured(self) -> list[list[Calls]]:
        """Capture the lanes, or say why not."""
        count = sum(1 for _ in _commands(self._stages))
        if count > MOST_CAPTURED:
            self.refused = f"{count} launches are more than {MOST_CAPTURED}"
        else:
            try:
                with _CAPTURING:
                    return self._capture()
            except (RuntimeError, NotImplementedError) as error:
                self.graphs, self.refused = 0, str(error)
        return [list(launches(stage)) for stage in self._stages]

    def _capture(self) -> list[list[Calls]]:
        if self._device.is_cuda:
            return [[[self._graph(_commands(self._stages))]]]
        return [[[self._graph(part) for part in _parts(lane)] for lane in stage] for stage in self._stages]

    def _graph(self, commands: Iterator[Command] | list[Command]) -> Callable[[], None]:
        with wp.ScopedCapture(device=self._device) as capture:
            for command in commands:
                command.launch()
        self.graphs += 1
        return partial(wp.capture_launch, capture.graph)


def _commands(stages: Stages) -> Iterator[Command]:
    return (command for stage in stages for lane in stage for command in lane)


def _parts(lane: list[Command]) -> Iterator[list[Command]]:
    """Cut a lane into parts of bounded work."""
    part: list[Command] = []
    work = 0
    for command in lane:
        more = work_of(command)
        if part and work + more > GRAPH_WORK:
            yield part
            part, work = [], 0
        part.append(command)
        work += more
    if part:
        yield part


def _tell_share(progress: Callable[[float], None], before: int, calls: int, made: int) -> None:
    progress((before + made) / calls)
