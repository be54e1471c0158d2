"""Movies of discs that fly and stick: GIF, or MP4 with the extra ``movie``."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from smolux.errors import InputError
from smolux.runtime.files import replacing
from smolux.spatial.results.result import system_of
from smolux.spatial.results.trajectory import instants_of, states

from .spatial import birth_colours, birth_norm, cluster_colours, fill
from .style import styled

_DPI = 100


@styled
def movie(
    result: xr.DataTree,
    path: str | os.PathLike[str],
    times: ArrayLike | None = None,
    *,
    frames: int = 120,
    rate: float = 20.0,
    pixels: int = 480,
    colour: str = "first_contact",
    progress: Callable[[int], None] | None = None,
) -> Path:
    """Write a movie of a spatial run.

    Parameters
    ----------
    result : xarray.DataTree
        Of `smolux.spatial.simulate`, by a method that is exact.
    path : str or path
        Ends in .gif, or in .mp4, which needs the extra ``movie``.
    times : array_like of shape (T,), optional
        The instant of each frame, ascending. If left out they are spaced so that each frame shows
        about as many merges: evenly in time at the start, more slowly later.
    frames : int
        How many, if no times are given.
    rate : float
        Frames a second.
    pixels : int
        Width; even.
    colour : {"first_contact", "cluster"}
        As for `discs`.
    progress : callable, optional
        Called with the number of frames done.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    InputError
        If the suffix is another one, an argument is wrong, or a package is missing.
    """
    suffix = Path(path).suffix.lower()
    problems = [] if suffix in (".gif", ".mp4") else [f"path = {os.fspath(path)!r}: must end in "
                                                      ".gif or .mp4"]  # fmt: skip
    if not (isinstance(rate, (int, float)) and 0 < rate <= 100):
        problems.append(f"rate = {rate!r}: must be a number of frames a second, up to 100")
    if not (isinstance(pixels, int) and pixels >= 64 and pixels % 2 == 0):
        problems.append(f"pixels = {pixels!r}: must be an even number, 64 or more")
    if colour not in ("first_contact", "cluster"):
        problems.append(f"colour = {colour!r}: must be 'first_contact' or 'cluster'")
    if problems:
        raise InputError(problems)
    instants = instants_of(result, times, frames)
    if times is None:
        instants = _spaced(result, frames)
    pictures = _pictures(result, instants, pixels, colour, progress)
    write = _write_gif if suffix == ".gif" else _encoder()
    with replacing(path) as temporary:
        write(temporary, pictures, rate)
    return Path(path)


def _spaced(result: xr.DataTree, frames: int) -> Any:
    """Instants between which about equal shares of ln n and of the time go by."""
    end = float(result.attrs["time_reached"])
    merges = result["events"].to_dataset()["time"].values
    if not len(merges) or not end > 0:
        return np.linspace(0.0, end, frames)
    fine = np.concatenate([np.linspace(0, merges[0], 50), merges, [end]])
    left = result.sizes["disc"] - np.searchsorted(merges, fine, side="right")
    decay = np.log(result.sizes["disc"] / np.maximum(left, 1))
    share = decay / max(decay[-1], 1e-12) + 0.3 * fine / end
    even = np.linspace(0, share[-1], frames)
    return np.maximum.accumulate(np.minimum(np.interp(even, share, fine), end))


def _pictures(
    result: xr.DataTree, instants: Any, pixels: int, colour: str, progress: Any
) -> Iterator[Any]:
    """Draw frame after frame, each an array of shape (height, width, 3) of bytes."""
    system, born = system_of(result), result["first_contact"].values
    norm = birth_norm(born)
    sides = system.box.lengths
    height = 2 * round(0.5 * pixels * (0.94 * sides[1] / sides[0] + 0.06))
    figure = Figure(figsize=(pixels / _DPI, height / _DPI), dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.03, 0.01, 0.94, 1 - 0.05 * pixels / height - 0.01))
    for k, (time, x, _, cluster) in enumerate(states(result, instants)):
        ax.clear()
        faces = cluster_colours(cluster)
        if colour == "first_contact":
            faces = birth_colours(born, time, norm)
        fill(ax, system, x, faces)
        number = len(np.unique(cluster))
        clusters = f"{number} cluster{'s' if number > 1 else ''}"
        ax.set_title(f"$t$ = {time:.3g},  {clusters}", loc="left", pad=3)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()
        if progress is not None:
            progress(k + 1)


def _write_gif(file: Path, pictures: Iterator[Any], rate: float) -> None:
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    # one palette, of the last frame, which has all colours: none of the frames flickers
    palette = images[-1].quantize(128, dither=Image.Dither.NONE)
    flat = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    wait = [round(1000 / rate)] * (len(flat) - 1) + [2000]
    flat[0].save(
        file, "GIF", save_all=True, append_images=flat[1:], duration=wait, loop=0, optimize=False
    )


def _encoder() -> Callable[[Path, Iterator[Any], float], None]:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise InputError(
            'path: an .mp4 file needs imageio-ffmpeg: pip install "smolux[movie]"; '
            "or write a .gif file, which needs nothing"
        ) from None

    def write(file: Path, pictures: Iterator[Any], rate: float) -> None:
        first = next(pictures)
        size = first.shape[1], first.shape[0]
        sink = imageio_ffmpeg.write_frames(str(file), size, fps=rate, macro_block_size=2)
        sink.send(None)
        sink.send(first.tobytes())
        for picture in pictures:
            sink.send(picture.tobytes())
        sink.close()

    return write
