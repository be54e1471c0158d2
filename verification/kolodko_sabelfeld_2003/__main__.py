"""Run this verification: ``python -m verification.kolodko_sabelfeld_2003``."""

import sys

from verification.run import main

raise SystemExit(main(["kolodko_sabelfeld_2003", *sys.argv[1:]]))
