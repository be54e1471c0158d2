"""Files that are either whole or not there, and entries of caches that are as they were written."""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from smolux.errors import InputError

#: a temporary file this old is not being written: its process was killed
_STALE_SECONDS = 6 * 3600.0
#: names of temporary files, those of earlier versions in caches too
_TEMPORARY = re.compile(r"\.(?P<stem>.+)\.[0-9a-f]{8}(?P<suffix>\.[^.]*)?|tmp[a-z0-9_]{8}")

#: where this process has looked for what killed ones left behind
_looked_at: set[Path] = set()


def destination(path: str | os.PathLike[str]) -> Path:
    """Return the file that `replacing` writes, or raise an `InputError` if it cannot be one."""
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
    one is removed; that of a process that was killed is removed when the file is next written, some
    hours later.

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
    target = destination(path)
    temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}{target.suffix}")
    if target not in _looked_at:
        _looked_at.add(target)
        _remove_stale(target.parent, target)
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


# --- entries of caches ----------------------------------------------------------------------------


def keep(path: Path, content: bytes) -> None:
    """Write an entry of a cache with its checksum; `kept` reads it.

    The first time that a process writes to a folder, it removes what killed ones have left there.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.parent not in _looked_at:
        _looked_at.add(path.parent)
        _remove_stale(path.parent)
    with replacing(path) as temporary:
        temporary.write_bytes(_checksum(path, content) + content)


def kept(path: Path) -> bytes | None:
    """Read an entry that `keep` has written; None if there is none or if a bit of it has changed.

    Raises
    ------
    OSError
        If there is a file that cannot be read.
    """
    try:
        whole = path.read_bytes()
    except FileNotFoundError:
        return None
    size = hashlib.sha256().digest_size
    content = whole[size:]
    return content if whole[:size] == _checksum(path, content) else None


def _checksum(path: Path, content: bytes) -> bytes:
    # with the name: an entry that stands in the place of another is none
    return hashlib.sha256(path.name.encode() + b"\0" + content).digest()


def _remove_stale(folder: Path, target: Path | None = None) -> None:
    """Remove temporary files of processes that were killed: of one target, or all."""
    before = time.time() - _STALE_SECONDS
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            match = _TEMPORARY.fullmatch(entry.name)
            if match is None:
                continue
            own = target is None or (
                match["stem"] == target.stem and (match["suffix"] or "") == target.suffix
            )
            with suppress(OSError):
                if own and entry.is_file(follow_symlinks=False) and entry.stat().st_mtime < before:
                    os.unlink(entry.path)
