"""Run this verification: ``python -m verification.degond_2024``."""

import sys

from verification.run import main

raise SystemExit(main(["degond_2024", *sys.argv[1:]]))
