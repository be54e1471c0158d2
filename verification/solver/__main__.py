"""Run this verification: ``python -m verification.solver``."""

import sys

from verification.run import main

raise SystemExit(main(["solver", *sys.argv[1:]]))
