"""Compiled loops are kept between sessions, shared by parallel workers, apart from the user's."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest


def pytest_configure(config: pytest.Config) -> None:
    if "SMOLUX_CACHE_DIR" in os.environ:
        return
    cache = getattr(config, "cache", None)  # missing under -p no:cacheprovider
    if cache is not None:
        folder = cache.mkdir("smolux-compiled")
    else:
        owner = os.getuid() if hasattr(os, "getuid") else "user"
        folder = Path(tempfile.gettempdir()) / f"smolux-tests-{owner}"
    os.environ["SMOLUX_CACHE_DIR"] = str(folder)
