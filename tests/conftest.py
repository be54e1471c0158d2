"""The suite runs on all cores, and its workers share what they compile.

Compiling a loop takes seconds. So workers take stretches of tests, in which those that need the
same loops follow each other, and what takes longest comes first. A run of files or single tests
stays in one process, and so does everything without pytest-xdist or with ``-n 0``.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

import pytest

# each worker computes with one core; threads that wait for work of linear algebra would take it
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

#: more workers than this find nothing to do
_MOST_WORKERS = 8
#: files that take long, beside the tests of methods; they come next
_LONG = ("cli/test_process.py", "core/test_compile_cache.py", "cli/test_commands.py")
_TESTS = Path(__file__).parent
_made = pytest.StashKey[str]()


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Run the whole suite on all cores, unless something else is asked for."""
    option = config.option
    if not config.pluginmanager.hasplugin("xdist") or hasattr(config, "workerinput"):
        return
    folders = all(Path(arg).is_dir() for arg in config.args)
    if option.numprocesses is None and option.dist == "no" and not option.tx and folders:
        option.numprocesses = "logical"
        option.maxprocesses = option.maxprocesses or _MOST_WORKERS
    if option.numprocesses and option.dist == "no":
        option.dist = "worksteal"


def pytest_configure(config: pytest.Config) -> None:
    """Compile into a folder of this session, apart from the user's; workers inherit it."""
    if "SMOLUX_CACHE_DIR" not in os.environ:
        config.stash[_made] = tempfile.mkdtemp(prefix="smolux-tests-")
        os.environ["SMOLUX_CACHE_DIR"] = config.stash[_made]


def pytest_unconfigure(config: pytest.Config) -> None:
    if _made in config.stash:
        os.environ.pop("SMOLUX_CACHE_DIR", None)
        shutil.rmtree(config.stash[_made], ignore_errors=True)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put what takes long first, and tests of methods with the same loops one after the other."""
    if not hasattr(config, "workerinput"):
        return
    from smolux.methods import METHODS

    pieces = [method.bind.__qualname__ for method in METHODS]
    place = {method.name: pieces.index(p) for method, p in zip(METHODS, pieces, strict=True)}
    files = {file: len(pieces) + k for k, file in enumerate(_LONG)}

    def rank(item: pytest.Item) -> int:
        method = item.callspec.params.get("method") if hasattr(item, "callspec") else None
        file = item.path.relative_to(_TESTS).as_posix()
        last = files.get(file, len(pieces) + len(_LONG))
        return place.get(getattr(method, "name", str(method)), last)

    items.sort(key=rank)
