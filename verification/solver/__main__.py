"""Run this verification: ``python -m verification.solver``."""

import sys

from ..run import main

raise SystemExit(main(["solver", *sys.argv[1:]]))
