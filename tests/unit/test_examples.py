"""The code of examples, README and guides runs as it is written, with fewer particles."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import smolux as sx
from smolux.case import parse
from smolux.sweeps import read_axes

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*/plot_*.py"))
README = ROOT / "README.md"
GUIDES = [
    page
    for folder in ("tutorials", "how-to")
    for page in sorted((ROOT / "docs" / folder).glob("*.md"))
    if "```python" in page.read_text(encoding="utf-8")
]
#: these compile more loops than others
LONG = ("choose-a-method", "efficiency", "many-cores", "resume", "units", "your-own-kernel")
MARKS = dict.fromkeys(LONG, pytest.mark.slow) | {
    # warnings that are meant, or that few replicas make
    "particles-and-replicas": pytest.mark.filterwarnings(
        "default:target_error:smolux.errors.SmoluxWarning"
    ),
    "warnings": pytest.mark.filterwarnings("default:.*extinction:smolux.errors.SmoluxWarning"),
}


@pytest.fixture
def small(monkeypatch, tmp_path):
    """Limit what a computation costs, and collect the results."""
    simulate, solve, sweep = sx.simulate, sx.solve, sx.sweep
    results = []

    def small_simulation(model, times, **settings):
        few = min(settings.get("particles", 100_000), 1000 * settings.get("subvolumes", 1))
        # auto would choose for the few particles, and loops beyond those of other tests
        settings = {"method": "acceptance-rejection"} | settings
        settings |= {"particles": few, "replicas": 3}
        if "target_error" in settings:
            settings |= {"replicas": 8, "max_replicas": 12}
        results.append(simulate(model, times, **settings))
        return results[-1]

    def coarse_solution(model, times, **settings):
        tolerance = max(1e-4, settings.get("tolerance", 0))
        results.append(solve(model, times, **settings | {"tolerance": tolerance}))
        return results[-1]

    def corner(case, over, **settings):
        ends = {axis.key: axis.values[-1:] for axis in read_axes(over)}
        return sweep(case, ends, **settings)

    monkeypatch.setattr(sx, "simulate", small_simulation)
    monkeypatch.setattr(sx, "solve", coarse_solution)
    monkeypatch.setattr(sx, "sweep", corner)
    monkeypatch.chdir(tmp_path)
    return results


def check(results, folder):
    """Results must be complete, finite and conserve mass; one figure must have been drawn."""
    assert results
    for ds in results:
        mass, come = ds["moment"].sel(order=1), 0.0
        if "mass_in" in ds:  # an open system: to a share of all that has come in
            mass = mass + (ds["mass_out"] - ds["mass_in"]) / ds["volume"]
            come = float((ds["mass_in"] / ds["volume"]).max())
        # of each replica by itself: what they begin with is drawn
        begun = mass.isel(time=0).broadcast_like(mass).transpose(*mass.dims)
        # a solution may lose a hundredth of its tolerance over the edge of the sizes kept
        lost = max(1e-6, 1e-2 * float(ds.attrs.get("tolerance", 0.0)))
        np.testing.assert_allclose(mass, begun, rtol=lost, atol=1e-6 * come)
        assert ds.attrs["complete"] == 1
        assert np.isfinite(ds["number_density"]).all()
    (figure,) = folder.glob("*.png")
    assert figure.stat().st_size > 10_000


def test_there_are_examples():
    assert len(EXAMPLES) >= 4


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.parent.name)
def test_example(example, small, tmp_path):
    # those that add to the package are as long as what they add
    short = example.parent.name != "extending"
    assert not short or len(example.read_text(encoding="utf-8").splitlines()) <= 50
    runpy.run_path(str(example), run_name="__main__")
    check(small, tmp_path)


def blocks(page, language):
    """Fenced code of a page."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def test_readme_example(small, tmp_path):
    (code,) = blocks(README, "python")
    statements = [line for line in code.splitlines() if line.strip()]
    assert len(statements) < 12
    exec(compile(code, "README.md", "exec"), {"__name__": "__main__"})
    check(small, tmp_path)


@pytest.mark.slow
def test_readme_case_file(small):
    (text,) = blocks(README, "toml")
    case = parse(text)
    ds = sx.simulate(case.model, case.run.times, particles=case.run.particles, seed=case.run.seed)
    assert ds.sizes["time"] == len(case.run.times)


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=MARKS.get(page.stem, ()), id=page.stem) for page in GUIDES],
)
def test_code_of_a_guide(page, small, tmp_path):
    """The blocks of a page run one after the other, as a reader would type them."""
    model = sx.Model(kernel=sx.kernels.Constant())
    sx.results.save(sx.simulate(model, [1.0], seed=1), tmp_path / "results.nc")
    names = {"__name__": "__main__"}
    for code in blocks(page, "python"):
        exec(compile(code, page.name, "exec"), names)
