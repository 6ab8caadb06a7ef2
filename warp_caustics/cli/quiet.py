"""Start Warp without its banner."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

# Lines that are no news to somebody who asked for a map: this machine has no GPU; a later Warp will not run here.
HARMLESS = ("Could not find or load the NVIDIA CUDA driver", "Support for Python 3.10 is deprecated")


def start_warp() -> None:
    """Initialise Warp, silent unless it warns of something that matters here."""
    with _without_lines(HARMLESS):
        import warp as wp

        wp.config.log_level = wp.LOG_WARNING
        wp.init()


@contextmanager
def _without_lines(phrases: tuple[str, ...]) -> Iterator[None]:
    """Hold back what is written to the error stream, and pass on all lines but those with one of the phrases."""
    error_stream = 2  # native code writes to the descriptor itself, whatever `sys.stderr` is
    sys.stderr.flush()
    kept = os.dup(error_stream)
    with tempfile.TemporaryFile() as held:
        os.dup2(held.fileno(), error_stream)
        try:
            yield
        finally:
            sys.stderr.flush()
            os.dup2(kept, error_stream)
            os.close(kept)
            held.seek(0)
            for line in held.read().decode(errors="replace").splitlines():
                if not any(phrase in line for phrase in phrases):
                    print(line, file=sys.stderr)
