"""The cache of compiled code: found again, never stale, and never that of something else."""

from __future__ import annotations

import gc
import itertools
import json
import os
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux.functions.content import digest
from smolux.jit import compile as compiling
from smolux.jit.compile import cache_directory, statistics
from smolux.runtime import files
from smolux.runtime.files import kept
from smolux.stochastic.assembly import _key, loop_for
from smolux.weighting import WEIGHTINGS, Number

#: a function with everything that an edit may touch
SOURCE = """
import math
from math import sqrt

import numba
import numpy as np

from smolux.jit.compile import cold_piece, entry

SCALE = 2.0
TABLE = np.array([1.0, 3.0])
PAIR = (1.0, 0.0)


@numba.vectorize
def spread(x):
    return x + 0.0  # spread


@numba.njit
def deepest(x):
    return x + 0.0  # deepest


@numba.njit
def helper(x, shift=0.0):
    return deepest(x) + shift


def make(factor):
    @cold_piece
    def piece(x):
        return factor * helper(x)

    def loop(x):
        root = abs(sqrt(x * x))
        return SCALE * piece(root) * TABLE[0] + PAIR[1] + spread(0.0)

    return entry(loop)


loop = make(1.0)
"""
EDITS = {
    "a global": ("SCALE = 2.0", "SCALE = 4.0", 12.0),
    "an array": ("[1.0, 3.0]", "[2.0, 3.0]", 12.0),
    "a tuple": ("PAIR = (1.0, 0.0)", "PAIR = (1.0, 1.0)", 7.0),
    "a closure": ("make(1.0)", "make(3.0)", 18.0),
    "a constant": ("abs(sqrt(x * x))", "abs(sqrt(x * x)) + 1.0", 8.0),
    "a default": ("shift=0.0", "shift=1.0", 8.0),
    "a callee": ("deepest(x) + shift", "deepest(x) - shift + 2", 10.0),
    "a callee of a callee": ("x + 0.0  # deepest", "x", 6.0),
    "a ufunc of the user": ("x + 0.0  # spread", "x + 5.0", 11.0),
    "an option": ("@cold_piece", "@cold_piece\n    # the same", 6.0),
}  # fmt: skip


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "compiled"
    monkeypatch.setenv("SMOLUX_CACHE_DIR", str(folder))
    return folder


def loop_of(source: str) -> Any:
    space: dict[str, Any] = {"__name__": "user"}
    exec(source, space)  # a script, as it is run
    return space["loop"]


def counted(call: Callable[[], Any]) -> tuple[Any, int, int]:
    """Return the result, and how many entries were found and missed."""
    before = dict(statistics)
    result = call()
    found = {key: statistics[key] - before[key] for key in before}
    return result, found["hits"], found["misses"]


def entries(cache: Path) -> list[Path]:
    return sorted(cache.glob("*.nbc"))


def test_the_same_content_is_found_again(cache: Path) -> None:
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 1)
    assert len(entries(cache)) == 1
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 1, 0)
    # another signature is another entry
    assert counted(lambda: loop_of(SOURCE)(3)) == (6.0, 0, 1)
    assert len(entries(cache)) == 2
    assert sorted(os.listdir(cache)) == [path.name for path in entries(cache)]


def test_an_edit_anywhere_is_seen(cache: Path) -> None:
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 1)
    for what, (old, new, expected) in EDITS.items():
        edited = SOURCE.replace(old, new)
        assert edited != SOURCE, what
        same = what == "an option"  # a comment
        found = counted(lambda source=edited: loop_of(source)(3.0))
        assert found == (expected, int(same), int(not same)), what
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 1, 0)


def user_module(name: str, **content: Any) -> types.ModuleType:
    module = types.ModuleType(name)
    vars(module).update(content)
    return module


def test_all_that_is_taken_from_a_module_counts() -> None:
    def taken(a: float, b: float, unused: float) -> str:
        # the second function takes something else from the module that the first took from
        constants = user_module("constants", a=a, b=b, unused=unused)
        space: dict[str, Any] = {"constants": constants}
        exec("def inner(x):\n    return constants.b * x", space)
        exec("def outer(x):\n    return constants.a * inner(x)", space)
        return digest(space["outer"])

    assert taken(1.0, 2.0, 3.0) == taken(1.0, 2.0, 4.0)
    assert len({taken(1.0, 2.0, 3.0), taken(1.5, 2.0, 3.0), taken(1.0, 2.5, 3.0)}) == 3


def test_defaults_are_content() -> None:
    def made(a: float) -> Callable[..., float]:
        def f(x: float, a: float = a) -> float:
            return a * x

        return f

    assert digest(made(1.0)) == digest(made(1.0)) != digest(made(2.0))


