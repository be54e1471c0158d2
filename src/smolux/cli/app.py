"""The commands, put together."""

from __future__ import annotations

from typing import Annotated

import typer

from . import check, compare, demo, efficiency, kernels, movie, new, plot, run, show, sweep, verify
from .guard import Commands

app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=(
        "Exit codes: 0 fine, 2 a mistake in what was given, 3 stopped but resumable, 1 our bug. "
        "Start with: smolux demo"
    ),
)


def _version(wanted: bool) -> None:
    if wanted:
        from smolux import __version__

        typer.echo(f"smolux {__version__}")
        raise typer.Exit


@app.callback()
def smolux(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Show the version."),
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show the whole traceback of an error.")
    ] = False,
) -> None:
    """Kinetics of aggregation and fragmentation: simulate, solve, and see how sure it is."""
    context.obj = {"debug": debug}


app.command()(demo.demo)
app.command()(new.new)
app.command()(check.check)
app.command()(run.run)
app.command()(sweep.sweep)
app.command()(show.show)
app.command()(plot.plot)
app.command()(movie.movie)
app.command()(compare.compare)
app.command()(efficiency.efficiency)
app.command()(kernels.kernels)
app.command()(verify.verify)
