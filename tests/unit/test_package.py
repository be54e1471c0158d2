"""The package as a whole: its names, what it loads and when."""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.resources
import inspect
import pkgutil
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest

import smolux

HEAVY = ("numba", "scipy", "xarray", "matplotlib", "pint", "pandas", "h5netcdf", "rich", "typer")


def loaded_after(code: str) -> set[str]:
    """Heavy packages that a fresh interpreter has loaded after running some code."""
    report = "import sys; print(' '.join(sorted({m.partition('.')[0] for m in sys.modules})))"
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\n{report}"], capture_output=True, text=True, check=True
    )
    return set(HEAVY) & set(done.stdout.split())


def test_import_loads_nothing_heavy():
    assert (
        loaded_after("import smolux; smolux.InputError; smolux.__version__; dir(smolux)") == set()
    )


def test_physics_is_described_without_numba():
    code = (
        "import smolux as sx\n"
        "fading = sx.processes.Shattering('0.01*exp(-t)')\n"
        "sx.Model(sx.kernels.Ballistic(), [sx.processes.Aggregation(), fading],\n"
        "         sx.initial.exponential(3.0))\n"
        "sx.kernels.from_function(lambda i, j: i + j)(1, 2)"
    )
    assert loaded_after(code) <= {"scipy"}


def test_a_case_that_names_a_method_is_read_without_numba():
    code = (
        "from smolux.case import parse\n"
        'text = \'[kernel]\\nname = "constant"\\n[run]\\ntimes = [1]\\nmethod = "inverse"\'\n'
        "assert parse(text).run.method == 'inverse'"
    )
    assert loaded_after(code) == set()


@pytest.mark.parametrize("package", ["smolux.methods", "smolux.spatial.methods"])
def test_methods_have_the_names_of_their_table(package):
    methods = importlib.import_module(package)
    assert [m.name for m in methods.METHODS] == list(methods.NAMES)


def test_loops_load_no_linear_algebra_but_have_it_when_asked():
    code = (
        "import sys, numpy as np\n"
        "from smolux.jit.compile import user_piece\n"
        "import numba.np.arraymath\n"
        "assert 'scipy.linalg' not in sys.modules\n"
        "product = user_piece(lambda a: np.dot(a, a))\n"
        "import numba\n"
        "called = numba.njit(lambda a: product(a)[0, 0])\n"
        "assert called(np.full((2, 2), 3.0)) == 18.0"
    )
    assert "scipy" in loaded_after(code)


@pytest.mark.parametrize("name", smolux.__all__)
def test_every_public_name_is_there(name):
    assert getattr(smolux, name) is not None
    assert name in dir(smolux)


def test_names_are_the_objects_they_stand_for():
    assert smolux.plot is smolux.plotting
    assert smolux.simulate.__module__ == "smolux.stochastic.simulation"
    assert smolux.solve.__module__ == "smolux.deterministic.solver"
    assert callable(smolux.summary)


def test_every_name_of_the_reference_is_reached_from_the_package_alone():
    page = Path(__file__).parents[2] / "docs" / "reference" / "api.md"
    names, module = [], ""
    for line in page.read_text(encoding="utf-8").splitlines():
        if found := re.fullmatch(r"\.\. currentmodule:: smolux\.?([\w.]*)", line):
            module = found[1] + "." if found[1] else ""
        elif found := re.fullmatch(r"   ([A-Za-z_][\w.]*)", line):
            names.append(module + found[1])
    assert len(names) > 100
    # not only there because another module has been imported
    assert {name.partition(".")[0] for name in names} <= set(smolux.__all__)
    subprocess.run(
        [sys.executable, "-c", "import smolux\n" + "\n".join(f"smolux.{n}" for n in names)],
        check=True,
    )


METHODS = (
    types.FunctionType, property, functools.cached_property, classmethod, staticmethod,
)  # fmt: skip


def public_methods():
    """Name of all that public classes define as a method or property, and whether it is told."""
    for module in pkgutil.walk_packages(smolux.__path__, "smolux."):
        if module.name.endswith("__main__"):
            continue
        for name, of in vars(importlib.import_module(module.name)).items():
            if not inspect.isclass(of) or of.__module__ != module.name or name.startswith("_"):
                continue
            for key, value in vars(of).items():
                here = getattr(value, "__qualname__", of.__qualname__).startswith(of.__qualname__)
                if isinstance(value, METHODS) and here and not key.startswith("_"):
                    yield f"{module.name}.{name}.{key}", described(of, key)


def described(of, key):
    """Whether a method has a docstring, or one that it overrides; a plain value there has none."""
    found = (vars(base)[key] for base in of.__mro__ if key in vars(base))
    plain = (getattr(value, "__func__", value) for value in found if isinstance(value, METHODS))
    return any(value.__doc__ for value in plain)


def test_every_public_method_is_described_where_it_is_or_by_what_it_overrides():
    methods = dict(public_methods())
    assert len(methods) > 600
    assert [name for name, told in methods.items() if not told] == []


def test_unknown_name():
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        smolux.simulat  # noqa: B018


def test_version_is_that_of_the_distribution():
    assert smolux.__version__ == importlib.metadata.version("smolux")


def test_what_is_installed_beside_the_code():
    files = importlib.resources.files("smolux")
    assert (files / "py.typed").is_file()
    assert (files / "templates" / "shattering.toml").is_file()


def test_registries_name_their_entries_uniquely():
    for registry in (
        smolux.kernels.KERNELS,
        smolux.processes.PROCESSES,
        smolux.weighting.WEIGHTINGS,
        smolux.methods.METHODS,
    ):
        names = [entry.name for entry in registry]
        assert len(set(names)) == len(names) > 0
        # what case files write
        assert all(name == name.lower() and " " not in name for name in names)
