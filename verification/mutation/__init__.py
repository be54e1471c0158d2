"""Mistakes put into the code on purpose, one at a time, to see which tests fail."""

from verification.suite import Suite

from .area import item, total
from .mistakes import areas

SUITE = Suite(
    name="mutation",
    title="Mistakes that the tests see",
    paper="the test suite itself: a suite that sees a wrong program fail is worth something.",
    items=tuple(item(area) for area in areas()),
    total=total,
    remarks=(
        "Each mistake changes a few characters of a copy of the code, such that a number comes "
        "out wrong or something is lost: a clock that forgets a wait, a bound one size short, a "
        "factor of two. The tests that should see it run on that copy, up to the first that fails.",
        "The same tests pass on an unchanged copy. If they pass on the changed one, too, the "
        "mistake is not seen. A test that does not end, and an interpreter that crashes, are seen.",
        "With `SMOLUX_CACHE_DIR` set, what was tried is kept there: with the same code, the same "
        "tests and the same mistake it is not tried again, and the processor time is without it.",
        "The mistakes are in `verification/mutation/mistakes`. A new one is an entry there.",
    ),
)
