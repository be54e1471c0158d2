"""The choice of a weighting by a pilot.

The model is that of the law tests of weightings, whose loops it shares.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import smolux as sx
from shared import FORMULA
from smolux import case as cases
from smolux.cli.commands import run as command
from smolux.errors import InputError
from smolux.settings.target_error import Target
from smolux.stochastic import checkpoint, choose_weighting
from smolux.stochastic import make_plan as make_plan_of
from smolux.stochastic.choose_method import event_cost
from smolux.stochastic.make_plan import make_plan
from smolux.stochastic.plan import Plan

METHOD = "acceptance-rejection"
KERNEL = sx.kernels.formula(FORMULA, c0=1.0, c1=0.0, c2=0.0, c3=0.0)


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choose_weighting, "_REPLICAS", 64)
    monkeypatch.setattr(choose_weighting, "_PARTICLES", 200)


def model(initial: Any = None) -> sx.Model:
    p = sx.processes
    processes = [p.Aggregation(), p.Shattering(0.0), p.Evaporation(0.0)]
    return sx.Model(KERNEL, processes, initial or sx.initial.monodisperse())


def plan(target: str, times: Any = (20.0,), **settings: Any) -> Plan:
    given = {
        "method": METHOD, "weighting": "auto", "population": "doubling", "particles": 100_000,
        "replicas": 8, "seed": 5, "orders": (0, 1, 2, 3), "sizes": 1024, "bins_per_octave": 4,
        "distribution": False, "target": target,
    } | settings  # fmt: skip
    return make_plan(model(), times, **given)


def power(plan: Plan) -> float:
    """Power of the size that is the weight."""
    weighting = plan.weighting
    if isinstance(weighting, sx.weighting.WeightFunction):
        assert weighting.exponent is not None
        return weighting.exponent
    return {"number": 0.0, "mass-flow": 1.0}[weighting.name]


def test_number_for_small_sizes_and_mass_for_large_ones() -> None:
    """The constant kernel; of u_50(20) mass flow has a variance 60 to 130 times smaller."""
    small, large = (plan(target) for target in ("n_1", "n_50"))
    assert power(small) < 1.0 <= power(large)
    assert "efficiency for n_50 over that of number" in large.weighting_reason
    # what is compared does not depend on the machine, so the same plan gives the same
    again = plan("n_50")
    assert (again.weighting, again.weighting_reason) == (large.weighting, large.weighting_reason)
    assert plan("n_50", weighting="number").weighting_reason == ""


def test_sizes_too_rare_to_be_seen_are_counted_by_their_weight() -> None:
    """No pilot sees the size 400 at t = 1; more of it are expected the larger the weight is."""
    found = plan("n_400", times=[1.0])
    assert power(found) >= 1.0


@pytest.mark.parametrize(
    ("deviations", "mean", "costs", "chosen"),
    [
        ([[0.1, 0.1], [0.05, 0.05]], 1.0, (1.0, 1.0), "mass-flow"),
        ([[0.1, 0.1], [0.05, 0.05]], 1.0, (1.0, 8.0), "number"),  # four times better, but dear
        ([[0.1, 0.1], [0.1, 0.1]], 1.0, (8.0, 1.0), "mass-flow"),
        ([[0.1, 0.1], [0.01, 0.5]], 1.0, (1.0, 1.0), "number"),  # at the worst time
        ([[0.1, 0.1], [0.5, 0.5]], 10.0, (1.0, 1.0), "mass-flow"),  # relative to the mean
    ],
)
def test_what_a_weighting_is_worth(
    deviations: Any, mean: float, costs: tuple[float, float], chosen: str
) -> None:
    noise = np.random.default_rng(1).standard_normal((200, 2))
    trials = [
        choose_weighting._Trial(
            weighting, scale * (1 + np.array(d) / scale * noise), np.ones((200, 2)), cost
        )
        for weighting, d, scale, cost in zip(
            (sx.weighting.Number(), sx.weighting.MassFlow()), deviations, (1.0, mean), costs,
            strict=True,
        )
    ]  # fmt: skip
    target = Target("M2")
    assert choose_weighting._compared(target, trials)[0].name == chosen


def test_what_has_no_scatter_is_left_alone() -> None:
    found = plan("number_density", times=[1e-9])
    assert found.weighting.name == "number"
    assert "no scatter" in found.weighting_reason


@pytest.mark.parametrize(
    ("target", "name"),
    [("number_density", "number"), ("M0", "number"), ("M2", "mass-flow"), ("n_9", "mass-flow")],
)
def test_rule_where_a_pilot_takes_too_long(
    target: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choose_weighting, "_EFFORT", 1000)
    found = plan(target)
    assert found.weighting.name == name
    assert "by rule" in found.weighting_reason


def test_the_run_is_that_with_the_weighting_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choose_weighting, "_POWERS", (0.5, 1.5))  # both of one compiled loop
    settings: dict[str, Any] = {"method": METHOD, "particles": 200, "replicas": 3, "seed": 7}
    chosen = sx.simulate(model(), [4.0], weighting="auto", target="n_9", **settings)
    assert chosen.attrs["weighting"] == "weight-function"
    assert chosen.attrs["weighting_settings"] in ('{"w": 0.5}', '{"w": 1.5}')
    q = float(chosen.attrs["weighting_settings"][6:-1])
    given = sx.simulate(model(), [4.0], weighting=sx.weighting.WeightFunction(q), **settings)
    np.testing.assert_array_equal(chosen["n"], given["n"])
    assert given.attrs["weighting_reason"] == "asked for"
    ensemble = sx.ensemble(
        model(), [4.0], ["n_9", "M2"], weighting="auto", method=METHOD, particles=200, replicas=40,
        seed=7,
    )  # fmt: skip
    assert ensemble.attrs["weighting_settings"] == chosen.attrs["weighting_settings"]


def test_the_choice_goes_into_checkpoints(tmp_path: Any) -> None:
    settled = plan("n_50")
    checkpoint.save(tmp_path / "run.npz", settled, [])
    stored, _ = checkpoint.load(tmp_path / "run.npz")
    assert stored == settled


def test_a_begun_run_is_known_by_what_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = sx.weighting.MassFlow(), "in a pilot"
    monkeypatch.setattr(make_plan_of, "chosen_weighting", lambda model, settings: chosen)
    text = '[kernel]\nname = "constant"\n[run]\ntimes = [4]\nseed = 5\nweighting = '
    for asked in (
        '"auto"\ntarget = "n_50"', '"weight-function"\nexponent = 0.5', '"mass-flow"'
    ):  # fmt: skip
        case = cases.parse(text + asked)
        assert case.run is not None
        begun = make_plan(case.model, **case.run.arguments())
        command._check_plan(begun, case)
        other = cases.parse(text + '"number"')
        with pytest.raises(InputError, match="was changed"):
            command._check_plan(begun, other)


def test_the_method_is_chosen_for_the_weighting() -> None:
    constant = sx.Model(sx.kernels.Constant())

    def cost(weighting: str, method: str) -> float:
        return event_cost(
            make_plan(
                constant,
                [20.0],
                method=method,
                weighting=weighting,
                particles=100_000,
                replicas=1,
                seed=1,
                orders=(0,),
                sizes=8,
            )
        )

    assert cost("mass-flow", "acceptance-rejection") > 2 * cost("number", "acceptance-rejection")
    assert cost("number", "auto") < cost("mass-flow", "auto") < 2 * cost("number", "auto")
    assert cost("mass-flow", "inverse") == cost("number", "inverse") == 1.0
    settled = plan("n_50", method="auto")
    assert settled.method.name == "size-class"


def test_mistakes() -> None:
    with pytest.raises(InputError, match="another quantity with each weighting") as error:
        plan("largest")
    assert len(error.value.problems) == 1
    with pytest.raises(InputError, match="this moment is not computed") as error:
        plan("M7")
    assert len(error.value.problems) == 1
    with pytest.raises(InputError, match="weighting = 'atuo': is unknown; did you mean 'auto'"):
        plan("M2", weighting="atuo")


def test_case_file() -> None:
    text = '[kernel]\nname = "constant"\n[run]\ntimes = [4]\nweighting = "auto"\ntarget = "n_50"\n'
    case = cases.parse(text)
    assert case.run is not None
    assert case.run.arguments()["weighting"] == "auto"
    assert cases.parse(case.to_toml()) == case
    with pytest.raises(InputError, match='is for weighting = "weight-function"'):
        cases.parse(text + "exponent = 0.5\n")
