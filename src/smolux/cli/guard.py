"""What a command that fails leaves behind: an exit code and a message, never a bare traceback."""

from __future__ import annotations

import os
import sys
import tempfile
import traceback
import warnings
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from smolux.errors import InputError, Interrupted

OURS, YOURS, RESUMABLE = 1, 2, 3
#: as the shell has it for a program that Ctrl-C ended
_CTRL_C = 130


class Guarded(TyperGroup):
    """The commands, with the exit codes of smolux."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command and turn what it raises into an exit code."""
        try:
            with warnings.catch_warnings():
                warnings.showwarning = _warn  # type: ignore[assignment]
                return super().invoke(ctx)
        except InputError as error:
            _say(*(f"error: {problem}" for problem in error.problems))
            raise typer.Exit(YOURS) from None
        except Interrupted as stop:
            _say(str(stop))
            raise typer.Exit(RESUMABLE) from None
        except KeyboardInterrupt:
            _say("stopped")
            raise typer.Exit(_CTRL_C) from None
        except BrokenPipeError:
            # whoever read our output has gone (smolux kernels | head); stay quiet at exit too
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(0) from None
        except MemoryError as error:
            _say(
                f"error: out of memory{f': {error}' if str(error) else ''}; use fewer particles, "
                "replicas, sizes or output times, or allow this process more memory"
            )
            raise typer.Exit(YOURS) from None
        except OSError as error:
            if error.filename is None and error.errno is None:
                raise _bug(ctx) from None
            # a full disk, a folder without permission: nothing that a report would help with
            _say(f"error: {error.strerror or error}{_named(error)}")
            raise typer.Exit(YOURS) from None
        except Exception as error:
            if type(error).__module__.startswith(("typer", "click")):
                raise  # usage mistakes and exits are the framework's
            raise _bug(ctx) from None


def _warn(message: Warning | str, *_: Any) -> None:
    """Tell a warning without the place in the code, which says nothing to a user."""
    _say(f"warning: {message}")


def _named(error: OSError) -> str:
    return f": {error.filename!r}" if error.filename is not None else ""


def _say(*lines: str) -> None:
    for line in lines:
        typer.echo(line, err=True)


def _bug(ctx: Any) -> typer.Exit:
    """Report a bug of ours: keep the traceback in a file, or show it with --debug."""
    error = sys.exc_info()[1]
    details = traceback.format_exc()
    if (getattr(ctx, "obj", None) or {}).get("debug"):
        _say(details)
    else:
        handle, name = tempfile.mkstemp(prefix="smolux-traceback-", suffix=".txt", text=True)
        with os.fdopen(handle, "w") as file:
            file.write(f"{' '.join(sys.argv)}\n\n{details}")
        _say(
            f"internal error: {type(error).__name__}: {error}",
            f"This is a bug in smolux. Please report it with the file {Path(name)}",
            "(smolux --debug ... shows the traceback here).",
        )
    return typer.Exit(OURS)
