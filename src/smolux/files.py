"""Files that are either whole or not there."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import InputError


def _checked(path: str | os.PathLike[str]) -> Path:
    # through a link to the file it stands for, so that the link survives
    target = Path(os.path.realpath(os.path.expanduser(path)))
    if target.is_dir():
        raise InputError(f"path = {os.fspath(path)!r}: is a folder; name a file in it")
    if not target.parent.is_dir():
        raise InputError(
            f"path = {os.fspath(path)!r}: there is no folder {str(target.parent)!r}; "
            "create it first"
        )
    return target


def _sync(path: Path, flags: int) -> None:
    """Have the system write a file or a folder to the disk."""
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file whole or not at all.

    Yields a temporary name in the same folder, with the same suffix. When the block ends, what
    was written there is flushed to the disk and takes the place of `path` in one step. If the
    block raises, or the process is interrupted in it, an old file stays as it was and the temporary
    one is removed.

    Do not let HDF5 write there: when the disk fills up, it ends the process with a segmentation
    fault (h5py issue 914). Make such a file in memory and write its bytes.

    Parameters
    ----------
    path : str or path
        The file to write; its folder must exist.

    Yields
    ------
    pathlib.Path
        The temporary file, empty, for the block to write.

    Raises
    ------
    InputError
        If `path` is a folder or its folder is not there.
    OSError
        If it cannot be written: the disk is full, the folder is read-only, ...

    Examples
    --------
    >>> with replacing("report.html") as temporary:  # doctest: +SKIP
    ...     temporary.write_text(page)
    """
    target = _checked(path)
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}{target.suffix}")
    try:
        # rather than by `tempfile`, so that the permissions are the user's usual ones
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield temporary
        _sync(temporary, os.O_RDWR)
        os.replace(temporary, target)
    except OSError as error:
        _remove(temporary)
        state = "the old file is as it was" if target.exists() else "nothing was written"
        reason = os.strerror(error.errno) if error.errno else str(error)
        message = f"cannot write {str(target)!r}: {reason}; {state}"
        raise OSError(error.errno or errno.EIO, message) from error
    except BaseException:
        _remove(temporary)
        raise
    if os.name == "posix":
        # the new name is in the folder, which some file systems will not sync
        with suppress(OSError):
            _sync(target.parent, os.O_RDONLY)


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