def test_functions_of_one_name_are_told_apart() -> None:
    def with_root(module: str) -> str:
        space: dict[str, Any] = {}
        exec(f"from {module} import sqrt\ndef f(x):\n    return abs(sqrt(x))", space)
        return digest(space["f"])

    assert len({with_root(name) for name in ("math", "cmath", "numpy")}) == 3


@pytest.mark.slow
def test_an_address_that_is_used_again_is_another_function() -> None:
    class Fleeting(types.ModuleType):
        """A module that makes its functions when they are asked for."""

        def __getattr__(self, name: str) -> Any:
            if name not in ("first", "second"):
                raise AttributeError(name)
            gc.collect()
            space: dict[str, Any] = {}
            exec(f"def f(x):\n    return x + {self.shift[name]}", space)
            return space["f"]

    def of(second: float) -> str:
        module = Fleeting("fleeting")
        vars(module)["shift"] = {"first": 1.0, "second": second}
        space: dict[str, Any] = {"fleeting": module}
        exec("def f(x):\n    return fleeting.first(x) + fleeting.second(x)", space)
        return digest(space["f"])

    assert of(2.0) != of(3.0)


# --- what may go wrong costs time, not the run ---------------------------------------------------


def test_a_folder_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("SMOLUX_CACHE_DIR", str(tmp_path / "file" / "compiled"))
    for _ in range(2):
        assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 1)


def test_a_full_disk(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compiling.os, "replace", full)
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 1)
    assert os.listdir(cache) == []  # half of an entry is removed


@pytest.mark.parametrize("damage", ["empty", "cut", "changed", "foreign"])
def test_a_damaged_entry(cache: Path, damage: str) -> None:
    loop_of(SOURCE)(3.0)
    (path,) = entries(cache)
    whole = path.read_bytes()
    broken = {
        "empty": b"",
        "cut": whole[: len(whole) // 2],
        "changed": b"\0" * 64 + whole[64:],
        "foreign": b"\x80\x04N.",  # a pickle, of None
    }
    path.write_bytes(broken[damage])
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 1)
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 1, 0)  # it was written again


def test_one_changed_bit_anywhere_is_seen(cache: Path) -> None:
    assert loop_of(SOURCE)(3.0) == 6.0
    (path,) = entries(cache)
    whole = path.read_bytes()
    assert kept(path) is not None
    rng = np.random.default_rng(1)
    for place in np.append(np.arange(100), rng.integers(len(whole), size=300)):
        changed = bytearray(whole)
        changed[place] ^= 1 << rng.integers(8)
        path.write_bytes(changed)
        assert kept(path) is None, place
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 1)
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 1, 0)


def test_an_entry_in_the_place_of_another_is_none(cache: Path) -> None:
    assert loop_of(SOURCE)(3.0) == 6.0
    assert loop_of(SOURCE.replace("make(1.0)", "make(2.0)"))(3.0) == 12.0
    one, other = entries(cache)
    contents = one.read_bytes(), other.read_bytes()
    one.write_bytes(contents[1])
    other.write_bytes(contents[0])
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 1)


