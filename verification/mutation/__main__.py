"""Run this verification: ``python -m verification.mutation``."""

import sys

from verification.run import main

raise SystemExit(main(["mutation", *sys.argv[1:]]))
