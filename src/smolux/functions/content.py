"""What a function of the user is: its content, not the object that holds it.

A function that reads a global, a helper or a closure is another function once one of these is
changed, as a cell of a notebook that is edited and run again changes them. So a function is frozen
when a run begins: copied with all that it reads. Of the same content there is one frozen copy, so
whatever is remembered of a function by its identity, here or on disk, is remembered by content.
"""

from __future__ import annotations

import builtins
import copy
import hashlib
import types
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

#: options of Numba with which a frozen function is compiled, where the user gave some
OPTIONS = "__smolux_options__"
#: set on a frozen function
_MARK = "__smolux_frozen__"


def compiled(value: Any) -> bool:
    """Whether a value is a function that Numba compiles."""
    return isinstance(getattr(value, "py_func", None), types.FunctionType) and hasattr(
        value, "targetoptions"
    )


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
        if compiled(value):
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
        else:
            self._other(value)

    def _other(self, value: Any) -> None:
        if type(value).__module__.startswith("numba.") and hasattr(value, "__wrapped__"):
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
        names = names_in(fn.__code__)
        for cell in fn.__closure__ or ():
            self._reached(cell.cell_contents, names)
        for name in names:
            if name in fn.__globals__:
                self._text(f"global {name}")
                self._reached(fn.__globals__[name], names)

    def _reached(self, value: Any, names: list[str]) -> None:
        """Add a value; what has attributes of the user, also with those that `names` may take."""
        self.add(value)
        if _holds(value):
            for name in names:
                # each function may take something else from the same module
                if _has(value, name) and (id(value), name) not in self._taken:
                    self._taken.add((id(value), name))
                    self._kept.append(value)
                    self._text(f"attribute {name}")
                    self._reached(getattr(value, name), names)


def _holds(value: Any) -> bool:
    """Whether functions may read attributes of a value: of a module, a class or an object."""
    if isinstance(value, (types.ModuleType, type)):
        return module_of(value) not in INSTALLED
    return hasattr(value, "__dict__") and type(value).__module__.partition(".")[0] not in {
        *INSTALLED,
        "builtins",
    }


def _has(value: Any, name: str) -> bool:
    """Whether a value has an attribute; that of a class may be inherited, of a module made."""
    if isinstance(value, (types.ModuleType, type)):
        return hasattr(value, name)
    return name in vars(value)


def names_in(code: types.CodeType) -> list[str]:
    """Names that a function reads, and those of functions within it."""
    names = list(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names += names_in(constant)
    return names


#: packages whose version speaks for their content
INSTALLED = {"numpy", "math", "numba", "scipy"}


def module_of(value: Any) -> str:
    """Top package of a module, or of that of a function."""
    plain = getattr(value, "py_func", value)
    name = plain.__name__ if isinstance(plain, types.ModuleType) else plain.__module__
    return str(name).partition(".")[0]


def digest(fn: Callable[..., Any]) -> str:
    """Digest of everything that decides the machine code of a function."""
    d = _Digest()
    d.add(fn)
    return d.hexdigest()


def frozen(value: Any) -> Any:
    """Freeze the functions of the user in a value, with all that they read.

    Parameters
    ----------
    value : any
        A function, a dataclass such as a model, whose fields may hold functions, or a sequence or
        mapping of these. What holds no function is returned as it is.

    Returns
    -------
    any
        For equal content, the same function.
    """
    if compiled(value) or isinstance(value, types.FunctionType):
        return _frozen_function(value)
    if is_dataclass(value) and not isinstance(value, type):
        changed = {}
        for f in fields(value):
            old = getattr(value, f.name)
            if (new := frozen(old)) is not old:
                changed[f.name] = new
        return replace(value, **changed) if changed else value
    if type(value) in (tuple, list):
        parts = [frozen(part) for part in value]
        same = all(a is b for a, b in zip(parts, value, strict=True))
        return value if same else type(value)(parts)
    if isinstance(value, Mapping):
        entries = {key: frozen(part) for key, part in value.items()}
        return value if all(entries[key] is value[key] for key in value) else entries
    return value


def is_frozen(value: Any) -> bool:
    """Whether a value is a frozen function."""
    return isinstance(value, types.FunctionType) and getattr(value, _MARK, False)


_frozen: WeakValueDictionary[str, types.FunctionType] = WeakValueDictionary()


def _frozen_function(value: Any) -> types.FunctionType:
    plain = value.py_func if compiled(value) else value
    if is_frozen(plain):
        return plain
    key = f"{plain.__qualname__} {digest(value)}"  # of two names there are two
    found = _frozen.get(key)
    if found is None:
        found = _Freezer().function(value)
        found = _frozen.setdefault(key, found)
    return found


class _Freezer:
    """Copies a function and what it reaches; what is reached twice is copied once."""

    def __init__(self) -> None:
        self._copies: dict[int, Any] = {}

    def function(self, value: Any) -> types.FunctionType:
        plain = value.py_func if compiled(value) else value
        if id(plain) in self._copies:
            return self._copies[id(plain)]
        if is_frozen(plain):
            return plain
        space: dict[str, Any] = {"__builtins__": builtins, "__name__": plain.__module__}
        cells = tuple(types.CellType() for _ in plain.__closure__ or ())
        new = types.FunctionType(plain.__code__, space, plain.__name__, None, cells)
        new.__qualname__, new.__module__, new.__doc__ = (
            plain.__qualname__, plain.__module__, plain.__doc__,
        )  # fmt: skip
        self._copies[id(plain)] = new
        setattr(new, _MARK, True)
        if compiled(value):
            setattr(new, OPTIONS, dict(value.targetoptions))
        names = names_in(plain.__code__)
        new.__defaults__ = self.value(plain.__defaults__, names)
        new.__kwdefaults__ = self.value(plain.__kwdefaults__, names)
        for cell, old in zip(cells, plain.__closure__ or (), strict=True):
            cell.cell_contents = self.value(old.cell_contents, names)
        for name in names:
            if name in plain.__globals__:
                space[name] = self.value(plain.__globals__[name], names)
        return new

    def value(self, value: Any, names: list[str]) -> Any:
        if compiled(value) or isinstance(value, types.FunctionType):
            return value if module_of(value) in INSTALLED else self.function(value)
        if isinstance(value, types.ModuleType):
            return value if module_of(value) in INSTALLED else self._module(value, names)
        if isinstance(value, np.ndarray):
            return value.copy()
        if type(value) in (tuple, list):
            return type(value)(self.value(part, names) for part in value)
        if type(value) in (dict, set):
            return copy.copy(value)
        return value

    def _module(self, module: types.ModuleType, names: list[str]) -> types.ModuleType:
        # another function may read something else of the same module
        new = self._copies.setdefault(id(module), types.ModuleType(module.__name__))
        for name in names:
            if hasattr(module, name) and not hasattr(new, name):
                setattr(new, name, self.value(getattr(module, name), names))
        return new
