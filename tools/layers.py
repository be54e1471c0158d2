"""Draw the layers of the package, as the import contract in ``pyproject.toml`` has them, as SVG.

``python tools/layers.py`` writes the figure of the architecture page; a test compares the two.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIGURE = ROOT / "docs" / "explanation" / "layers.svg"

#: what a layer is there for, by its first module
WORDS = {
    "__main__": "python -m smolux",
    "cli": "commands",
    "sweeps": "a grid of cases",
    "case": "TOML in; self-test",
    "plotting": "figures",
    "ensembles": "very many replicas",
    "stochastic": "three ways to compute; reading results",
    "results": "Datasets and files; closed forms",
    "model_dict": "models as data; what is observed",
    "settings": "arguments: declared, checked",
    "methods": "how pairs are found; weights of particles",
    "model": "kernel, processes, start",
    "initial": "what happens to particles",
    "kernels": "rates of pairs; the event loop",
    "jit": "all that knows Numba",
    "functions": "what users may write for a number",
    "runtime": "files, memory, stops; units; intervals",
    "checks": "of numbers",
    "errors": "mistakes and warnings",
}
_ROW, _GAP, _LEFT, _WIDTH, _WORDS = 30, 6, 8, 470, 320
_SIDES = {"core", "jit", "methods", "stochastic", "spatial"}


def layers() -> list[list[str]]:
    """Return the modules of each layer, from the top."""
    content = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = content["tool"]["importlinter"]["contracts"]
    return [re.split(r"\s*[|:]\s*", layer) for layer in contracts[0]["layers"]]


def drawn() -> str:
    """Return the figure."""
    rows = layers()
    height = len(rows) * (_ROW + _GAP) + _GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_LEFT + _WIDTH + _WORDS} {height}"'
        ' font-family="system-ui, sans-serif" font-size="13">',
        "<title>Each layer knows only those below it</title>",
    ]
    for number, row in enumerate(rows):
        top = _GAP + number * (_ROW + _GAP)
        width = (_WIDTH - _GAP * (len(row) - 1)) / len(row)
        for place, name in enumerate(row):
            left = _LEFT + place * (width + _GAP)
            fill = "#f3d9b8" if name in _SIDES else "#dde7f0"
            lines += [
                f'<rect x="{left:.1f}" y="{top}" width="{width:.1f}" height="{_ROW}" rx="4"'
                f' fill="{fill}" stroke="#5b6670"/>',
                f'<text x="{left + width / 2:.1f}" y="{top + 20}" text-anchor="middle"'
                f' fill="#1d2329">{name}</text>',
            ]
        lines.append(
            f'<text x="{_LEFT + _WIDTH + 12}" y="{top + 20}" fill="#5b6670">{WORDS[row[0]]}</text>'
        )
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    FIGURE.write_text(drawn(), encoding="utf-8")
    sys.stdout.write(f"{FIGURE.relative_to(ROOT)} written\n")
