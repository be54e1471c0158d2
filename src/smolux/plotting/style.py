"""What all figures share: sizes, fonts, colours, axes, legends, files."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import AutoMinorLocator, Formatter, LogLocator, NullFormatter

from smolux.errors import InputError
from smolux.runtime.files import destination, replacing

P = ParamSpec("P")
T = TypeVar("T")

#: widths of one and of two journal columns, in inches (86 and 178 mm)
WIDTH = {"single": 86 / 25.4, "double": 178 / 25.4}
Width = Literal["single", "double"]

#: colours that the colour-blind can tell apart (M. Okabe and K. Ito, 2008), dark ones first
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
GREY = "#555555"

#: values from ten to this power on are given in units of a power of ten
_POWER = 4
#: how a dimensionless quantity says so
_NO_UNIT = (None, "", "1", 1)

_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.2,
    "legend.handletextpad": 0.5,
    "axes.linewidth": 0.6,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,  # it would stand where the legend does
    "lines.linewidth": 1.0,
    "lines.markersize": 3.2,
    "lines.markeredgewidth": 0.7,
    "errorbar.capsize": 0,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.minor.visible": True,
    "ytick.minor.visible": True,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "xtick.minor.size": 1.6,
    "ytick.minor.size": 1.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
}


def styled(function: Callable[P, T]) -> Callable[P, T]:
    """Draw with the style of the package, leaving the user's own settings alone."""

    @wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> T:
        with mpl.rc_context(_STYLE):
            return function(*args, **kwargs)

    return wrapper


def new_figure(width: Width, aspect: float) -> Figure:
    """Make an empty figure of a column width; `aspect` is height over width of the figure.

    It belongs to no window and no backend, so it works without a display.
    """
    if width not in WIDTH:
        raise InputError(f"width = {width!r}: must be 'single' (86 mm) or 'double' (178 mm)")
    inches = WIDTH[width]
    return Figure(figsize=(inches, inches * aspect), layout="constrained")


def axes_of(ax: Axes | None, width: Width, aspect: float = 0.8) -> Axes:
    """Return the axes given, or new ones in a figure of their own, flatter if it is wide."""
    if ax is not None:
        return ax
    return new_figure(width, aspect if width == "single" else 0.6 * aspect).subplots()


def time_label(time: float, units: object = None) -> str:
    """Label of one output time, with its unit if it has one."""
    digits, _, power = f"{time:.4g}".partition("e")
    if power:
        ten = f"10^{{{int(power)}}}"
        digits = ten if digits == "1" else rf"{digits} \times {ten}"
    label = f"$t = {digits}$"
    return label if units in _NO_UNIT else f"{label} {unit_text(units)}"


def unit_text(units: object) -> str:
    """Write a unit as it is printed: its powers raised, ``m-3`` as ``m$^{-3}$``."""
    return re.sub(r"(?<=[A-Za-zµμ])(?:\^|\*\*)?(-?\d+)", r"$^{\1}$", str(units))


def quantity(text: str, units: object) -> str:
    """Label an axis with a quantity and its unit; a dimensionless quantity has none."""
    return text if units in _NO_UNIT else f"{text} ({unit_text(units)})"


