"""Compare the compiled code of every loop with that of before: same code, same bits and speed.

::

    python tools/assembly.py --write before.json     # in the old checkout
    python tools/assembly.py --compare before.json   # in the new one

The loops are those of the golden trajectories. Their assembly is compared with symbols numbered in
the order in which they appear, so that what only moves or renames a function changes nothing.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "tests" / name) for name in ("", "run", "spatial")]

#: names of functions, of constants and of places in the code
_SYMBOL = re.compile(r"\$?(?:\.L|_Z|\.?const\.|\.?numba\.|_NRT|NRT|cfunc)[\w.$@<>%]*")
#: lines that say where code came from, not what it does
_SAYS_NOTHING = re.compile(
    r"^\s*(?:\.(?:file|loc|ident|cfi_\w+|size|type|section|globl|weak|asciz)\b|#)"
)


def normalised(assembly: str) -> str:
    """Return assembly with its symbols numbered in the order in which they appear."""
    numbers: dict[str, str] = {}

    def number(match: re.Match[str]) -> str:
        return numbers.setdefault(match[0], f"symbol{len(numbers)}")

    lines = (line.split("#", 1)[0].rstrip() for line in assembly.splitlines())
    kept = (line for line in lines if line and not _SAYS_NOTHING.match(line))
    return "\n".join(_SYMBOL.sub(number, line) for line in kept)


def digest(loop: object) -> dict[str, object]:
    """Return the digest of the assembly of a compiled loop, and how many lines it has."""
    (assembly,) = loop.inspect_asm().values()  # type: ignore[attr-defined]
    text = normalised(assembly)
    return {"sha256": hashlib.sha256(text.encode()).hexdigest(), "lines": text.count("\n") + 1}


def loops(only: str) -> dict[str, dict[str, object]]:
    """Compile the loop of each golden trajectory that has `only` in its name."""
    import golden

    from smolux.stochastic.replicas import Group

    found = {}
    for case, (*arguments, policy, _) in golden.CASES.items():
        if policy == "doubling" and only in case:  # the policy is data
            group = Group.start(golden.plan(*arguments, policy), 0, 1)
            group.compile()
            found[case] = digest(group.loop)
            print(f"{case}: {found[case]['lines']} lines", flush=True)
    return found


def main() -> int:
    """Write digests, or compare them with those written before."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--write", type=Path, metavar="FILE")
    action.add_argument("--compare", type=Path, metavar="FILE")
    parser.add_argument("--only", default="", metavar="TEXT", help="cases with this in the name")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SMOLUX_CACHE_DIR"] = folder  # code from the disk has no text
        found = loops(given.only)
    if given.write:
        given.write.write_text(json.dumps(found, indent=1) + "\n")
        return 0
    before = json.loads(given.compare.read_text())
    changed = [case for case in found if found[case] != before.get(case)]
    for case in changed:
        print(f"changed: {case}: {before.get(case)} before, {found[case]} now")
    print(f"{len(found) - len(changed)} of {len(found)} loops are the same")
    return 1 if changed else 0


if __name__ == "__main__":
    raise SystemExit(main())
