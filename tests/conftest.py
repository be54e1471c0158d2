"""The suite runs on all cores, and its workers share what they compile.

Compiling a loop takes seconds. So tests that need the same loops are a group, which one worker
takes as a whole, and what takes longest comes first. A run of files or single tests stays in one
process, and so does everything without pytest-xdist or with ``-n 0``.
"""

from __future__ import annotations

import gc
import os
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

# each worker computes with one core; threads that wait for work of linear algebra would take it
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# compiling makes objects by the million: to look for cycles among them, after each 700 by default,
# was a tenth of its time
gc.set_threshold(20_000, 10, 10)

#: more workers than this find nothing to do
_MOST_WORKERS = 8
#: tests of a method share its loops, and two methods share theirs
_METHODS = {
    "fictitious-jumps": "low-rank",
    "low-rank": "low-rank",
    "size-class": "size-class",
    "acceptance-rejection": "acceptance-rejection",
    "inverse": "inverse",
}
#: so do tests in these folders and files; any other file is a group of its own
_TOGETHER = {
    "spatial/test_time_stepping.py": "spatial/test_time_stepping.py",
    "spatial/": "spatial",
    "cli/test_spatial_command.py": "spatial",
    "cli/test_process.py": "cli/test_process.py",
    "cli/": "cli",
}
#: groups that take long, the longest first
_LONG = (
    "spatial", "low-rank", "acceptance-rejection", "size-class", "cli", "inverse",
    "cli/test_process.py", "run/test_sweep.py", "run/test_executors.py", "unit/test_plotting.py",
    "law/test_processes.py", "spatial/test_time_stepping.py", "core/test_compile_cache.py",
)  # fmt: skip
_made = pytest.StashKey[str]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--other-processor",
        action="store_true",
        help="let laws evaluated on arrays differ in the last bit, see tests/processor.py",
    )
    parser.addoption(
        "--part",
        default="0/1",
        metavar="K/N",
        help="take the K-th of N parts, from 0 on; what shares compiled loops is in one part",
    )


@pytest.fixture(autouse=True, scope="session")
def _processor(request: pytest.FixtureRequest) -> Iterator[None]:
    """Change how laws are evaluated, if that is asked for."""
    with pytest.MonkeyPatch.context() as patch:
        if request.config.option.other_processor:
            from processor import change

            change(patch)
        yield


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
        option.dist = "loadscope"
        option.loadscopereorder = False


def pytest_configure(config: pytest.Config) -> None:
    """Compile into a folder of this session, apart from the user's; workers inherit it."""
    if "SMOLUX_CACHE_DIR" not in os.environ:
        config.stash[_made] = tempfile.mkdtemp(prefix="smolux-tests-")
        os.environ["SMOLUX_CACHE_DIR"] = config.stash[_made]


def pytest_unconfigure(config: pytest.Config) -> None:
    if _made in config.stash:
        os.environ.pop("SMOLUX_CACHE_DIR", None)
        shutil.rmtree(config.stash[_made], ignore_errors=True)


def group(nodeid: str) -> str:
    """Name the group of a test."""
    file, _, test = nodeid.removeprefix("tests/").partition("::")
    if file.startswith(("law/", "run/")):
        for method, name in _METHODS.items():
            if method in test.partition("[")[2]:
                return name
    return next((name for start, name in _TOGETHER.items() if file.startswith(start)), file)


def _in_part(nodeid: str, part: int, parts: int) -> bool:
    """Whether a test is in this part: by its file, and by its group there."""
    return zlib.crc32(f"{nodeid.partition('::')[0]} {group(nodeid)}".encode()) % parts == part


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is in other parts, and put what takes long first."""
    part, parts = map(int, config.option.part.split("/"))
    left_out = [item for item in items if not _in_part(item.nodeid, part, parts)]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if _in_part(item.nodeid, part, parts)]
    if hasattr(config, "workerinput"):
        place = {name: k for k, name in enumerate(_LONG)}
        items.sort(key=lambda item: place.get(group(item.nodeid), len(place)))


def pytest_collection_finish() -> None:
    """Modules and tests stay: no search for cycles need look at them."""
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Hand out whole groups."""
    if config.option.dist != "loadscope":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class Groups(LoadScopeScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            return group(nodeid)

    return Groups(config, log)
