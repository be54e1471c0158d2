"""A model as the tables of a case file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from smolux import units
from smolux.initial import Initial, Sizes
from smolux.kernels import Sum
from smolux.model import Model
from smolux.model_dict import model_to_dict

from .physics import FIELDS


def model_tables(model: Model, si: bool) -> dict[str, Any]:
    """Tables of a case file for a model, with units if it has them."""
    data = model_to_dict(model)
    tables: dict[str, Any] = {"kernel": _given(data["kernel"])}
    laws = [tables["kernel"], *tables["kernel"].get("terms", ())]
    for law in laws:
        if law["name"] in ("formula", Sum.name):  # said by what else stands there
            del law["name"]
        elif si:
            for key in law:
                if ("kernel", key) in FIELDS:
                    law[key] = units.text(law[key], FIELDS["kernel", key])
    tables["processes"] = [_given(p) for p in data["processes"]]
    tables["initial"] = _initial_table(model.initial, data["initial"])
    if "attributes" in data:
        tables["attributes"] = [_given(a) for a in data["attributes"]]
    if si:
        for (section, key), dimension in FIELDS.items():
            value = tables[section].get(key) if section != "kernel" else None
            if isinstance(value, Mapping):
                tables[section][key] = {k: units.text(v, dimension) for k, v in value.items()}
            elif value is not None:
                tables[section][key] = units.text(value, dimension)
    return tables


def _given(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a table says: a key that was left out is None in Python, and TOML has no None."""
    return {k: v for k, v in table.items() if v is not None}


def _initial_table(initial: Initial, data: dict[str, Any]) -> dict[str, Any]:
    if isinstance(initial, Sizes) and len(initial.sizes) == 1:
        size, density = initial.sizes[0], initial.densities_[0]
        return {"name": "monodisperse", "size": size, "density": density}
    return _given(data)
