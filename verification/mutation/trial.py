"""A copy of the code in which mistakes are made, and tests run on it."""

from __future__ import annotations

import compileall
import json
import os
import py_compile
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from .mistakes import PACKAGE, Mistake

#: what tests read, and what the package is installed from
_COPIED = ("src", "tests", "verification", "benchmarks", "docs", "examples")
_LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", "*.egg-info", "*.png")
#: no tests of one mistake should take more seconds of a processor, with compilation
PATIENCE = 300
#: nor should they wait longer for what does not come; other programs may slow them down
WAITING = 2400
#: files by which compiled code and bounds are kept: a mistake in them would spoil it for others
_KEEPERS = frozenset(
    (
        "functions/content.py",
        "runtime/files.py",
        "stochastic/bounds_cache.py",
        "stochastic/tables.py",
        "jit/compile.py",
        "jit/pipeline.py",
    )
)
_FAILED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)


class BrokenTrialError(Exception):
    """Tests that say nothing: none was run, or they fail without the mistake."""


@dataclass(frozen=True)
class Copy:
    """A copy of the checkout, and the folder of what its loops compile to.

    Attributes
    ----------
    folder, compiled : path
    server : Popen
        A process that has loaded what the package needs, and of which each trial is a fork.
    """

    folder: Path
    compiled: Path
    server: subprocess.Popen[str]

    @classmethod
    @contextmanager
    def of(cls, root: Path, folder: Path, compiled: Path) -> Iterator[Copy]:
        """Copy what tests need, and serve it."""
        for name in _COPIED:
            if (root / name).is_dir():
                shutil.copytree(root / name, folder / name, ignore=_LEFT_OUT)
        for path in root.iterdir():
            if path.is_file():
                shutil.copy2(path, folder / path.name)
        # by content: a file that changes twice a second may have the same time
        by_content = py_compile.PycInvalidationMode.CHECKED_HASH
        compileall.compile_dir(folder / "src", quiet=2, invalidation_mode=by_content)
        environment = {**os.environ, "PYTHONPATH": str(folder / "src")}
        with subprocess.Popen(
            [sys.executable, str(Path(__file__).parent / "server.py")], cwd=folder,
            env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        ) as server:  # fmt: skip
            yield cls(folder, compiled, server)
            server.communicate()  # its input ends, and so does it

    @contextmanager
    def mistaken(self, mistake: Mistake) -> Iterator[Copy]:
        """Make a mistake, and take it back."""
        path = self.folder / PACKAGE / mistake.file
        right = path.read_text()
        path.write_text(mistake.made(right))
        own = self.folder / "compiled"
        try:
            yield replace(self, compiled=own) if mistake.file in _KEEPERS else self
        finally:
            path.write_text(right)
            shutil.rmtree(own, ignore_errors=True)

    def failing(self, tests: Sequence[str], *, slow: bool = False, patience: int = PATIENCE) -> str:
        """Run tests up to the first that fails, and return it; nothing if all pass.

        Raises
        ------
        BrokenTrialError
            No test was run.
        """
        options = [
            "-x", "-q", "-rfE", "--tb=no", "--no-header", "-p", "no:cacheprovider",
            "-p", "no:xdist", "-p", "no:benchmark",
            *(("-m", "slow") if slow else ()),
        ]  # fmt: skip
        code, told = self._served([*options, *tests], patience)
        if code == 0:
            return ""
        if -code in (signal.SIGXCPU, signal.SIGALRM):
            return "does not end"
        if code < 0 or code > 5:
            return "the interpreter crashes"
        found = _FAILED.search(told)
        if code != 1 or not found:
            raise BrokenTrialError(f"{' '.join(tests)}\n{told[-4000:]}")
        return found[1]

    def _served(self, arguments: Sequence[str], patience: int) -> tuple[int, str]:
        """Let the server run pytest: its exit code, and what it wrote."""
        assert self.server.stdin is not None
        assert self.server.stdout is not None
        told = self.folder / "told.txt"
        order = {
            "arguments": arguments, "told": str(told), "compiled": str(self.compiled),
            "patience": patience, "waiting": WAITING,
        }  # fmt: skip
        self.server.stdin.write(json.dumps(order) + "\n")
        self.server.stdin.flush()
        return int(self.server.stdout.readline()), told.read_text(errors="replace")
