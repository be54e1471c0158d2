"""Compare how two checkouts bound rates, and what they make of the same arguments.

::

    python tools/side_by_side.py ../old ../new

In each checkout: the bounds of 10 000 random boxes of sizes for every kernel with every weighting,
and 500 random sets of arguments of `smolux.simulate`, right ones and wrong ones, up to the plan.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

BOXES, SETS = 10_000, 500


def boxes(count: int) -> Any:
    """Return edges of random boxes of sizes, many of them single sizes."""
    import numpy as np

    rng = np.random.default_rng(1)
    low = np.floor(2.0 ** rng.uniform(0, 40, (count, 2)))
    high = np.where(rng.random((count, 2)) < 0.2, low, np.floor(low * 2.0 ** rng.exponential(2)))
    return low[:, 0], high[:, 0], low[:, 1], high[:, 1]


def bounds() -> dict[str, str]:
    """Return a digest of the bounds for every kernel with every weighting."""
    import hashlib

    import numpy as np

    from smolux import kernels
    from smolux.weighting import WEIGHTINGS, WeightFunction

    laws = [law(**law.example) if law.example else law() for law in kernels.KERNELS]
    laws.append(kernels.formula("(i/j)**0.3 + (j/i)**0.3 + exp(-i*j/1e6)"))
    weightings = [w() for w in WEIGHTINGS if w is not WeightFunction]
    weightings += [WeightFunction(q) for q in (0.5, 1.25, -0.3)]
    found = {}
    for law in laws:
        for weighting in weightings:
            ends = np.stack(weighting.bounds(law)(*boxes(BOXES)))
            name = f"bounds of {law!r} weighted by {weighting!r}"
            found[name] = hashlib.sha256(ends.astype("<f8").tobytes()).hexdigest()
    return found


def argument_sets(count: int) -> list[dict[str, Any]]:
    """Return random arguments, of which some are wrong."""
    import numpy as np

    rng = np.random.default_rng(2)
    choices: dict[str, list[Any]] = {
        "times": [[1.0], [0.0, 2.5], [2.0, 1.0], [], "soon", [float("nan")]],
        "method": ["auto", "inverse", "size-class", "low-rank", "best", None],
        "weighting": ["number", "mass-flow", "weight-function", 3],
        "population": ["doubling", "fixed-volume", "none", "constant"],
        "particles": [2, 1000, 64_000, 1, -3, 10.0, "many"],
        "replicas": [1, 8, 0, 2.5],
        "seed": [0, 2**70, None, -1, "x"],
        "orders": [[0, 1, 2], [0.5], [], [1, 1], ["a"]],
        "sizes": [1, 1024, 0, 10**6],
        "bins_per_octave": [1, 4, 1024, 5000],
        "target_error": [None, 0.01, 0.0, 2],
        "target": ["number_density", "M2", "n_5", "largest", "M9", "n_0"],
        "max_replicas": [1000, 1, 0],
        "subvolumes": [1, 2, 64, 0],
        "remix": [1.0, 0.1, 0.0, 50],
    }
    right = {name: values[0] for name, values in choices.items()}
    sets = []
    for _ in range(count):
        changed = rng.choice(list(choices), rng.integers(0, 5), replace=False)
        sets.append(
            right | {name: choices[name][rng.integers(len(choices[name]))] for name in changed}
        )
    return sets


def plans() -> dict[str, str]:
    """Return what becomes of each set of arguments: the plan, or what is wrong with them."""
    import smolux as sx
    from smolux.stochastic.make_plan import make_plan

    model = sx.Model(sx.kernels.Additive(), initial=sx.initial.from_sizes({2: 1.5, 7: 0.5}))
    found = {}
    for k, given in enumerate(argument_sets(SETS)):
        try:
            plan = make_plan(model, distribution=False, **given)
            drawn = ("seed",) if given["seed"] is None else ()
            shown = {name: getattr(plan, name) for name in given if name not in drawn}
            text = f"{shown} {plan.reason} {plan.volume!r} {plan.doubles_at}"
        except sx.InputError as error:
            text = f"refused: {error}"
        found[f"arguments {k}: {given}"] = text
    return found


def probed(checkout: Path) -> dict[str, str]:
    """Run the probe in a checkout."""
    environment = {**os.environ, "PYTHONPATH": str(checkout.resolve() / "src")}
    done = subprocess.run(
        [sys.executable, __file__], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"{checkout}: {done.stderr}")
    found: dict[str, str] = json.loads(done.stdout)
    return found


def main(arguments: list[str]) -> int:
    """Compare two checkouts; without any, print what this one makes of the probe."""
    if not arguments:
        print(json.dumps(bounds() | plans()))
        return 0
    old, new = (probed(Path(argument)) for argument in arguments)
    differ = [name for name in old | new if old.get(name) != new.get(name)]
    for name in differ[:20]:
        print(f"{name}\n  before: {old.get(name)}\n  now:    {new.get(name)}")
    print(f"{len(old | new) - len(differ)} of {len(old | new)} are the same")
    return 1 if differ else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
