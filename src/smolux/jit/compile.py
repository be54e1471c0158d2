"""Compilation with a disk cache keyed on content.

Numba's own cache never hits for functions made inside functions (numba issue 6264), as every loop
here is, and answers with old code when only a callee was edited (numba issue 1833). This one keys
an entry on everything that decides the machine code: bytecode, constants, defaults, closure cells
and the globals reached, recursively through every function called. It hooks in where Numba's own
does; should those private names be gone, compilation still works, only slower to start.

Symbols need names that no other process gives. Numba numbers the functions it compiles from 1 in
every process, and of two symbols of one name the linker takes the first: a loop from the disk would
run the code of another loop, silently. So the numbers begin at random here.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import itertools
import os
import pickle
import re
import secrets
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

from smolux.functions.content import INSTALLED, OPTIONS, digest, is_frozen, module_of
from smolux.runtime.files import keep, kept

from . import pipeline

try:
    from numba.core.bytecode import FunctionIdentity
    from numba.core.caching import CompileResultCacheImpl, _Cache
    from numba.core.serialize import dumps

    _HOOKS = hasattr(FunctionIdentity, "_unique_ids") and all(
        hasattr(CompileResultCacheImpl, m) for m in ("reduce", "rebuild", "check_cachable")
    )
except ImportError:  # a later Numba: compile without a cache
    _HOOKS = False

#: a private option of Numba; without it loops are slower, not wrong
_NO_COUNTING = (
    {"_nrt": False} if "_nrt" in getattr(numba.core.options.DefaultOptions, "__dict__", {}) else {}
)

#: pieces are called from compiled code only; to call one from Python, take its ``py_func``
_NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

#: raised whenever what an entry holds changes
_FORMAT = 3

#: makes an index that is never negative: others may count from the end, which costs instructions
at = np.uint64

#: compile seconds and cache hits of this process, for reports
statistics = {"hits": 0, "misses": 0}


def _spare_blas() -> None:
    """Import Numba's functions of arrays without SciPy's linear algebra.

    They look for a BLAS when they are imported, and so load `scipy.linalg` into every process, for
    products of matrices that no loop here has. A function of the user that has one looks again
    when it is compiled.
    """
    try:
        from numba.np import linalg

        look = linalg.ensure_blas
    except (ImportError, AttributeError):  # a later Numba: start as it does
        return
    linalg.ensure_blas = lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = look


_spare_blas()


def cache_directory() -> Path | None:
    """Where compiled code is kept: ``SMOLUX_CACHE_DIR``, else the user's cache; None if off."""
    given = os.environ.get("SMOLUX_CACHE_DIR")
    if given is not None:
        return Path(given) if given else None
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return Path(base or Path.home() / ".cache") / "smolux"
    except RuntimeError:  # no home
        return None


if _HOOKS:

    def _renumber() -> None:
        """Give the functions compiled from here on numbers of their own."""
        FunctionIdentity._unique_ids = itertools.count(secrets.randbits(62))

    _renumber()
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_renumber)

    def _lasting(data: Any) -> bool:
        """Whether code works in another process, beside that of others."""
        numbered = f"v{data.fndesc.uid}" in data.fndesc.mangled_name
        # a function that calls itself is bound by its address in this process
        return numbered and ".numba.unresolved$" not in data.library.get_llvm_str()

    class _ContentCache(_Cache):
        """One file for each function content, signature and processor."""

        def __init__(self, dispatcher: Any, directory: Path) -> None:
            self._dispatcher = dispatcher
            self._directory = directory
            self._content: str | None = None
            self._impl = object.__new__(CompileResultCacheImpl)
            self._enabled = True

        @property
        def cache_path(self) -> str:
            return str(self._directory)

        def enable(self) -> None:
            self._enabled = True

        def disable(self) -> None:
            self._enabled = False

        def flush(self) -> None:
            self._content = None

        def _path(self, sig: Any, codegen: Any) -> Path:
            if self._content is None:
                self._content = digest(self._dispatcher)
            versions = _FORMAT, numba.__version__, np.__version__
            key = repr((self._content, str(sig), codegen.magic_tuple(), versions))
            return self._directory / f"{hashlib.sha256(key.encode()).hexdigest()[:40]}.nbc"

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            if not self._enabled:
                return None
            target_context.refresh()
            try:
                # code with one bit changed may crash, or give wrong numbers
                data = kept(self._path(sig, target_context.codegen()))
                if data is None:
                    return None
                result = self._impl.rebuild(target_context, pickle.loads(data))
            except Exception:  # an entry that cannot be read is as good as none
                return None
            statistics["hits"] += 1
            return result

        def save_overload(self, sig: Any, data: Any) -> None:
            statistics["misses"] += 1
            # a full or read-only disk, or code that cannot be written, costs time, not the run
            with contextlib.suppress(Exception):
                if not (self._enabled and self._impl.check_cachable(data) and _lasting(data)):
                    return
                keep(self._path(sig, data.codegen), dumps(self._impl.reduce(data)))


