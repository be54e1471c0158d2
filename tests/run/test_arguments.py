"""Mistakes in the arguments: all in one message, each by name, with its value and the cure."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pytest

import smolux as sx
from smolux.errors import InputError
from smolux.stochastic import make_plan as make_plan_of
from smolux.stochastic import plan

MODEL = sx.Model(sx.kernels.Constant())


def problems(call: Any = sx.simulate, model: Any = MODEL, times: Any = (1.0,), **given: Any) -> Any:
    with pytest.raises(InputError) as caught:
        call(model, times, **given)
    assert str(caught.value) == "\n".join(caught.value.problems)
    return caught.value.problems


#: argument, value, and what the message says after naming both
WRONG = [
    ("method", "acceptance-rejectoin", "did you mean 'acceptance-rejection'?"),
    ("method", "invers", "did you mean 'inverse'?"),
    ("method", "xyz", "choose from 'size-class', 'acceptance-rejection'"),
    ("method", sx.methods.METHODS[0], "unknown"),  # the class, not an instance
    ("weighting", "numbers", "did you mean 'number'?"),
    ("population", "dubling", "did you mean 'doubling'?"),
    ("population", 7, "choose from 'doubling', 'fixed-volume', 'none'"),
    ("particles", 1, "must be a whole number of at least 2"),
    ("particles", 10.5, "must be a whole number"),
    ("particles", "many", "must be a whole number"),
    ("particles", float("inf"), "must be a whole number"),
    ("replicas", 0, "must be a whole number of at least 1"),
    ("replicas", True, "must be a whole number"),
    ("seed", -1, "must be a whole number of at least 0"),
    ("seed", "abc", "must be a whole number"),
    ("sizes", 0, "must be a whole number of at least 1"),
    ("bins_per_octave", 0, "must be a whole number from 1 to 1024"),
    ("bins_per_octave", 5000, "must be a whole number from 1 to 1024"),
    ("orders", [1, 1], "different finite numbers"),
    ("orders", [], "different finite numbers"),
    ("orders", "all", "list of numbers"),
    ("times", [2.0, 1.0], "must ascend, but 1 follows 2"),
    ("times", [1.0, 1.0], "must ascend, but 1 follows 1"),
    ("times", [-1.0, 1.0], "zero or more"),
    ("times", [0.0], "end above zero"),
    ("times", [1.0, float("nan")], "must be finite"),
    ("times", [], "at least one number"),
    ("times", "soon", "must be a list of numbers"),
    ("times", [[1.0]], "must be a list"),
    ("model", None, "must be a smolux.Model(kernel=..., ...)"),
    ("executor", 4, "must be a concurrent.futures.Executor, or None"),
    ("progress", "bar", "must be a function that takes a Progress"),
    ("checkpoint", 3, "must be the path of a file"),
    ("checkpoint", "/", "is a folder; name a file in it"),
    ("checkpoint", "nowhere/at/all.npz", "create it first"),
    ("checkpoint_every", 0, "must be a positive number of seconds"),
    ("checkpoint_every", None, "must be a positive number of seconds"),
    ("time_limit", -1.0, "must be a positive number of seconds"),
    ("time_limit", "1h", "must be a positive number of seconds"),
]


@pytest.mark.parametrize(("name", "value", "cure"), WRONG)
def test_one_mistake(name: str, value: Any, cure: str) -> None:
    (message,) = problems(**{name: value})
    assert message.startswith(name)
    assert cure in message
    if "ascend" not in cure:  # where the two times are named
        assert repr(value) in message


def test_all_mistakes_at_once() -> None:
    given = {name: value for name, value, _ in reversed(WRONG)}
    found = problems(**given)
    assert len(found) == len(given)
    assert sorted(message.split(maxsplit=1)[0].rstrip(":") for message in found) == sorted(given)


def test_what_only_threads_do() -> None:
    with ProcessPoolExecutor(1) as executor:  # starts no process until it is used
        found = problems(executor=executor, checkpoint="a.npz", time_limit=1.0)
    assert [message.split()[0] for message in found] == ["checkpoint", "time_limit"]
    assert all("threads of this process" in message for message in found)


def test_memory_is_refused_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    (message,) = problems(particles=10**15, replicas=2)
    assert "particles = 1000000000000000" in message
    assert "replicas = 2" in message
    assert "GB of particles" in message
    assert "this process may use" in message
    assert "lower" in message
    (message,) = problems(times=np.linspace(0, 1, 10**6), particles=10, sizes=10**7)
    assert "observations" in message
    assert "sizes = 10000000" in message
    # what cannot be known is no obstacle
    monkeypatch.setattr(plan, "available_memory", lambda: None)
    assert (
        plan.check_memory(
            make_plan_of.make_plan(
                MODEL,
                [1.0],
                method="inverse",
                population="none",
                particles=10,
                replicas=1,
                seed=1,
                orders=(0,),
                sizes=10**8,
            )
        )
        is None
    )


def test_what_is_accepted() -> None:
    given: dict[str, Any] = {"weighting": "number", "population": "none", "seed": 2**200}
    made = make_plan_of.make_plan(
        MODEL,
        2,
        method=sx.methods.METHODS[0](),
        particles=np.int64(10),
        replicas=2.0,
        orders=np.array([0, 0.5]),
        sizes=5,
        bins_per_octave=1,
        distribution=False,
        **given,
    )
    assert made.times == (2.0,)
    assert (made.particles, made.replicas, made.seed) == (10, 2, 2**200)
    assert made.orders == (0.0, 0.5)


SOLVE = [
    ("method", "low-rnak", "did you mean 'low-rank'?"),
    ("tolerance", 0.0, "tolerance"),
    ("times", [2.0, 1.0], "must ascend"),
    ("model", 3, "must be a smolux.Model"),
    ("window", 0, "window"),
]


@pytest.mark.parametrize(("name", "value", "cure"), SOLVE)
def test_one_mistake_in_solve(name: str, value: Any, cure: str) -> None:
    (message,) = problems(sx.solve, **{name: value})
    assert message.startswith(name)
    assert cure in message


def test_all_mistakes_in_solve_at_once() -> None:
    given = {name: value for name, value, _ in SOLVE}
    found = problems(sx.solve, **given)
    assert sorted(message.split(maxsplit=1)[0].rstrip(":") for message in found) == sorted(given)


def test_resume_checks_its_arguments() -> None:
    with pytest.raises(InputError) as caught:
        sx.resume("none.npz", time_limit=0, progress=1)  # type: ignore[arg-type]
    assert len(caught.value.problems) == 2


def test_a_rate_that_turns_negative_before_the_end() -> None:
    model = sx.Model(
        sx.kernels.Constant(),
        [sx.processes.Aggregation(), sx.processes.Shattering("0.1 * (1 - t)")],
    )
    (message,) = problems(model=model, times=[2.0])
    assert "shattering" in message
    assert "0.1 * (1 - t)" in message
    assert "must not be negative" in message
    assert "max(0, ...)" in message
