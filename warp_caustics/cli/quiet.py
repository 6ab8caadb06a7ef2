"""Start Warp without its banner."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"


def start_warp() -> None:
    """Initialise Warp, silent unless it warns; that a machine has no CUDA driver is no warning here."""
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING
    with _without_line(NO_DRIVER):
        wp.init()


@contextmanager
def _without_line(phrase: str) -> Iterator[None]:
    """Hold back what native code writes to the error stream, and pass on all lines but those with the phrase."""
    error_stream = 2  # native code writes to the descriptor itself, whatever `sys.stderr` is
    sys.stderr.flush()
    kept = os.dup(error_stream)
    with tempfile.TemporaryFile() as held:
        os.dup2(held.fileno(), error_stream)
        try:
            yield
        finally:
            os.dup2(kept, error_stream)
            os.close(kept)
            held.seek(0)
            for line in held.read().decode(errors="replace").splitlines():
                if phrase not in line:
                    print(line, file=sys.stderr)
