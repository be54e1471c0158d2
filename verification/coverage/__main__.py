"""Run this verification: ``python -m verification.coverage``."""

import sys

from verification.run import main

raise SystemExit(main(["coverage", *sys.argv[1:]]))
