"""A model as plain data, and back: what result files hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any, TypeVar

import numpy as np

from . import kernels
from .attributes import ATTRIBUTES, Attribute
from .errors import InputError, Problem, about, did_you_mean
from .functions.law import Law
from .functions.stated import Stated
from .functions.user_function import Function
from .initial import INITIALS, Initial, Sizes, from_sizes, monodisperse
from .kernels.base import Kernel
from .model import Model
from .processes import PROCESSES
from .processes.base import Process

T = TypeVar("T")
#: the keys that lead to a part of a model
Place = tuple[str | int, ...]
_INITIAL: Place = ("initial",)

#: the key under which a Python function stands with its source text, which nothing is rebuilt from
FUNCTION = "function"


def _function(user: Function) -> dict[str, Any]:
    """Return the name and the text of a function, the values of its parameters being defaults."""
    return {FUNCTION: user.text, "source": user.source}


def _plain(value: Any) -> Any:
    """Return plain Python numbers, texts, lists and tables; of a function, its text."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (str, int, float)) or value is None:
        return value
    if isinstance(value, Kernel):
        return _kernel_to_dict(value)
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (Sequence, np.ndarray)):
        return [_plain(v) for v in value]
    if isinstance(value, Law):
        if value.functions:
            sources = [each.source or each.text for each in value.functions]
            return {FUNCTION: value.text, "source": "\n".join(sources)}
        return value.text if value.constant is None else value.constant
    if isinstance(value, Stated):
        known = {"bounds": value.bounds, "breakpoints": value.breakpoints}
        return {**_plain(value.function), **_plain(known)}
    return _function(Function(getattr(value, "py_func", value), (), ()))


def _fields(thing: Process | Initial | Attribute) -> dict[str, Any]:
    found = {f.name: _plain(getattr(thing, f.name)) for f in fields(thing)}  # type: ignore[arg-type]
    return {name: value for name, value in found.items() if (name, value) != ("label", None)}


def _kernel_to_dict(kernel: Kernel) -> dict[str, Any]:
    try:
        return kernel.to_dict()
    except InputError:
        # a Python function has no such form; what is known of it is kept for the reader
        return kernel.describe()


def _initial_to_dict(initial: Initial) -> dict[str, Any]:
    if isinstance(initial, Sizes):
        pairs = zip(initial.sizes, initial.densities_, strict=True)
        return {"name": initial.name, "densities": {str(size): float(n) for size, n in pairs}}
    return {"name": initial.name, **_fields(initial)}


def model_to_dict(model: Model) -> dict[str, Any]:
    """Write a model as plain data: tables ``kernel`` and ``initial``, and a list ``processes``.

    And a list ``attributes``, if particles carry any.

    Parameters
    ----------
    model : Model

    Returns
    -------
    dict
        Of texts, numbers, lists and dictionaries only, as JSON holds them. Laws, formulas and
        numbers are rebuilt by `model_from_dict`; of a Python function only the text is kept.
    """
    carried = [{"name": a.name, **_fields(a)} for a in model.attributes]
    return {
        "kernel": _kernel_to_dict(model.kernel),
        "processes": [{"name": p.name, **_fields(p)} for p in model.processes],
        "initial": _initial_to_dict(model.initial),
        **({"attributes": carried} if carried else {}),
    }


