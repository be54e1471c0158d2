"""A copy of the code in which mistakes are made, and tests run on it."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from .mistakes import PACKAGE, Mistake

#: what tests read, and what the package is installed from
_COPIED = ("src", "tests", "verification", "benchmarks", "docs", "examples")
_LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", "*.egg-info", "*.png")
#: no tests of one mistake should take more seconds of a processor, with compilation
PATIENCE = 300
#: nor should they wait longer for what does not come; other programs may slow them down
WAITING = 2400.0
_FAILED = re.compile(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", re.MULTILINE)


class BrokenTrialError(Exception):
    """Tests that say nothing: none was run, or they fail without the mistake."""


@dataclass(frozen=True)
class Copy:
    """A copy of the checkout, and the folder of what its loops compile to."""

    folder: Path
    compiled: Path

    @classmethod
    def of(cls, root: Path, folder: Path, compiled: Path) -> Copy:
        """Copy what tests need."""
        for name in _COPIED:
            if (root / name).is_dir():
                shutil.copytree(root / name, folder / name, ignore=_LEFT_OUT)
        for path in root.iterdir():
            if path.is_file():
                shutil.copy2(path, folder / path.name)
        return cls(folder, compiled)

    @contextmanager
    def mistaken(self, mistake: Mistake) -> Iterator[None]:
        """Make a mistake, and take it back."""
        path = self.folder / PACKAGE / mistake.file
        right = path.read_text()
        path.write_text(mistake.made(right))
        try:
            yield
        finally:
            path.write_text(right)

    def failing(self, tests: Sequence[str], *, slow: bool = False) -> str:
        """Run tests up to the first that fails, and return it; nothing if all pass.

        Raises
        ------
        BrokenTrial
            No test was run.
        """
        command = [
            "/bin/sh", "-c", f'ulimit -t {PATIENCE}; exec "$@"', "trial",
            sys.executable, "-m", "pytest", "-x", "-q", "-rfE", "--tb=no", "--no-header", "-n", "0",
            "-p", "no:cacheprovider", *(("-m", "slow") if slow else ()), *tests,
        ]  # fmt: skip
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.folder / "src"),
            # a file that changes twice a second may look the same to Python's own cache
            "PYTHONDONTWRITEBYTECODE": "1",
            "SMOLUX_CACHE_DIR": str(self.compiled),
        }
        try:
            done = subprocess.run(
                command, cwd=self.folder, env=environment, capture_output=True, text=True,
                timeout=WAITING, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return "does not end"
        if done.returncode == 0:
            return ""
        if done.returncode == -signal.SIGXCPU:
            return "does not end"
        if done.returncode < 0 or done.returncode > 5:
            return "the interpreter crashes"
        found = _FAILED.search(done.stdout)
        if done.returncode != 1 or not found:
            raise BrokenTrialError(f"{' '.join(tests)}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
        return found[1]