class _Scaled(Formatter):
    """Tick labels in units of a power of ten, which the label of the axis has."""

    def __init__(self, power: int) -> None:
        self.power = power
        self.digits = 0

    def set_locs(self, locs: Any) -> None:
        """Find with how many decimals all ticks can be told apart."""
        ticks = np.asarray(locs, float) / 10.0**self.power
        fits = (d for d in range(12) if np.allclose(ticks, ticks.round(d), rtol=0, atol=1e-12))
        self.digits = next(fits, 12)

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Write a tick."""
        return f"{x / 10.0**self.power:.{self.digits}f}".replace("-", "\N{MINUS SIGN}")


def label_axis(ax: Axes, which: Literal["x", "y"], text: str, units: object = None) -> None:
    """Label an axis in which all has been drawn; its power of ten, if it needs one, comes along.

    Matplotlib would write the power above the axes, where the legend is.
    """
    axis = ax.xaxis if which == "x" else ax.yaxis
    largest = float(np.max(np.abs(axis.get_view_interval())))
    power = 0
    if axis.get_scale() == "linear" and np.isfinite(largest) and largest > 0:
        power = int(np.floor(np.log10(largest)))
    if abs(power) < _POWER:
        axis.set_label_text(quantity(text, units))
        return
    axis.set_major_formatter(_Scaled(power))
    unit = "" if units in _NO_UNIT else f" {unit_text(units)}"
    axis.set_label_text(f"{text} ($10^{{{power}}}${unit})")


def prefers_log(values: np.ndarray, ratio: float = 30.0) -> bool:
    """Whether positive values are spread so widely that a linear axis would hide most of them."""
    positive = values[np.isfinite(values) & (values > 0)]
    if positive.size < 2:
        return False
    crowded = float(np.median(positive)) < 0.3 * float(positive.max())
    return bool(positive.max() > ratio * positive.min()) and crowded


def use_log(ax: Axes, which: Literal["x", "y"]) -> None:
    """Set a logarithmic axis with ticks at every decade and unlabelled ones between."""
    getattr(ax, f"set_{which}scale")("log", nonpositive="clip")
    axis = ax.xaxis if which == "x" else ax.yaxis
    axis.set_major_locator(LogLocator(numticks=8))
    axis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=99))
    axis.set_minor_formatter(NullFormatter())


def use_linear(ax: Axes, which: Literal["x", "y"]) -> None:
    """Set minor ticks on a linear axis."""
    (ax.xaxis if which == "x" else ax.yaxis).set_minor_locator(AutoMinorLocator())


def _columns(labels: Sequence[str], points: float, size: float) -> int:
    """Columns of a legend that fit into a width in points, for labels of a font size."""
    # a formula without its signs is about as long as it looks
    plain = [re.sub(r"[\\${}_^]", "", text) for text in labels]
    for columns in range(len(labels), 1, -1):
        longest = [max(map(len, part)) for part in np.array_split(plain, columns)]
        if sum(3.5 * size + 0.58 * size * length for length in longest) <= points:
            rows = -(-len(labels) // columns)
            return -(-len(labels) // rows)
    return 1


def legend_above(ax: Axes, handles: Sequence[Artist], *, spans: bool = False) -> None:
    """Put a legend above the axes, or above the whole figure: it covers no data there."""
    labels = [str(h.get_label()) for h in handles]
    if not labels:
        return
    figure, grid = root_of(ax), ax.get_subplotspec()
    alone = spans or (grid is not None and grid.get_geometry()[1] == 1)
    inches = figure.get_figwidth() * (0.86 if alone else ax.get_position().width)
    columns = _columns(labels, 72 * inches, float(mpl.rcParams["legend.fontsize"]))
    if spans:
        figure.legend(handles=list(handles), loc="outside upper left", ncols=columns)
        return
    ax.legend(
        handles=list(handles),
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.3,
        ncols=columns,
    )


def root_of(drawn: Figure | Axes) -> Figure:
    """Return the figure that all is drawn in."""
    figure = drawn.get_figure(root=True)
    assert figure is not None  # axes that are drawn in belong to a figure
    return figure


#: no dates and no version, which would make equal figures differ
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    "svg": {"Date": None, "Creator": None},
}


def kind_of(path: str | os.PathLike[str]) -> str:
    """Return which kind of file a figure is to be, before anything is computed for it.

    Raises
    ------
    InputError
        If it is none, or cannot be written there.
    """
    kind = Path(path).suffix.lower().lstrip(".")
    if kind not in _METADATA:
        raise InputError(f"path = {os.fspath(path)!r}: must end in .png, .pdf or .svg")
    destination(path)
    return kind


def save(figure: Figure | Axes, path: str | os.PathLike[str], *, dpi: int = 300) -> Path:
    """Write a figure, whole or not at all; the same figure gives the same bytes.

    Parameters
    ----------
    figure : matplotlib.figure.Figure or matplotlib.axes.Axes
    path : str or path
        Ends in .png, .pdf or .svg; replaced if it exists.
    dpi : int
        Dots per inch of a PNG.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    InputError
        If the suffix is another one, or the folder does not exist.
    OSError
        If it cannot be written; an old file stays as it was.
    """
    root, kind = root_of(figure), kind_of(path)
    settings = {"svg.hashsalt": "smolux", "svg.fonttype": "path", "pdf.fonttype": 42}
    with mpl.rc_context(settings), replacing(path) as temporary:
        root.savefig(temporary, format=kind, dpi=dpi, metadata=_METADATA[kind])
    return Path(path)