def test_what_killed_processes_leave_is_removed(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.mkdir()
    old, new = ".0123abcd.89abcdef.nbc", ".0123abcd.89abcdee.nbc"
    others = ["tmp_a1b2c3d", "notes.txt", ".hidden", "0123abcd.nbc"]
    for name in (old, new, *others):
        (cache / name).write_bytes(b"half")
        if name != new:
            os.utime(cache / name, (1e9, 1e9))
    monkeypatch.setattr(files, "_looked_at", set())
    assert loop_of(SOURCE)(3.0) == 6.0
    left = set(os.listdir(cache))
    assert not {old, "tmp_a1b2c3d"} & left
    assert {new, *others[1:]} < left  # it may still be written; the others are not ours


def test_switched_off(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SMOLUX_CACHE_DIR", "")
    assert cache_directory() is None
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 0)
    assert os.listdir(tmp_path) == []


def test_where_entries_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("SMOLUX_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_directory() == tmp_path / "smolux"


def test_without_the_private_names_of_numba(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "_HOOKS", False)
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 0)
    assert not cache.exists()


def test_code_that_would_not_work_elsewhere_is_not_kept(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiling, "_lasting", lambda data: False)
    assert counted(lambda: loop_of(SOURCE)(3.0)) == (6.0, 0, 1)
    assert entries(cache) == []


# --- one entry for each content ------------------------------------------------------------------

PROCESSES = {
    "aggregation": [sx.processes.Aggregation()],
    "shattering": [sx.processes.Shattering(1.0)],
    "both": [sx.processes.Aggregation(), sx.processes.Shattering(0.1)],
    "swapped": [sx.processes.Shattering(0.1), sx.processes.Aggregation()],
    "formula": [sx.processes.Aggregation(), sx.processes.Shattering("exp(-t)")],
    "other formula": [sx.processes.Aggregation(), sx.processes.Shattering("exp(-2*t)")],
    "callable": [sx.processes.Aggregation(), sx.processes.Shattering(lambda t: 1 / (1 + t))],
}


def plus(i: float, j: float) -> float:
    return i + j + 1.0


def times(i: float, j: float) -> float:
    return i * j + 1.0


def some_kernels() -> list[Any]:
    return [
        *(kernel(**kernel.example) for kernel in sx.kernels.KERNELS),
        sx.kernels.formula("i + j"),
        sx.kernels.formula("i * j"),
        sx.kernels.formula("a * (i + j)", a=1.0),
        sx.kernels.from_function(plus),
        sx.kernels.from_function(times),
    ]


@pytest.mark.slow
def test_nothing_shares_an_entry() -> None:
    owner: dict[str, Any] = {}
    made: dict[int, Any] = {}
    for kernel, method, weighting, (name, processes) in itertools.product(
        some_kernels(), sx.methods.METHODS, WEIGHTINGS, PROCESSES.items()
    ):
        loop = loop_for(sx.Model(kernel, processes), method(), weighting())
        # methods that differ by their data alone may have the same pieces
        what = (kernel.label, method.bind, weighting.name, name)
        assert owner.setdefault(digest(loop), what) == what
        assert made.setdefault(id(loop), (method, *what)) == (method, *what)


def test_values_of_parameters_share_the_loop() -> None:
    def loop(kernel: Any, rate: Any) -> Any:
        processes = [sx.processes.Aggregation(), sx.processes.Shattering(rate)]
        return loop_for(sx.Model(kernel, processes), sx.methods.METHODS[0](), Number())

    formula = sx.kernels.formula
    assert loop(formula("a*(i+j)", a=1.0), 0.1) is loop(formula("a*(i+j)", a=2.0), 0.2)
    assert loop(formula("i+j"), 0.1) is not loop(formula("j+i"), 0.1)


def test_laws_of_processes_make_loops_of_their_own() -> None:
    p, kernel = sx.processes, sx.kernels.Constant()

    def key(*others: Any) -> Any:
        model = sx.Model(kernel, [p.Aggregation(), *others])
        return _key(model, sx.methods.METHODS[0](), Number())

    alone = [p.Removal("k/10"), p.Removal("k**2/10"), p.Evaporation("k/10"), p.Source(1.0)]
    in_time = [p.Removal("k/10", varying="1 + t"), p.Removal("k/10", varying="2 + t")]
    keys = [key(), *(key(each) for each in (*alone, *in_time)), key(alone[0], p.Evaporation(0.1))]
    assert len(set(keys)) == len(keys)
    assert key(p.Removal(0.1)) == key(p.Removal(0.2))  # numbers are data


def test_what_a_weighting_compiles_in_makes_another_loop() -> None:
    def loop(weighting: Any) -> Any:
        return loop_for(sx.Model(sx.kernels.Constant()), sx.methods.METHODS[0](), weighting)

    power = sx.weighting.WeightFunction
    loops = [loop(Number()), loop(power(2.0)), loop(power("1 + l"))]
    assert len({id(made) for made in loops}) == len({digest(made) for made in loops}) == 3
    assert loop(power(0.5)) is loops[1]  # the exponent is data
    assert loop(Number()) is loops[0]


def test_an_edited_global_makes_another_loop() -> None:
    space: dict[str, Any] = {"C": 1.0}
    exec("def K(i, j):\n    return C * (i + j)", space)
    kernel = sx.kernels.from_function(space["K"])
    first = loop_for(sx.Model(kernel), sx.methods.METHODS[0](), Number())
    space["C"] = 2.0
    second = loop_for(sx.Model(kernel), sx.methods.METHODS[0](), Number())
    assert first is not second
    space["C"] = 1.0
    assert loop_for(sx.Model(kernel), sx.methods.METHODS[0](), Number()) is first


# --- several processes ---------------------------------------------------------------------------

#: a function that is too long to be inlined, and so keeps a symbol of its own
LONG = "".join(f"        x += math.sin(factor * x + {k})\n" for k in range(40))
SMALL = f"""
import json, math, os, sys
from smolux.jit.compile import cold_piece, entry, statistics

def make(factor):
    @cold_piece
    def inner(x):
{LONG}        return x

    def loop(x):
        return inner(x) + inner(2.0 * x)

    return entry(loop)

def report(*factors):
    results = [make(factor)(1.0) for factor in factors]
    print(json.dumps([results, statistics["hits"], statistics["misses"]]))
"""


def small(factor: float) -> float:
    space: dict[str, Any] = {}
    exec(SMALL.replace("@cold_piece\n", "\n").replace("entry(loop)", "loop"), space)
    return space["make"](factor)(1.0)


def run(script: str, cache: Path, *arguments: str, **environment: str) -> Any:
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=False,
        env=os.environ | {"SMOLUX_CACHE_DIR": str(cache)} | environment, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_entries_of_different_processes_do_not_mix(tmp_path: Path) -> None:
    script = SMALL + "report(*map(float, sys.argv[1:]))"
    for names, hits in (("1", 0), ("2", 0), ("123", 2), ("4321", 3)):
        # entries of several processes in one, and new code beside them, in either order
        found, *counts = run(script, tmp_path, *names)
        assert found == pytest.approx([small(float(name)) for name in names], rel=1e-9)
        assert counts == [hits, len(names) - hits]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
def test_entries_of_forked_processes_do_not_mix(tmp_path: Path) -> None:
    script = SMALL + (
        "make(7.0)(1.0)\n"  # the parent has compiled something already
        "for factor in (1.0, 2.0):\n"
        "    child = os.fork()\n"
        "    if child == 0:\n"
        "        make(factor)(1.0)\n"
        "        os._exit(0)\n"
        "    os.waitpid(child, 0)\n"
        "report(1.0, 2.0)"
    )
    found, *counts = run(script, tmp_path)
    assert found == pytest.approx([small(1.0), small(2.0)], rel=1e-9)
    assert counts == [2, 1]


def test_a_function_that_calls_itself(tmp_path: Path) -> None:
    # Numba's own cache ends the process here
    script = (
        "import json\n"
        "from smolux.jit.compile import entry, user_piece\n"
        "@user_piece\n"
        "def inner(x, n):\n"
        "    if n <= 1:\n"
        "        return 2.0 * x\n"
        "    return inner(x, n - 1) + inner(x, n - 2)\n"
        "def loop(x):\n"
        "    return inner(x, 3)\n"
        "print(json.dumps(entry(loop)(1.0)))"
    )
    assert [run(script, tmp_path) for _ in range(2)] == [6.0, 6.0]


def test_the_digest_is_that_of_every_process(tmp_path: Path) -> None:
    script = (
        "import json, smolux as sx\n"
        "from smolux.stochastic.assembly import loop_for\n"
        "from smolux.functions.content import digest\n"
        "from smolux.weighting import Number\n"
        "def K(i, j):\n"
        "    return 1.0 if i + j in {2.0, 3.0, 5.0} else i + j\n"
        "model = sx.Model(sx.kernels.from_function(K))\n"
        "print(json.dumps([digest(loop_for(model, m(), Number())) for m in sx.methods.METHODS]))"
    )
    first, second = (run(script, tmp_path, PYTHONHASHSEED=seed) for seed in ("1", "2"))
    assert first == second


SIMULATION = """
import json, sys
import smolux as sx
from smolux.jit.compile import statistics

SCALE = 3.0

def mine(i, j):
    return SCALE * (i + j)

KERNELS = {"constant": sx.kernels.Constant(), "user": sx.kernels.from_function(mine)}
density = {}
for name in sys.argv[1:]:
    ds = sx.simulate(
        sx.Model(KERNELS[name]), [0.5], particles=20_000, replicas=2, seed=1,
        population="fixed-volume", sizes=8,
    )
    density[name] = float(ds["number_density"].mean())
print(json.dumps([density, statistics["hits"], statistics["misses"]]))
"""


@pytest.mark.slow
def test_each_kernel_keeps_its_own_law(tmp_path: Path) -> None:
    exact = {"constant": 0.8, "user": np.exp(-1.5)}
    script = tmp_path / "script.py"
    script.write_text(SIMULATION)
    call = f"import runpy, sys; runpy.run_path({str(script)!r}, run_name='__main__')"
    for names, misses in (
        (["constant"], 1),
        (["user"], 1),
        (["constant", "user"], 0),
        (["user", "constant"], 0),
    ):
        found, hits, missed = run(call, tmp_path / "compiled", *names, NUMBA_OPT="1")
        assert found == pytest.approx({name: exact[name] for name in names}, abs=0.008)
        assert (hits, missed) == (len(names) - misses, misses)
