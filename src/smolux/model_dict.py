"""A model as plain data: what case files and result files hold."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from .initial import Initial, Sizes
from .kernels.base import Kernel
from .model import Model
from .processes.base import PairProcess


def _plain(value: Any) -> Any:
    """Return numbers, texts and lists as plain Python; a function of time as its text."""
    if isinstance(value, str) or value is None:
        return value
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value)
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    return str(getattr(value, "text", value))


def _kernel_to_dict(kernel: Kernel) -> dict[str, Any]:
    return {"name": kernel.name} | {f.name: _plain(getattr(kernel, f.name)) for f in fields(kernel)}


def _process_to_dict(process: PairProcess) -> dict[str, Any]:
    return {"name": process.name} | {
        f.name: _plain(getattr(process, f.name)) for f in fields(process)
    }


def _initial_to_dict(initial: Initial) -> dict[str, Any]:
    if isinstance(initial, Sizes):
        densities = dict(zip(map(str, initial.sizes), initial.densities_, strict=True))
        return {"name": initial.name, "densities": densities}
    return {"name": initial.name} | {
        f.name: _plain(getattr(initial, f.name)) for f in fields(initial)
    }


def model_to_dict(model: Model) -> dict[str, Any]:
    """Write a model as plain data: tables ``kernel`` and ``initial`` and a list ``processes``.

    Parameters
    ----------
    model : Model

    Returns
    -------
    dict
        Of texts, numbers, lists and dictionaries only, as TOML and JSON hold them.
    """
    return {
        "kernel": _kernel_to_dict(model.kernel),
        "processes": [_process_to_dict(p) for p in model.processes],
        "initial": _initial_to_dict(model.initial),
    }
