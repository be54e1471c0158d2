"""The command line: thin, one file for each command.

Nothing heavy is imported before a command runs, so that ``smolux --help`` answers at once.
"""


def main() -> None:
    """Run the command line; see ``smolux --help``."""
    from .app import app

    app(prog_name="smolux")
