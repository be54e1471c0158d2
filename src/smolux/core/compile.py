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
import secrets
import tempfile
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

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
_FORMAT = 2

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


class _Digest:
    """Digest of a function and of everything it reaches."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._seen: dict[int, int] = {}
        #: what is known by its address, which must not pass to another object
        self._kept: list[Any] = []
        self._taken: set[tuple[int, str]] = set()

    def hexdigest(self) -> str:
        return self._hash.hexdigest()

    def add(self, value: Any) -> None:
        if isinstance(value, numba.core.dispatcher.Dispatcher):
            self._text("dispatcher")
            for name, option in sorted(value.targetoptions.items()):
                self._text(name)
                self.add(option)
            self._function(value.py_func)
        elif isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(getattr(value, "_defn", None), types.FunctionType):  # an intrinsic
            self._function(value._defn)
        elif isinstance(value, types.CodeType):
            self._code(value)
        elif isinstance(value, types.ModuleType):
            self._text(f"module {value.__name__} {getattr(value, '__version__', '')}")
        elif isinstance(value, np.ndarray):
            self._text(f"array {value.dtype} {value.shape}")
            self._hash.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, (set, frozenset)):  # their order differs between processes
            self.add(sorted(value, key=repr))
        elif isinstance(value, (tuple, list)):
            self._text(f"{type(value).__name__} {len(value)}")
            for item in value:
                self.add(item)
        elif isinstance(value, type):
            self._text(
                f"type {value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
            )
        elif type(value).__module__.startswith("numba.") and hasattr(value, "__wrapped__"):
            self._text(type(value).__name__)  # of numba.vectorize, numba.cfunc
            self.add(value.__wrapped__)
        else:  # numbers, strings, None, builtins: their text says it all
            name = getattr(value, "__qualname__", None)
            home = getattr(value, "__module__", "")
            self._text(f"{type(value).__name__} {f'{home}.{name}' if name else repr(value)}")

    def _text(self, text: str) -> None:
        self._hash.update(text.encode() + b"\0")

    def _code(self, code: types.CodeType) -> None:
        self._hash.update(code.co_code)
        self._text(f"{code.co_names} {code.co_varnames} {code.co_freevars} {code.co_cellvars}")
        for constant in code.co_consts:
            self.add(constant)

    def _function(self, fn: types.FunctionType) -> None:
        if id(fn) in self._seen:
            self._text(f"again {self._seen[id(fn)]}")
            return
        self._seen[id(fn)] = len(self._seen)
        self._kept.append(fn)
        self._code(fn.__code__)
        self.add(fn.__defaults__ or ())
        names = _names(fn.__code__)
        for cell in fn.__closure__ or ():
            self._reached(cell.cell_contents, names)
        for name in names:
            if name in fn.__globals__:
                self._text(f"global {name}")
                self._reached(fn.__globals__[name], names)

    def _reached(self, value: Any, names: list[str]) -> None:
        """Add a value; of a module of the user also what may be taken from it by one of `names`."""
        self.add(value)
        if isinstance(value, types.ModuleType) and not _installed(value):
            for name in names:
                # each function may take something else from the same module
                if hasattr(value, name) and (id(value), name) not in self._taken:
                    self._taken.add((id(value), name))
                    self._kept.append(value)
                    self._text(f"attribute {name}")
                    self._reached(getattr(value, name), names)


def _names(code: types.CodeType) -> list[str]:
    names = list(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names += _names(constant)
    return names


def _installed(module: types.ModuleType) -> bool:
    """Whether a module's version speaks for its content."""
    return module.__name__.partition(".")[0] in {"numpy", "math", "numba", "scipy"}


def digest(fn: Callable[..., Any]) -> str:
    """Digest of everything that decides the machine code of a function."""
    d = _Digest()
    d.add(fn)
    return d.hexdigest()


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
                data = self._path(sig, target_context.codegen()).read_bytes()
                result = self._impl.rebuild(target_context, pickle.loads(data))
            except FileNotFoundError:
                return None
            except Exception:  # a damaged or foreign entry is as good as none
                return None
            statistics["hits"] += 1
            return result

        def save_overload(self, sig: Any, data: Any) -> None:
            statistics["misses"] += 1
            # a full or read-only disk, or code that cannot be written, costs time, not the run
            with contextlib.suppress(Exception):
                if not (self._enabled and self._impl.check_cachable(data) and _lasting(data)):
                    return
                path = self._path(sig, data.codegen)
                path.parent.mkdir(parents=True, exist_ok=True)
                fd, temporary = tempfile.mkstemp(dir=path.parent)
                try:
                    with os.fdopen(fd, "wb") as f:
                        f.write(dumps(self._impl.reduce(data)))
                    os.replace(temporary, path)
                except BaseException:
                    os.unlink(temporary)
                    raise


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
    """Compile a function of the user, who may allocate."""
    return piece(fn, forceinline=False, **dict.fromkeys(_NO_COUNTING, True))


def entry(fn: Callable[..., Any]) -> Any:
    """Compile an assembled loop, called from Python, with the disk cache."""
    dispatcher = piece(fn, forceinline=False, **dict.fromkeys(_NO_WRAPPERS, False))
    directory = cache_directory()
    if _HOOKS and directory is not None and hasattr(dispatcher, "_cache"):
        dispatcher._cache = _ContentCache(dispatcher, directory)
    return dispatcher
