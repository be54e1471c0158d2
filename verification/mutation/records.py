"""What was tried before: with the same code and the same tests it is not tried again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from smolux.runtime.files import replacing


class Records:
    """The outcomes of trials, one in a file.

    An outcome is kept by what decides it: the package, what tests share, the files of the tests
    that were run, and what was done.

    Parameters
    ----------
    root : path
        A copy of the checkout, without a mistake yet.
    folder : path
        Where they are; made if it is not there.
    """

    def __init__(self, root: Path, folder: Path) -> None:
        self.root, self.folder = root, folder
        shared = (p for p in (root / "tests").rglob("*.py") if not p.name.startswith("test_"))
        self._common = self._digest([*(root / "src").rglob("*.py"), *shared])

    def of(self, tests: Sequence[str], *done: Any) -> Path:
        """Return the file of a trial of these tests."""
        files = sorted({test.split("::")[0] for test in tests})
        text = json.dumps([self._common, self._digest([self.root / f for f in files]), done])
        return self.folder / f"{hashlib.sha256(text.encode()).hexdigest()}.json"

    def _digest(self, paths: Sequence[Path]) -> str:
        found = hashlib.sha256()
        for path in sorted(paths):
            name = path.relative_to(self.root).as_posix()
            found.update(f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()} ".encode())
        return found.hexdigest()

    def known(self, path: Path) -> Any:
        """Return an outcome, or None."""
        return json.loads(path.read_text()) if path.exists() else None

    def note(self, path: Path, outcome: Any) -> Any:
        """Keep an outcome, and return it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            file.write_text(json.dumps(outcome))
        return outcome