def piece(fn: Callable[..., Any] | None = None, /, **options: Any) -> Any:
    """Compile a small function that loops are assembled from; inlined there, not cached itself.

    Nothing is allocated in a loop, so reference counting is off: with it, an event would spend more
    time counting references to the arrays of the state than on its own work.
    """
    settings = {
        "nogil": True,
        "error_model": "numpy",
        "forceinline": True,
        **_NO_WRAPPERS,
        **_NO_COUNTING,
        **options,
    }
    if settings["no_cpython_wrapper"] and settings.get("_nrt") is False:
        settings |= pipeline.options()
    compiler = numba.njit(**settings)
    return compiler if fn is None else compiler(fn)


def cold_piece(fn: Callable[..., Any]) -> Any:
    """Compile a function that is called rarely: inlining it would only cost time."""
    return piece(fn, forceinline=False)


def user_piece(fn: Callable[..., Any]) -> Any:
    """Compile a function of the user, who may allocate; of a frozen one, with what it calls."""
    if not is_frozen(fn):
        return _allocating(fn)
    found = _linked(fn, {})

    @_allocating
    def number(*arguments):
        return 1.0 * found(*arguments)  # also of a truth value

    return number


def _allocating(fn: Callable[..., Any], **options: Any) -> Any:
    return piece(fn, forceinline=False, **dict.fromkeys(_NO_COUNTING, True), **options)


#: options of a user's own compiled function that decide its numbers
_KEPT = ("fastmath", "error_model", "boundscheck")


def _linked(fn: Any, done: dict[int, Any]) -> Any:
    """Compile a frozen function and, as parts of it, the functions that it reads."""
    if id(fn) in done:
        return done[id(fn)]
    space: dict[str, Any] = {}
    cells = tuple(types.CellType() for _ in fn.__closure__ or ())
    new = types.FunctionType(fn.__code__, space, fn.__name__, fn.__defaults__, cells)
    # what finds it on the disk imports its module: ours is always there, the user's may not be
    new.__qualname__, new.__module__ = fn.__qualname__, __name__
    given = getattr(fn, OPTIONS, {})
    made = done[id(fn)] = _allocating(new, **{k: given[k] for k in _KEPT if k in given})

    def link(value: Any) -> Any:
        if is_frozen(value):
            return _linked(value, done)
        if isinstance(value, types.ModuleType) and module_of(value) not in INSTALLED:
            copy = types.ModuleType(value.__name__)
            vars(copy).update({k: link(v) for k, v in vars(value).items()})
            return copy
        return value

    space.update({name: link(value) for name, value in fn.__globals__.items()})
    for cell, old in zip(cells, fn.__closure__ or (), strict=True):
        cell.cell_contents = link(old.cell_contents)
    return made


def why_not(fn: Callable[..., Any], arguments: int) -> str | None:
    """Say why Numba cannot compile a function of so many numbers; None if it can."""
    try:
        found = _linked(fn, {})
        found.compile((numba.float64,) * arguments)
        made = found.nopython_signatures[0].return_type
    except CompileError as error:
        lines = [x.strip() for x in _COLOURS.sub("", str(error)).splitlines() if x.strip()]
        reasons = [x for x in lines if not x.startswith(_NOISE)]
        places = [x for x in lines if x.startswith("File ")]
        where = f" ({places[-1].rstrip(':')})" if places else ""
        return f"{reasons[0] if reasons else type(error).__name__}{where}"
    if not isinstance(made, (numba.types.Number, numba.types.Boolean)):
        return f"it returns {made}, not a number"
    return None


#: raised where a function cannot be compiled
CompileError = numba.core.errors.NumbaError

_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_NOISE = ("Failed in nopython", "During:", "File ", ">>>", "- Resolution")


def entry(fn: Callable[..., Any]) -> Any:
    """Compile an assembled loop, called from Python, with the disk cache."""
    dispatcher = piece(fn, forceinline=False, **dict.fromkeys(_NO_WRAPPERS, False))
    directory = cache_directory()
    if _HOOKS and directory is not None and hasattr(dispatcher, "_cache"):
        dispatcher._cache = _ContentCache(dispatcher, directory)
    return dispatcher
