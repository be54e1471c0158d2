"""The command line, called in process."""

from __future__ import annotations

from typer.testing import CliRunner

from smolux.cli.app import app


def call(*arguments: str, code: int = 0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, (result.stdout, result.stderr, result.exception)
    return result
