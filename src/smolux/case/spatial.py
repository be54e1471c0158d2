"""Case files of discs in a box: the table ``[spatial]``, and what of it is shown."""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from smolux.errors import InputError
from smolux.settings import SpatialSettings
from smolux.settings.kinds import declared, kinds

from . import contents, read_text
from .reader import Problems, Table, show
from .settings import read_key, read_times
from .write import to_toml

if TYPE_CHECKING:
    from smolux.spatial import System

#: figures of a run in space, by the names of `smolux.cli`
FIGURES = (
    "discs", "coarsening", "spatial-kernel", "pair-distribution", "box-dimension", "mass-dimension",
)  # fmt: skip
_TRAJECTORIES = ("none", "xyz", "gsd")
#: settings that only time stepping has
_STEPPING = ("step", "rigid")
#: arguments of `smolux.spatial.simulate`
_RUN = {name: kind for name, kind in kinds(SpatialSettings).items() if name != "progress"}


@dataclass(frozen=True)
class SpatialRun:
    """How discs are placed and moved: the table ``[spatial]``."""

    discs: int
    initial: str = "lattice"
    volume_fraction: float = 0.1
    dimension: int = 2
    walls: tuple[str, ...] = ("reflecting",)
    velocities: str = "unit"
    temperature: float = 1.0
    radius_sigma: float = 1.0
    seed: int | None = None
    method: str = "windowed"
    step: float | None = None
    rigid: bool | None = None
    times: tuple[float, ...] | None = declared(SpatialSettings, "times")
    clusters: int = declared(SpatialSettings, "clusters")
    until: float | None = declared(SpatialSettings, "until")
    max_events: int | None = declared(SpatialSettings, "max_events")
    time_limit: float | None = declared(SpatialSettings, "time_limit")

    def system(self) -> System:
        """Place the discs.

        Raises
        ------
        InputError
            If they do not fit.
        """
        from smolux import spatial

        walls = self.walls * self.dimension if len(self.walls) == 1 else self.walls
        common: dict[str, Any] = {
            "dimension": self.dimension,
            "walls": walls,
            "velocities": self.velocities,
            "temperature": self.temperature,
            "seed": self.seed,
        }
        if self.initial == "lattice":
            return spatial.lattice(self.discs, self.volume_fraction, **common)
        radii = spatial.lognormal_radii(self.radius_sigma) if self.radius_sigma > 1 else None
        return spatial.random(self.discs, self.volume_fraction, radii=radii, **common)

    def settings(self) -> dict[str, Any]:
        """Arguments of `smolux.spatial.simulate` beside system and method."""
        return {name: getattr(self, name) for name in _RUN}

    def arguments(self) -> dict[str, Any]:
        """Arguments of `smolux.spatial.simulate` beside the system."""
        from smolux.spatial.methods import METHODS

        given = {name: getattr(self, name) for name in _STEPPING}
        settings = {name: value for name, value in given.items() if value is not None}
        method = next(m for m in METHODS if m.name == self.method)(**settings)
        return {"method": method} | self.settings()


@dataclass(frozen=True)
class SpatialOutput:
    """What is written beside the results."""

    figures: tuple[str, ...] = ("discs", "coarsening")
    trajectory: str = "none"
    movie: bool = False
    frames: int = 100


@dataclass(frozen=True)
class SpatialCase:
    """What a case file of discs in a box says."""

    run: SpatialRun
    output: SpatialOutput = field(default_factory=SpatialOutput)
    title: str = ""

    def with_seed(self) -> SpatialCase:
        """Return the case with a seed: its own, or a new one."""
        if self.run.seed is not None:
            return self
        return replace(self, run=replace(self.run, seed=secrets.randbits(48)))

    def to_toml(self) -> str:
        """Write the case with every default; `load` reads it back to an equal one."""
        tables: dict[str, Any] = {"title": self.title} if self.title else {}
        tables["spatial"] = _plain(asdict(self.run))
        tables["output"] = _plain(asdict(self.output))
        return to_toml(tables)


def _plain(table: Mapping[str, Any]) -> dict[str, Any]:
    values = {k: v for k, v in table.items() if v is not None}
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}


