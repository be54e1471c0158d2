"""``smolux efficiency``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from command import call

from smolux.ensembles.batches import Sampler

METHOD = "acceptance-rejection"


@pytest.fixture
def case(tmp_path: Path) -> Path:
    file = tmp_path / "case.toml"
    file.write_text(
        '[kernel]\nname = "constant"\n[run]\ntimes = [4.0]\nparticles = 40\nreplicas = 200\n'
        f'method = "{METHOD}"\nseed = 1\n'
    )
    return file


def test_command(case: Path):
    one, two = "weight-function=0", "weight-function=1"
    found = call("efficiency", case, "-w", one, "-w", two, "-o", "M2")
    assert "M2 at t = 4" in found.stdout
    assert "exact solution" in found.stdout
    wrong = call("efficiency", case, "-w", "mass-flo", "-w", "weight-function", code=2)
    assert "mass-flow" in wrong.stderr
    assert "weight-function=0.5" in wrong.stderr


def test_ctrl_c_shows_what_there_is(case: Path, monkeypatch: pytest.MonkeyPatch):
    run = Sampler.batch

    def batch(self: Sampler, first: int, count: int, stop: Any) -> Any:
        if first >= 100:
            raise KeyboardInterrupt
        return run(self, first, count, stop)

    monkeypatch.setattr(Sampler, "batch", batch)
    found = call("efficiency", case, "-w", "weight-function=0", "-o", "M2", code=130)
    assert "M2 at t = 4" in found.stdout
    assert "statistics of 100 replicas" in found.stderr
    assert "stopped" in found.stderr
