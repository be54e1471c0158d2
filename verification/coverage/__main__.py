"""Run this verification: ``python -m verification.coverage``."""

import sys

from ..run import main

raise SystemExit(main(["coverage", *sys.argv[1:]]))