def load(path: str | os.PathLike[str], sets: Sequence[str] = ()) -> SpatialCase | None:
    """Read a case file of discs in a box; None if it is of something else.

    Parameters
    ----------
    path : path
    sets : sequence of str
        As for `smolux.case.load`.

    Raises
    ------
    InputError
        With every mistake, if it has a table ``[spatial]``.
    """
    file = Path(path).expanduser()
    if not file.is_file():
        return None  # left to the reader of other cases, which says so
    content, problems = contents(read_text(file), file.name, sets)
    if "spatial" not in content:
        return None
    top = Table(content, (), problems)
    title = top.text("title", "")
    top.known += ["spatial", "output"]
    top.finish()
    run = _read_run(content["spatial"], problems)
    output = _read_output(content.get("output", {}), problems)
    problems.raise_if_any()
    assert run is not None
    return SpatialCase(run, output, title)


def _read_run(content: Any, problems: Problems) -> SpatialRun | None:
    from smolux.spatial.methods import NAMES

    table = Table(content, ("spatial",), problems)
    if "discs" not in table:
        table.require("discs", "how many discs there are, such as 2500")
    settings: dict[str, Any] = {
        "discs": table.integer("discs", 1, 1),
        "initial": table.choice("initial", SpatialRun.initial, ("lattice", "random")),
        "volume_fraction": table.number("volume_fraction", SpatialRun.volume_fraction, above=0.0),
        "dimension": table.integer("dimension", SpatialRun.dimension, 2, 3),
        "walls": _read_walls(table),
        "velocities": table.choice("velocities", SpatialRun.velocities, ("unit", "maxwellian")),
        "temperature": table.number("temperature", SpatialRun.temperature, above=0.0),
        "radius_sigma": table.number("radius_sigma", SpatialRun.radius_sigma, 1.0),
        "seed": table.integer("seed", None, 0),
        "method": table.choice("method", SpatialRun.method, list(NAMES)),
        "step": table.number("step", None, above=0.0),
        "rigid": table.flag("rigid", False) if "rigid" in table else None,
    }
    for name, kind in _RUN.items():
        if name == "times":
            settings[name] = read_times(table, kind) if name in table else None
        else:
            settings[name] = read_key(table, name, kind, getattr(SpatialRun, name))
    if settings["initial"] == "lattice" and settings["radius_sigma"] > 1:
        table.bad("radius_sigma", 'on a lattice all discs are equal; use initial = "random"')
    if len(settings["walls"]) not in (1, settings["dimension"]):
        table.bad("walls", f"one word, or one for each of {settings['dimension']} axes")
    table.finish()
    run = SpatialRun(**settings)
    _check_method(run, table)
    return run


def _check_method(run: SpatialRun, table: Table) -> None:
    """Note settings that the method does not have, does not take, or lacks."""
    if table.problems.check_units():
        table.bad("times", "a box has no units: give numbers")
    if run.method == "time-stepping":
        if "times" not in table:
            table.require("times", "a run by time steps is observed on its way; give a list")
        try:
            run.arguments()
        except InputError as error:
            table.problems.add_error(table.path, error)
        return
    for key in _STEPPING:
        if key in table:
            table.bad(key, 'only the method "time-stepping" has it')


def _read_walls(table: Table) -> tuple[str, ...]:
    from smolux.spatial.box import WALLS

    value = table.take("walls", list(SpatialRun.walls))
    words = [value] if isinstance(value, str) else value
    if not (isinstance(words, list) and words and all(w in WALLS for w in words)):
        table.bad("walls", 'must be "reflecting" or "periodic", or a list with one for each axis')
        return SpatialRun.walls
    return tuple(words)


def _read_output(content: Any, problems: Problems) -> SpatialOutput:
    table = Table(content, ("output",), problems)
    figures = table.take("figures", list(SpatialOutput.figures))
    if not (isinstance(figures, list) and all(f in FIGURES for f in figures)):
        table.bad("figures", f"must be a list of some of {show(list(FIGURES))}")
        figures = []
    output = SpatialOutput(
        tuple(dict.fromkeys(figures)),
        table.choice("trajectory", SpatialOutput.trajectory, _TRAJECTORIES),
        table.flag("movie", SpatialOutput.movie),
        table.integer("frames", SpatialOutput.frames, 1, 10_000),
    )
    table.finish()
    return output
