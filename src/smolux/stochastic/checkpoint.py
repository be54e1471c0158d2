"""Checkpoints: the plan and every array of the state, in one file, without pickle."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from smolux.core.state import State, Tally, TimeWindows
from smolux.errors import InputError
from smolux.functions.content import frozen
from smolux.model import Model
from smolux.model_dict import model_from_dict, model_to_dict
from smolux.observables import layout
from smolux.runtime.files import replacing
from smolux.settings import Settings, from_plain, plain

from .plan import Plan
from .replicas import Group
from .subvolumes import SubvolumeReplica, within

#: what reading a file that is no checkpoint, or half of one, may raise
_UNREADABLE = (
    OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, zipfile.BadZipFile,
)  # fmt: skip

#: raised whenever the content of a checkpoint changes; columns of state and tally speak for
#: themselves
VERSION = 7


def _plan_to_dict(plan: Plan) -> dict[str, Any]:
    return {
        "model": model_to_dict(plan.model),
        "asked": plain(Settings, plan.asked),
        "decided": plain(Settings, plan),
        "reason": plan.reason,
        "weighting_reason": plan.weighting_reason,
    }


def _plan_from_dict(given: dict[str, Any], model: Model | None) -> Plan:
    return Plan(
        model=frozen(model) if model is not None else model_from_dict(given["model"]),
        asked=Settings(**from_plain(Settings, given["asked"])),
        reason=given["reason"],
        weighting_reason=given["weighting_reason"],
        **from_plain(Settings, given["decided"]),
    )


def save(path: str | Path, plan: Plan, groups: Sequence[Group | SubvolumeReplica]) -> None:
    """Write a checkpoint, whole or not at all; see `smolux.runtime.files.replacing`."""
    if not all(group.intact for group in groups):
        raise InputError("memory ended while sub-volumes were mixed")
    arrays: dict[str, np.ndarray] = {}
    about = [_put(arrays, str(k), group) for k, group in enumerate(groups)]
    meta = {
        "version": VERSION, "layout": layout(), "plan": _plan_to_dict(plan), "groups": about,
    }  # fmt: skip
    arrays["meta"] = np.frombuffer(json.dumps(meta).encode(), np.uint8)
    with replacing(path) as temporary, temporary.open("wb") as f:
        np.savez(f, **arrays)  # type: ignore[arg-type]


def _put(
    arrays: dict[str, np.ndarray], key: str, group: Group | SubvolumeReplica
) -> dict[str, Any]:
    """Add the arrays of a group under names that begin with `key`; return the rest."""
    kinds: dict[str, Any] = {"state": group.state, "tally": group.tally, "windows": group.windows}
    if isinstance(group, Group):
        kinds["work"] = group.work
    for kind, values in kinds.items():
        arrays |= {f"{key}/{kind}/{name}": v for name, v in values._asdict().items()}
    arrays[f"{key}/codes"] = group.codes
    rows = [row for replica in group.distribution for row in replica]
    empty = [np.empty(0, np.int64)]
    arrays[f"{key}/distribution/rows"] = np.array([len(s) for s, _ in rows], np.int64)
    arrays[f"{key}/distribution/sizes"] = np.concatenate([s for s, _ in rows] + empty)
    arrays[f"{key}/distribution/counts"] = np.concatenate([c for _, c in rows] + empty)
    joint = [each for replica in getattr(group, "joint", ()) for each in replica]
    if joint:
        arrays[f"{key}/distribution/joint"] = np.concatenate(joint)
    about = {
        "first": group.first,
        "seconds": group.seconds,
        "bounds_seconds": group.bounds_seconds,
        "populations": [len(replica) for replica in group.distribution],
    }
    if isinstance(group, SubvolumeReplica):
        about |= {"stretch": group.stretch, "length": group.length, "open": list(group.open)}
        about["parts"] = [_put(arrays, f"{key}/{m}", part) for m, part in enumerate(group.parts)]
    return about


def load(
    path: str | Path, model: Model | None = None
) -> tuple[Plan, list[Group | SubvolumeReplica]]:
    """Read a checkpoint.

    Parameters
    ----------
    path : str or path
    model : Model, optional
        Needed if the kernel or a rate is a Python function, which a file cannot hold; it must be
        the model of the interrupted run.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another version, or of another model.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        meta = json.loads(arrays.pop("meta").tobytes())
        version = meta["version"]
    except FileNotFoundError:
        raise InputError(f"checkpoint = {str(path)!r}: there is no such file") from None
    except _UNREADABLE as error:
        raise _damaged(path, error) from error
    if version != VERSION or meta.get("layout") != layout():
        # a column more or less is another layout of the same version
        which = f"{VERSION}" if version != VERSION else "it with other columns of the state"
        raise InputError(
            f"checkpoint = {str(path)!r}: has version {version}, this smolux reads "
            f"{which}; go on with the smolux that wrote it"
        )
    try:
        if model is not None and model_to_dict(model) != meta["plan"]["model"]:
            raise InputError(f"model: is not the one of the checkpoint {str(path)!r}")
        plan = _plan_from_dict(meta["plan"], model)
        return plan, [_take(arrays, str(k), about, plan) for k, about in enumerate(meta["groups"])]
    except InputError:
        raise
    except _UNREADABLE as error:
        raise _damaged(path, error) from error


def _damaged(path: str | Path, error: Exception) -> InputError:
    reason = f"{type(error).__name__}: {error}"
    return InputError(f"checkpoint = {str(path)!r}: is none, or damaged ({reason})")


def _take(
    arrays: dict[str, np.ndarray], key: str, about: dict[str, Any], plan: Plan
) -> Group | SubvolumeReplica:
    """Make a group of what `_put` has added."""

    def part(kind: str) -> dict[str, np.ndarray]:
        start = f"{key}/{kind}/"
        return {n.removeprefix(start): v for n, v in arrays.items() if n.startswith(start)}

    stored = part("distribution")
    ends = np.cumsum(stored["rows"])[:-1]
    rows = list(zip(np.split(stored["sizes"], ends), np.split(stored["counts"], ends), strict=True))
    given = np.split(stored["joint"], ends) if "joint" in stored else []
    distribution, joint = [], []
    for length in about["populations"]:
        distribution.append(rows[:length])
        joint.append(given[:length])
        rows, given = rows[length:], given[length:]
    common: dict[str, Any] = {
        "first": about["first"],
        "state": State(**part("state")),
        "tally": Tally(**part("tally")),
        "codes": arrays[f"{key}/codes"],
        "windows": TimeWindows(**part("windows")),
        "distribution": distribution,
        "seconds": about["seconds"],
        "bounds_seconds": about.get("bounds_seconds", 0.0),
    }
    if "parts" not in about:
        return Group(plan, work=plan.store.work_type(**part("work")), joint=joint, **common)
    times = tuple(about.get("open", ()))
    alone = within(plan, times) if times else replace(plan, subvolumes=1, replicas=1)
    parts: list[Any] = [
        _take(arrays, f"{key}/{m}", each, alone) for m, each in enumerate(about["parts"])
    ]
    stretch = {name: about[name] for name in ("stretch", "length")}
    return SubvolumeReplica(plan, parts=parts, open=times, **stretch, **common)
