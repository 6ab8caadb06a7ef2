"""The command line `warp-caustics`: exit status 0, 1 for a failure, 2 for bad input with one message."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from cyclopts import CycloptsError

from warp_caustics.cli import texture  # noqa: F401  it adds its command to the app
from warp_caustics.cli.commands import app
from warp_caustics.errors import InputError, WarpCausticsError

__all__ = ["main"]

STATUS_FAILURE = 1
STATUS_BAD_INPUT = 2
STATUS_INTERRUPTED = 130  # 128 + SIGINT, as shells say it


def main(tokens: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    tokens
        The words after the program's name; those of this process when left out.

    Returns
    -------
    int
        The exit status. A fault of this library itself is no bad input: it is not caught, and its traceback shows.
    """
    try:
        app(
            tokens,
            exit_on_error=False,
            print_error=False,
            result_action="return_none",
        )
    except (CycloptsError, InputError) as error:
        return _complain(error, STATUS_BAD_INPUT)
    except (WarpCausticsError, OSError) as error:
        return _complain(error, STATUS_FAILURE)
    except KeyboardInterrupt:
        return _complain("interrupted", STATUS_INTERRUPTED)
    return 0


def _complain(what: object, status: int) -> int:
    print(f"error: {what}", file=sys.stderr)
    return status
