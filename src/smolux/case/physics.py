"""The tables of the model: ``[kernel]``, ``[[processes]]``, ``[initial]``, ``[[attributes]]``."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import Any

from smolux import units
from smolux.attributes import ATTRIBUTES
from smolux.errors import InputError, did_you_mean
from smolux.initial import INITIALS, Empty, Sizes
from smolux.kernels import KERNELS, Sum
from smolux.kernels.base import Kernel
from smolux.model import Model
from smolux.model_dict import model_from_dict
from smolux.processes import PROCESSES
from smolux.processes.base import Process
from smolux.units import Dimension

from .lines import Path
from .reader import Problems, Table, dotted, show

#: what the parameters of laws, processes and initial conditions measure; others are plain numbers
FIELDS: dict[tuple[str, str], Dimension] = {
    ("kernel", "scale"): units.KERNEL,
    ("kernel", "temperature"): units.TEMPERATURE,
    ("kernel", "pressure"): units.PRESSURE,
    ("kernel", "density"): units.MASS_DENSITY,
    ("kernel", "monomer_diameter"): units.LENGTH,
    ("kernel", "viscosity"): units.VISCOSITY,
    ("kernel", "mean_free_path"): units.LENGTH,
    ("initial", "density"): units.NUMBER_DENSITY,
    ("initial", "densities"): units.NUMBER_DENSITY,
}

_IN_TIME = 'a number or a formula in t such as "0.01*(1 - t/400)"'
_INITIALS = {i.name: i for i in INITIALS}


@dataclass(frozen=True)
class Physics:
    """What the tables of a model say, ready to be built.

    Attributes
    ----------
    data : dict
        For `smolux.model_dict.model_from_dict`, in SI units or dimensionless.
    origin : str
        The quantities from which a physical constructor found the kernel, or nothing.
    """

    data: dict[str, Any]
    origin: str = ""


def read_physics(case: Mapping[str, Any], problems: Problems) -> Physics:
    """Read the tables of the model; mistakes are noted in `problems`."""
    data: dict[str, Any] = {}
    origin = ""
    if "kernel" in case:
        data["kernel"], origin = _kernel(Table(case["kernel"], ("kernel",), problems))
    else:
        problems.add(
            (), 'the table [kernel] is missing: give one with name = "constant" or another law'
        )
    if "processes" in case:
        data["processes"] = _processes(case["processes"], problems)
    if "initial" in case:
        data["initial"] = _initial(Table(case["initial"], ("initial",), problems))
    if "attributes" in case:
        data["attributes"] = _attributes(case["attributes"], problems)
    return Physics(data, origin)


def build(physics: Physics, si: bool, problems: Problems) -> Model | None:
    """Make the model; None, with the mistakes noted, if that fails."""
    data = physics.data
    if si:
        _require_units(data, problems)
    try:
        return model_from_dict(data)
    except InputError as error:
        problems.add_error((), error)
    return None


# --- kernel -----------------------------------------------------------------------------------


def _kernel(table: Table) -> tuple[dict[str, Any], str]:
    """Read a law, which a function of time may multiply; from which quantities, or nothing."""
    varying = table.take("varying")
    known = isinstance(varying, (int, float, str)) and not isinstance(varying, bool)
    if "varying" in table and not known:
        table.bad("varying", f"must be {_IN_TIME}")
    table.content.pop("varying", None)
    data, origin = _law(table)
    return ({**data, "varying": varying} if known else data), origin


def _law(table: Table) -> tuple[dict[str, Any], str]:
    laws = {k.name: k for k in KERNELS if k.name != "formula"}
    if "terms" in table:
        return _sum(table)
    if "formula" in table:
        return _formula(table), ""
    if "name" not in table:
        hint = did_you_mean("", list(laws))
        table.require(
            "name", f'or give formula = "..."{hint.replace("; choose", "; choose a name")}'
        )
        return {}, ""
    physical = [f"{n}.{c}" for n, k in laws.items() for c in k.constructors]
    name = table.choice("name", None, [*laws, *physical])
    if name is None:
        return {}, ""
    name, _, constructor = name.partition(".")
    law = laws[name]
    if constructor:
        return _constructed(table, law, constructor)
    own = {f.name: f.default for f in fields(law)}
    # the name alone will do, if the keys tell
    told = {
        c: sum(a in table and a not in own for a in _signature(law, c)) for c in law.constructors
    }
    if any(told.values()):
        return _constructed(table, law, max(told, key=lambda c: told[c]))
    data = {"name": name, **_fields(table, "kernel", own)}
    # what else could have stood here
    table.known += [a for c in law.constructors for a in _signature(law, c)]
    table.finish()
    return data, ""


def _sum(table: Table) -> tuple[dict[str, Any], str]:
    """Read the terms ``[[kernel.terms]]`` of a sum, each as a kernel, with a coefficient."""
    if table.take("name", Sum.name) != Sum.name:
        table.bad("name", "a kernel has a name or terms, not both; take one out")
    content = table.take("terms")
    table.finish()
    if not isinstance(content, list) or not content:
        table.bad("terms", "must be tables [[kernel.terms]], each as of a kernel")
        return {}, ""
    terms, origins = [], []
    for n, entry in enumerate(content):
        term = Table(entry, (*table.path, "terms", n), table.problems)
        coefficient = term.number("coefficient", None)
        term.content.pop("coefficient", None)
        data, origin = _kernel(term)
        terms.append(data if coefficient is None else {**data, "coefficient": coefficient})
        origins += [origin] if origin else []
    return {"name": Sum.name, "terms": terms}, "; ".join(origins)


def _signature(law: type[Kernel], constructor: str) -> Mapping[str, inspect.Parameter]:
    return inspect.signature(getattr(law, constructor)).parameters


def _fields(table: Table, section: str, own: Mapping[str, Any]) -> dict[str, Any]:
    """Read the parameters of a law or an initial condition."""
    data = {}
    for key, default in own.items():
        dimension = FIELDS.get((section, key))
        if key not in table:
            table.known.append(key)
            if default is MISSING:
                table.require(key, "it has no default")
        elif dimension is not None:
            data[key] = table.quantity(key, None, dimension)
        else:
            data[key] = table.number(key, None)
    return {k: v for k, v in data.items() if v is not None}


def _constructed(table: Table, law: type[Kernel], constructor: str) -> tuple[dict[str, Any], str]:
    """Read the arguments of a physical constructor, with units, and call it."""
    make: Callable[..., Kernel] = getattr(law, constructor)
    table.known.append("name")
    given: dict[str, float] = {}
    before = len(table.problems.messages)
    measured = units.of_arguments(make)
    for key, argument in _signature(law, constructor).items():
        dimension = measured.get(key)
        if key not in table:
            table.known.append(key)
            if argument.default is argument.empty:
                table.require(
                    key, f"give {dimension.words}, for example {show(dimension.example)}"
                    if dimension else "it has no default"
                )  # fmt: skip
        elif dimension is None:
            given[key] = table.number(key, None)
        elif isinstance(table.content[key], str):
            given[key] = table.quantity(key, None, dimension)
        else:
            table.take(key)
            table.bad(key, f"needs its unit: {dimension.words}, such as {show(dimension.example)}")
    table.finish()
    if len(table.problems.messages) > before:
        return {}, ""
    try:
        kernel = make(**given)
    except InputError as error:
        table.problems.add_error(table.path, error)
        return {}, ""
    data = {"name": law.name, **{f.name: getattr(kernel, f.name) for f in fields(kernel)}}
    origin = ", ".join(f"{k} = {table.content[k]}" for k in given)
    return data, f"scale by {law.__name__}.{constructor} from {origin}"


def _formula(table: Table) -> dict[str, Any]:
    name = table.take("name", "formula")
    if name != "formula":
        table.bad("name", "a kernel has a name or a formula, not both; take one out")
    data: dict[str, Any] = {"name": "formula", "formula": table.text("formula", "")}
    for key, value in table.content.items():
        if key in ("name", "formula"):
            continue
        if key == "gels":
            data[key] = table.flag(key, False)
        elif isinstance(value, str):
            # its dimension is not known: whatever it measures, in SI units
            data[key] = table.anything(key)
        else:
            data[key] = table.number(key, None)
    return {k: v for k, v in data.items() if v is not None}


# --- processes and initial condition -----------------------------------------------------------


def _listed(
    key: str, content: Any, kinds: Sequence[Any], problems: Problems
) -> Iterator[tuple[Table, Any]]:
    """Yield the tables of a list with the kind that the name of each stands for."""
    if isinstance(content, Mapping):
        problems.add((key,), f"write [[{key}]] with two brackets, once for each")
        return
    if not isinstance(content, list):
        problems.add((key,), f"{key} = {show(content)}: must be tables [[{key}]]")
        return
    known = {kind.name: kind for kind in kinds}
    for n, entry in enumerate(content):
        table = Table(entry, (key, n), problems)
        if "name" not in table:
            if isinstance(entry, Mapping):
                table.require("name", did_you_mean("", list(known))[2:])
            continue
        name = table.choice("name", None, list(known))
        if name is not None:
            yield table, known[name]


def _attributes(content: Any, problems: Problems) -> list[dict[str, Any]]:
    found = []
    for table, kind in _listed("attributes", content, ATTRIBUTES, problems):
        data = {"name": kind.name}
        for f in fields(kind):
            value = table.take(f.name)
            if isinstance(value, Mapping):
                data[f.name] = value
            elif value is not None or (f.default is MISSING and f.default_factory is MISSING):
                table.bad(f.name, "must be a table, such as { soot = 0.4, sulphate = 0.6 }")
        table.finish()
        found.append(data)
    return found


def _processes(content: Any, problems: Problems) -> list[dict[str, Any]]:
    found = []
    for table, kind in _listed("processes", content, PROCESSES, problems):
        data = {"name": kind.name}
        for f in fields(kind):
            value = table.take(f.name)
            words = _of_process(kind, f.name)
            if value is None:
                if f.default is MISSING:
                    table.require(f.name, words)
            elif (
                (isinstance(value, (int, float, str)) and not isinstance(value, bool))
                or (isinstance(value, list) and "a list" in words)
                or (isinstance(value, Mapping) and "a table" in words)
            ):
                data[f.name] = value
            else:
                table.bad(f.name, f"must be {words}")
        table.finish()
        found.append(data)
    return found


def _of_process(kind: type[Process], key: str) -> str:
    """Return in words what a parameter of a process may be."""
    if key == "label":
        return 'a text such as "wall"'
    variable = getattr(kind, "variables", {"rate": "t"}).get(key)
    if variable == "t":
        return _IN_TIME
    if variable == "k":
        return 'a number, a formula in k such as "k**(2/3)", or a list of values for k = 1, 2, ...'
    if variable is not None:
        return f'a number, a formula in {variable} such as "1/(i*j)", or a table as of a kernel'
    return "a number, or a table of sizes and rates" if key == "rates" else "a number"


def _initial(table: Table) -> dict[str, Any]:
    names = ["monodisperse", *_INITIALS]
    name = table.choice("name", None, names) if "name" in table else "monodisperse"
    if name is None:
        return {}
    table.known.append("name")
    if name == "monodisperse":
        data = {"size": table.integer("size", 1, 1, 2**62), "name": name}
        data["density"] = table.quantity("density", None, units.NUMBER_DENSITY)
    elif name == Sizes.name:
        data = {"name": name, "densities": _densities(table)}
    else:
        own = {f.name: f.default for f in fields(_INITIALS[name])}
        data = {"name": name, **_fields(table, "initial", own)}
    table.finish()
    return {k: v for k, v in data.items() if v is not None}


def _densities(table: Table) -> dict[str, float] | None:
    value = table.take("densities")
    if not isinstance(value, Mapping) or not value:
        table.bad("densities", "must be a table of sizes, such as { 1 = 0.5, 2 = 0.5 }")
        return None
    densities: dict[str, float] = {}
    for size, density in value.items():
        if not (size.isdecimal() and 1 <= int(size) <= 2**62):
            path = (*table.path, "densities", size)
            table.problems.add(path, f"initial size {show(size)}: sizes are whole numbers from 1")
            continue
        converted = table.convert(("densities", size), density, units.NUMBER_DENSITY)
        if converted is not None:
            densities[str(int(size))] = converted
    return densities


def _require_units(data: Mapping[str, Any], problems: Problems) -> None:
    """In a case with units nothing may silently be 1 in SI units."""
    kernel, initial = data.get("kernel", {}), data.get("initial", {})
    _require_scale(kernel, ("kernel",), problems)
    if initial.get("name") not in (Sizes.name, Empty.name) and "density" not in initial:
        problems.add(
            ("initial",),
            "initial.density is missing: the case has units, so it needs "
            f"{units.NUMBER_DENSITY.words} such as {show(units.NUMBER_DENSITY.example)}",
        )


def _require_scale(kernel: Mapping[str, Any], path: Path, problems: Problems) -> None:
    for n, term in enumerate(kernel.get("terms", ())):
        _require_scale(term, (*path, "terms", n), problems)
    law = next((k for k in KERNELS if k.name == kernel.get("name")), None)
    if law is not None and "scale" in {f.name for f in fields(law)} and "scale" not in kernel:
        needed = [
            [k for k, a in _signature(law, c).items() if a.default is a.empty]
            for c in law.constructors
        ]
        instead = "".join(f", or {' and '.join(names)}" for names in needed)
        problems.add(
            path,
            f"{dotted(path)}.scale is missing: the case has units, so the kernel needs "
            f"{units.KERNEL.words} such as {show(units.KERNEL.example)}{instead}",
        )
