"""Ctrl-C that is never lost, and never comes while a file is written.

Python raises KeyboardInterrupt wherever the main thread happens to be. In a destructor it is printed and dropped; in
native code that calls back, such as a file format's, it may be dropped without a word, and the file cut short.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupt:
    """Remembers that Ctrl-C was pressed; a context within which it does so."""

    def __init__(self) -> None:
        self._asked = False
        self._held = False

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Take Ctrl-C for the length of the block, and raise it at its end at the latest."""
        if threading.current_thread() is not threading.main_thread():  # where no signal ever comes
            yield
            return
        before = signal.signal(signal.SIGINT, self._note)
        try:
            yield
            self.check()
        finally:
            signal.signal(signal.SIGINT, before)

    @contextmanager
    def hold(self) -> Iterator[None]:
        """Put Ctrl-C off until the block ends."""
        self._held = True
        try:
            yield
        finally:
            self._held = False
        self.check()

    def check(self) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed."""
        if self._asked:
            raise KeyboardInterrupt

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self._asked = True
        if not self._held:
            raise KeyboardInterrupt
