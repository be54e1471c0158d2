"""Runs pytest in forks of itself: what the package imports takes longer than most trials.

An order is a line on standard input, and its answer, the exit code, one on standard output.
"""

import contextlib
import importlib
import json
import os
import resource
import signal
import sys
from typing import Any

#: what the package and its tests need, never the package itself, which changes
_LOADED = (
    "cloudpickle", "hypothesis", "numba", "numba.core.caching", "numba.typed", "pytest",
    "scipy.fft", "scipy.integrate", "scipy.optimize", "scipy.signal", "scipy.sparse.linalg",
    "scipy.spatial", "scipy.special", "scipy.stats", "xarray",
)  # fmt: skip


def run(order: dict[str, Any]) -> int:
    """Run pytest in this process, with limits of its time."""
    import pytest

    os.setsid()
    out = os.open(order["told"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(out, stream)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.environ["SMOLUX_CACHE_DIR"] = order["compiled"]
    resource.setrlimit(resource.RLIMIT_CPU, (order["patience"], order["patience"] + 5))
    signal.alarm(order["waiting"])
    return int(pytest.main(order["arguments"]))


def main() -> None:
    loaded = {name: importlib.import_module(name) for name in _LOADED}
    loaded["numba"].njit("int64(int64)")(lambda n: n)  # the compiler has more to load
    sys.path[0] = os.getcwd()  # as ``python -m pytest`` has it
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            code = 6  # what pytest never returns
            try:
                code = run(json.loads(line))
            finally:
                sys.stdout.flush()
                os._exit(code)
        _, status = os.waitpid(child, 0)
        with contextlib.suppress(ProcessLookupError):  # what it started and did not end
            os.killpg(child, signal.SIGKILL)
        print(os.waitstatus_to_exitcode(status), flush=True)


if __name__ == "__main__":
    main()
