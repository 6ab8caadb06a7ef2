"""Threads that run the lanes of a stage side by side.

A lane is a list of calls, each of which releases the interpreter for as long as its launches take. The thread that asks
takes lanes like the others, so that a stage of one lane wakes nobody, and Ctrl-C reaches it between two calls.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait

Calls = Sequence[Callable[[], None]]
"""A lane: calls in order."""

LOOK_SECONDS = 0.1
"""How often a thread that waits for the others tells how far they are: a bar need not move more often."""


class Crew:
    """A fixed number of threads, the caller's among them.

    Parameters
    ----------
    threads : int
        That work side by side; 1 starts none.
    """

    def __init__(self, threads: int = 1) -> None:
        self.threads = threads
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    def run(self, lanes: Sequence[Calls], tell: Callable[[int], None] | None = None) -> None:
        """Run all lanes and wait for them; what goes wrong in one is raised once none runs any more.

        Parameters
        ----------
        lanes : sequence of lanes
            Taken one after the other by whoever is free.
        tell : callable, optional
            Called on this thread, now and then, with how many calls have been made.
        """
        shift = _Shift(lanes)
        if self._pool is None or len(lanes) == 1:
            shift.work(tell)
            return
        helpers = [self._pool.submit(shift.work) for _ in range(min(self.threads, len(lanes)) - 1)]
        try:
            shift.work(tell)
            while wait(helpers, None if tell is None else LOOK_SECONDS).not_done:
                if tell is not None:
                    tell(shift.count)
        except BaseException:
            shift.stopped = True
            wait(helpers)
            raise
        for helper in helpers:
            helper.result()
        if tell is not None:
            tell(shift.count)


class _Shift:
    """The lanes of one stage that nobody has taken yet, and the calls that have been made."""

    def __init__(self, lanes: Sequence[Calls]) -> None:
        self._left = deque(lanes)
        self._made: deque[None] = deque()  # an integer would lose counts of threads that add to it at once
        self.stopped = False

    @property
    def count(self) -> int:
        return len(self._made)

    def work(self, tell: Callable[[int], None] | None = None) -> None:
        """Take lanes until none is left; what goes wrong in one stops all."""
        try:
            self._work(tell)
        except BaseException:
            self.stopped = True
            raise

    def _work(self, tell: Callable[[int], None] | None) -> None:
        while True:
            try:
                lane = self._left.popleft()
            except IndexError:
                return
            for call in lane:
                if self.stopped:
                    return
                call()
                self._made.append(None)
                if tell is not None:
                    tell(self.count)