class _Reader:
    """Rebuilds the parts of a model and notes every mistake."""

    def __init__(self) -> None:
        self.problems: list[str] = []

    def table(self, what: str, given: Any, names: Sequence[str]) -> tuple[str, dict[str, Any]]:
        """Take a table apart into its name, "" if that is not one of `names`, and the rest."""
        if not isinstance(given, Mapping):
            self.problems.append(f"{what} = {given!r}: must be a table with a 'name'")
            return "", {}
        name = given.get("name")
        if name not in names:
            value = f"name = {name!r} is unknown" if "name" in given else "'name' is missing"
            self.problems.append(f"{what}: {value}{did_you_mean(str(name), names)}")
            return "", {}
        return str(name), {str(k): v for k, v in given.items() if k != "name"}

    def build(
        self, path: Place, what: str, kind: Callable[..., T], given: Mapping[str, Any]
    ) -> T | None:
        """Make a dataclass of its fields."""
        known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
        wrong: list[str] = [
            Problem.at(
                f"{what}: there is no parameter {k!r}"
                + (did_you_mean(k, list(known)) if known else ""),
                *path,
                k,
            )
            for k in given
            if k not in known
        ]
        wrong += [
            f"{what}: the parameter {name!r} is missing"
            for name, f in known.items()
            if name not in given and f.default is MISSING and f.default_factory is MISSING
        ]
        wrong += [
            f"{what}: {k} is the Python function {v[FUNCTION]!r}, which no file can bring back; "
            "make the model in Python again"
            for k, v in given.items()
            if isinstance(v, Mapping) and FUNCTION in v
        ]
        self.problems += wrong
        return None if wrong else self.attempt(path, what, kind, **given)

    def attempt(
        self, path: Place, what: str, make: Callable[..., T], *args: Any, **given: Any
    ) -> T | None:
        """Call a constructor; its mistakes are at `path`."""
        try:
            with about(*path):
                return make(*args, **given)
        except InputError as error:
            self.problems += error.problems
        except (TypeError, ValueError, OverflowError) as error:
            self.problems.append(Problem.at(f"{what}: {error}", *path))
        return None

    def kernel(self, given: Any) -> Kernel | None:
        """Rebuild a law or a formula."""
        if isinstance(given, Mapping) and FUNCTION in given:
            self.problems.append(
                f"kernel: is the Python function {given[FUNCTION]!r}, which no file can bring "
                "back; wrap it again with smolux.kernels.from_function"
            )
            return None
        return self.attempt(("kernel",), "kernel", kernels.from_dict, given)

    def process(self, number: int, given: Any) -> Process | None:
        """Rebuild the process of this number."""
        kinds = {p.name: p for p in PROCESSES}
        name, rest = self.table("process", given, list(kinds))
        if not name:
            return None
        return self.build(("processes", number), f"process {name!r}", kinds[name], rest)

    def attribute(self, number: int, given: Any) -> Attribute | None:
        """Rebuild the attribute of this number."""
        kinds = {a.name: a for a in ATTRIBUTES}
        name, rest = self.table("attribute", given, list(kinds))
        if not name:
            return None
        return self.build(("attributes", number), f"attribute {name!r}", kinds[name], rest)

    def initial(self, given: Any) -> Initial | None:
        """Rebuild an initial condition."""
        kinds = {i.name: i for i in INITIALS}
        name, rest = self.table("initial", given, [*kinds, "monodisperse"])
        if name == "monodisperse":
            return self.attempt(_INITIAL, "initial 'monodisperse'", monodisperse, **rest)
        if name != Sizes.name:
            what = f"initial {name!r}"
            return self.build(_INITIAL, what, kinds[name], rest) if name else None
        densities = rest.pop("densities", None)
        if rest or not isinstance(densities, Mapping):
            self.problems.append(
                f"initial 'sizes': needs 'densities' and nothing else, "
                f'such as {{"1": 0.5, "2": 0.5}}; found {sorted(given)}'
            )
            return None
        return self.attempt(
            _INITIAL,
            "initial 'sizes'",
            lambda: from_sizes({int(k): float(v) for k, v in densities.items()}),
        )


def model_from_dict(data: Mapping[str, Any]) -> Model:
    """Rebuild a model from what `model_to_dict` wrote.

    Parameters
    ----------
    data : mapping
        With the keys ``kernel``, ``processes``, ``initial`` and ``attributes``; all but the first
        may be left out, as in `smolux.Model`.

    Returns
    -------
    Model

    Raises
    ------
    InputError
        With every problem found: unknown names and parameters (and the nearest known one), wrong
        values, Python functions, of which a file holds only the text.
    """
    if not isinstance(data, Mapping):
        raise InputError(f"model = {data!r}: must be a dictionary with the key 'kernel'")
    known = ("kernel", "processes", "initial", "attributes")
    reader = _Reader()
    reader.problems += [
        f"model: there is no key {k!r}{did_you_mean(str(k), known)}" for k in data if k not in known
    ]
    parts: dict[str, Any] = {}
    if "kernel" in data:
        parts["kernel"] = reader.kernel(data["kernel"])
    else:
        reader.problems.append("model: the key 'kernel' is missing")
    for key, rebuild in (("processes", reader.process), ("attributes", reader.attribute)):
        given = data.get(key, ())
        if not isinstance(given, Sequence) or isinstance(given, str):
            reader.problems.append(f"{key} = {given!r}: must be a list of tables")
        elif key in data:
            parts[key] = tuple(rebuild(n, each) for n, each in enumerate(given))
    if "initial" in data:
        parts["initial"] = reader.initial(data["initial"])
    if reader.problems:
        raise InputError(reader.problems)
    return Model(**parts)
