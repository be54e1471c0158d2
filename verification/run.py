"""Run a verification: ``python verification/run.py kalinov_2021 [--item NAME] [--quick]``."""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

#: one package a paper or a promise, each with a ``SUITE``
SUITES = ("kalinov_2021", "degond_2024", "kolodko_sabelfeld_2003", "solver", "coverage", "mutation")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="verification/run.py", description=__doc__)
    parser.add_argument("suite", choices=SUITES)
    parser.add_argument("--item", action="append", default=[], help="one item; may be repeated")
    parser.add_argument("--quick", action="store_true", help="a smoke test, below two minutes")
    parser.add_argument("--redraw", action="store_true", help="pages from the stored data")
    parser.add_argument("--output", type=Path, help="folder of the pages")
    given = parser.parse_args(arguments)
    from verification.suite import run_suite

    suite = importlib.import_module(f"verification.{given.suite}").SUITE
    passed = run_suite(
        suite, given.item, quick=given.quick, redraw=given.redraw, output=given.output
    )
    return 0 if passed else 1


if __name__ == "__main__":
    raise SystemExit(main())
