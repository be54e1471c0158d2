"""Run this verification: ``python -m verification.kalinov_2021``."""

import sys

from verification.run import main

raise SystemExit(main(["kalinov_2021", *sys.argv[1:]]))
