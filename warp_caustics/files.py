"""Files that appear whole or not at all, and the names of numbered sequences."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import stat
from collections.abc import Iterator
from pathlib import Path

from warp_caustics.errors import InputError, RenderError

TOKEN_BYTES = 8
"""Random bytes in a temporary name: two writers of one folder never meet, within any practical chance."""

_FIELD_LIKE = re.compile(r"%[ \d+-]*d")
_FIELD = re.compile(r"%(?:0[1-9]\d?)?d")


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path to write to, which takes the place of `path` only when the block ends well.

    The temporary file stands in the same folder, so that the last step is one rename, and keeps the suffix, by which
    libraries choose a format. If the block raises anything, Ctrl-C included, the temporary file is removed, and what
    stood at `path` before stands there still. A symbolic link is followed, and kept.

    Parameters
    ----------
    path
        The file to be.

    Yields
    ------
    Path
        An existing, empty file to be overwritten.

    Raises
    ------
    InputError
        `path` cannot be written; see `check_writable`.
    RenderError
        Writing failed although it had begun: the disk is full, for example.
    """
    target = _target(path)
    temporary = _name_beside(target)
    try:
        _create(temporary)
        yield temporary
        temporary.replace(target)
    except BaseException as error:
        # The error that is on its way says more than a failure to clear up after it.
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise RenderError(f"cannot write {os.fspath(path)!r}: {error.strerror or error}") from error
        raise


def check_writable(path: str | os.PathLike[str]) -> None:
    """Make sure, before long work starts, that `path` can be written when it ends.

    A temporary file is really made in the folder and removed again: permission bits do not say whether a process that
    runs as root can write, nor whether a file system is mounted read-only.

    Raises
    ------
    InputError
        The folder is missing, is no folder, or cannot be written; or `path` is a folder, a device or a pipe, or is
        write-protected.
    """
    temporary = _name_beside(_target(path))
    try:
        _create(temporary)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def check_folder(folder: str | os.PathLike[str], *names: str) -> None:
    """Make sure, before long work starts, that files can be written into a folder, which need not exist yet.

    Parameters
    ----------
    folder
        Where to.
    names
        Of the files.

    Raises
    ------
    InputError
        It is no folder, it or one of the files cannot be written, or it could not be made.
    """
    there = Path(folder)
    if there.is_dir():
        for name in names:
            check_writable(there / name)
        return
    while not there.parent.exists():
        there = there.parent
    if there.exists() or there.is_symlink():
        raise InputError(f"cannot write into {os.fspath(folder)!r}: {str(there)!r} is not a folder")
    check_writable(there)


def is_sequence(pattern: str | os.PathLike[str]) -> bool:
    """Tell whether a file name asks for a number, as `out.%04d.exr` does; `%%` stands for a percent sign."""
    return _FIELD_LIKE.search(Path(pattern).name.replace("%%", "")) is not None


def frame_path(pattern: str | os.PathLike[str], index: int) -> Path:
    """Name of one frame of a numbered sequence: `frame_path("out.%04d.exr", 7)` is `out.0007.exr`.

    Only the file name is a pattern, never the folder, so that a percent sign in a folder's name is itself.

    Raises
    ------
    InputError
        The file name has not exactly one field `%d` or `%0Nd`.
    """
    path = Path(pattern)
    name = path.name.replace("%%", "")
    if len(_FIELD.findall(name)) != 1 or name.count("%") != 1:
        raise InputError(
            f"{os.fspath(pattern)!r} does not name a sequence: its file name needs exactly one number field,"
            " such as out.%04d.exr"
        )
    return path.with_name(path.name % index)


def _target(path: str | os.PathLike[str]) -> Path:
    """Resolve `path`, and refuse it where a file cannot stand."""
    shown = os.fspath(path)
    target = Path(path)
    try:
        # The link's own target is replaced, not the link.
        target = target.resolve()
        if target.is_symlink():  # Python 3.13 resolves a loop of links to itself, and says nothing
            raise InputError(f"cannot write {shown!r}: it is a loop of symbolic links")
        mode = target.stat().st_mode if target.exists() else None
        folder_mode = target.parent.stat().st_mode if target.parent.exists() else None
    except (OSError, ValueError, RuntimeError) as error:  # too long a name, a null character, a loop of links
        raise InputError(f"cannot write {shown!r}: {getattr(error, 'strerror', None) or error}") from None
    if folder_mode is None:
        raise InputError(f"cannot write {shown!r}: the folder {str(target.parent)!r} does not exist")
    if not stat.S_ISDIR(folder_mode):
        raise InputError(f"cannot write {shown!r}: {str(target.parent)!r} is not a folder")
    if mode is not None and stat.S_ISDIR(mode):
        raise InputError(f"cannot write {shown!r}: it is a folder; name a file in it")
    if mode is not None and not stat.S_ISREG(mode):
        # A rename would put a plain file where, say, /dev/null stood.
        raise InputError(f"cannot write {shown!r}: it is a device or a pipe, not a file")
    if mode is not None and not os.access(target, os.W_OK):
        # A rename would pass over the protection of the file, since it asks for the folder's permission only.
        raise InputError(f"cannot write {shown!r}: it is there already and write-protected")
    return target


def _name_beside(target: Path) -> Path:
    """Choose a name that is free in the folder of `target`, with its suffix."""
    return target.with_name(f".warp-caustics-{secrets.token_hex(TOKEN_BYTES)}{target.suffix}")


def _create(temporary: Path) -> None:
    """Create an empty file that is new."""
    # Not tempfile.mkstemp: its files are readable by their owner alone, and the rename would keep that.
    try:
        temporary.touch(exist_ok=False)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"the folder {str(temporary.parent)!r} cannot be written: {reason}") from None
