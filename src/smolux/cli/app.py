"""The commands, put together: each is loaded when it is used."""

from __future__ import annotations

from importlib import import_module
from typing import Annotated, Any

import typer

from .guard import Guarded

#: each is the function of that name in the module of that name in `smolux.cli.commands`
COMMANDS = {
    "demo": "Simulate a case whose exact solution is known.",
    "new": "Write a commented case file from a template.",
    "check": "Check a case: mistakes, gelation, memory; what it will cost.",
    "run": "Run a case: results, figures and a report in a folder.",
    "sweep": "Run a case at every point of a grid; all results in one file.",
    "show": "Show the summary of a result.",
    "plot": "Draw figures of a result.",
    "movie": "Make a movie of a run in space.",
    "compare": "Run a case by every method and the solver.",
    "efficiency": "Measure bias, variance, cost and efficiency.",
    "kernels": "List the collision kernels, or show one.",
    "verify": "Test every method against the exact laws.",
}


class Commands(Guarded):
    """The commands of the table, of which the one that is called takes the place of its entry."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Load the command that is called."""
        if args and args[0] in COMMANDS:
            self.commands[args[0]] = _loaded(args[0])
        return super().resolve_command(ctx, args)


def _loaded(name: str) -> Any:
    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    alone.command(name)(getattr(import_module(f"smolux.cli.commands.{name}"), name))
    return typer.main.get_command(alone)


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


def _entry() -> None:
    """Stand for a command in the list of all."""


for _name, _summary in COMMANDS.items():
    app.command(_name, help=_summary)(_entry)
