"""The machinery of the verification and of the benchmarks; the verification itself is slow."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.flat import constant_rate, flat_loop, new_sizes, stream  # noqa: E402
from verification.kalinov_2021 import SUITE, table1  # noqa: E402
from verification.kalinov_2021.common import TARGETS, curves, target  # noqa: E402
from verification.outcome import at_most, mean_sigmas, normal_sigmas, rms, worst  # noqa: E402
from verification.suite import Suite, plain, run_suite  # noqa: E402

from smolux import exact  # noqa: E402


def test_targets_are_complete():
    for path in TARGETS.glob("*.toml"):
        table = target(path.stem)
        assert table["rows"], path
        assert len(table["units"]) == len(table["columns"]), path
    for path in TARGETS.glob("*.csv"):
        data = curves(path.stem)
        assert data.size > 1, path
        assert not any(name.startswith("f0") for name in data.dtype.names), path
    assert target("table2")["rows"][0]["M2_t10"] == 8.0
    assert curves("figure2a")["M2"][0] == pytest.approx(3.65361, rel=1e-5)


def test_items_have_their_own_names():
    names = [item.name for item in SUITE.items]
    assert len(names) == len(set(names)) == 10


@pytest.mark.parametrize("runs", [3, 8, 1000])
def test_a_score_of_student_becomes_a_normal_one_of_equal_probability(runs):
    score = normal_sigmas(3.0, runs)
    assert stats.norm.sf(score) == pytest.approx(stats.t.sf(3.0, runs - 1), rel=1e-9)
    assert normal_sigmas(-3.0, runs) == -score
    assert score < 3.0


def test_deviations_of_the_mean_follow_the_normal_law():
    x = np.random.default_rng(3).normal(5.0, 2.0, (4, 1000))
    scores = mean_sigmas(x, 5.0)
    assert stats.kstest(scores, "norm").pvalue > 1e-3
    assert np.median(mean_sigmas(x, 6.0)) < -0.5


def test_rms_and_its_error():
    x = np.random.default_rng(4).normal(0.0, 3.0, (50, 2000))
    level, error = rms(x)
    assert np.mean(level) == pytest.approx(3.0, rel=0.01)
    # of 50 normal numbers: 3 / sqrt(2 * 50)
    assert np.mean(error) == pytest.approx(0.3, rel=0.05)


def test_checks_pass_and_fail():
    assert at_most("a", 1.0, 1.0, "").passed
    assert not at_most("a", 1.1, 1.0, "").passed
    assert worst("b", [1.0, -4.4, np.nan]).passed
    assert not worst("b", [1.0, -4.6]).passed


def test_plain_data():
    got = plain({1: np.array([1.0, np.nan]), "a": (np.int64(2), np.float64(1 / 3))})
    assert got == {"1": [1.0, None], "a": [2, 0.3333333]}


def _errors(scale: float) -> dict:
    rng = np.random.default_rng(5)
    level = {1000: (0.0241, 0.0152, 0.0212), 10_000: (0.0062, 0.0048, 0.0094)}
    return {
        "errors": {
            method: {
                str(n): (factor * np.array(e) * rng.normal(1.0, 0.35, (100, 3)) / 1.06).tolist()
                for n, e in level.items()
            }
            for method, factor in (("acceptance-rejection", 1.0), ("inverse", scale))
        }
    }


def test_an_item_tells_right_from_wrong():
    assert all(check.passed for check in table1.present(_errors(1.0)).checks)
    assert sum(not check.passed for check in table1.present(_errors(2.0)).checks) >= 2


@pytest.mark.slow
def test_pages_are_written_and_drawn_again(tmp_path, monkeypatch, capsys):
    small = {method: {1000: 40, 10_000: 20} for method in table1.METHODS}
    monkeypatch.setattr(table1, "QUICK", small)
    suite = Suite("paper", "A paper", "Someone, *Title*.", [table1.ITEM], ["a remark"])
    assert run_suite(suite, quick=True, output=tmp_path)
    page = (tmp_path / "paper" / "table1.md").read_text()
    assert "smoke test" in page
    assert "![Table 1" in page
    assert (tmp_path / "paper" / "table1.png").stat().st_size < 150_000
    summary = (tmp_path / "paper.md").read_text()
    assert "a remark" in summary
    assert "Every check that was run passed." in summary
    before = (tmp_path / "paper" / "table1.png").read_bytes()
    assert run_suite(suite, ["table1"], redraw=True, output=tmp_path)
    assert (tmp_path / "paper" / "table1.png").read_bytes() == before
    with pytest.raises(SystemExit, match="choose from table1"):
        run_suite(suite, ["tabel1"], output=tmp_path)


def test_a_failed_check_is_told(tmp_path, monkeypatch, capsys):
    item = table1.ITEM
    wrong = type(item)(item.name, item.title, lambda quick: _errors(2.0), item.present)
    assert not run_suite(Suite("paper", "A paper", "", [wrong]), quick=True, output=tmp_path)
    assert "not passed: rms error" in capsys.readouterr().out
    assert "Checks not passed" in (tmp_path / "paper.md").read_text()


def test_the_flat_loop_of_the_benchmarks_is_right():
    run = flat_loop(constant_rate, True)
    density = []
    for seed in range(30):
        sizes = new_sizes(2000, 1.5)
        _, _, n, volume = run(stream(seed), sizes, 2000, 0.1, 10.0)
        assert sizes[:n].sum() == volume
        density.append(n / volume)
    expected = exact.ConstantShattering(lam=0.1).moment([10.0], 0)
    assert np.abs(mean_sigmas(density, expected)) < 4
