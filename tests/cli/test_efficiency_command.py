"""``smolux efficiency``."""

from __future__ import annotations

from pathlib import Path

from command import call

METHOD = "acceptance-rejection"


def test_command(tmp_path: Path):
    case = tmp_path / "case.toml"
    case.write_text(
        '[kernel]\nname = "constant"\n[run]\ntimes = [4.0]\nparticles = 40\nreplicas = 200\n'
        f'method = "{METHOD}"\nseed = 1\n'
    )
    one, two = "weight-function=0", "weight-function=1"
    found = call("efficiency", case, "-w", one, "-w", two, "-o", "M2")
    assert "M2 at t = 4" in found.stdout
    assert "exact solution" in found.stdout
    wrong = call("efficiency", case, "-w", "mass-flo", "-w", "weight-function", code=2)
    assert "mass-flow" in wrong.stderr
    assert "weight-function=0.5" in wrong.stderr
