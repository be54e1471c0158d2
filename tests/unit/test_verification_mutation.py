"""The machinery that puts mistakes into the code; the mistakes themselves are tried elsewhere."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from verification.mutation import area as trials  # noqa: E402
from verification.mutation.mistakes import PACKAGE, Mistake, areas, read  # noqa: E402
from verification.mutation.trial import BrokenTrialError, Copy  # noqa: E402

MISTAKES = [(area, mistake) for area in areas() for mistake in read(area)]
#: a package of one function, and its test
CODE = "def twice(x):\n    return 2 * x\n"
TEST = "from smolux.numbers import twice\n\n\ndef test_twice():\n    assert twice(3) == 6\n"


@pytest.mark.parametrize(
    "mistake", [m for _, m in MISTAKES], ids=[f"{m.file}: {m.what}" for _, m in MISTAKES]
)
def test_each_mistake_can_be_made_and_names_its_tests(mistake):
    wrong = mistake.made((ROOT / PACKAGE / mistake.file).read_text())
    ast.parse(wrong)
    assert mistake.tests
    for test in (*mistake.tests, *mistake.slow):
        file, *names = test.split("[")[0].split("::")
        source = (ROOT / file).read_text()
        for name in names:
            assert f"def {name}(" in source or f"class {name}" in source, test


def test_no_mistake_is_made_twice():
    made = [(m.file, m.old, m.new) for _, m in MISTAKES]
    assert len(made) == len(set(made))


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    tmp_path = tmp_path_factory.mktemp("mutation")
    checkout = tmp_path / "checkout"
    for name, text in {"src/smolux/__init__.py": "", "src/smolux/numbers.py": CODE,
                       "tests/test_numbers.py": TEST, "pyproject.toml": ""}.items():  # fmt: skip
        (checkout / name).parent.mkdir(parents=True, exist_ok=True)
        (checkout / name).write_text(text)
    with Copy.of(checkout, tmp_path / "copy", tmp_path / "compiled") as made:
        yield made


def of_twice(old: str, new: str) -> Mistake:
    return Mistake("two is something else", "numbers.py", old, new, ("tests/test_numbers.py",))


def test_a_mistake_is_seen_and_taken_back(copy):
    seen = trials.tried(copy, of_twice("2 *", "3 *"))
    assert (seen["suite"], seen["by"]) == ("fast", "tests/test_numbers.py::test_twice")
    unseen = trials.tried(copy, of_twice("2 * x", "x + x"))
    assert (unseen["suite"], unseen["by"]) == ("none", "")
    trials.pass_unchanged(copy, (("tests/test_numbers.py",), False))


@pytest.mark.parametrize("mistake", [of_twice("4 *", "3 *"), of_twice("x", "y"),
                                     of_twice("2 *", "2 *")])  # fmt: skip
def test_what_cannot_be_made_is_refused(copy, mistake):
    with pytest.raises(ValueError, match=r"numbers\.py"):
        trials.tried(copy, mistake)


def test_tests_that_say_nothing_are_no_success(copy):
    with pytest.raises(BrokenTrialError):
        copy.failing(["tests/test_numbers.py"], slow=True)
    with copy.mistaken(of_twice("2 *", "3 *")) as wrong:  # noqa: SIM117
        with pytest.raises(BrokenTrialError, match="fails without a mistake"):
            trials.pass_unchanged(wrong, (("tests/test_numbers.py",), False))


def test_all_areas_are_counted_together():
    areas_ = {
        "one": {"mistakes": [{"suite": "fast"}] * 18 + [{"suite": "none"}]},
        "two": {"mistakes": [{"suite": "slow"}]},
    }
    said = trials.total(areas_)
    assert "Of 20 mistakes" in said
    assert "see 18 (90.0%), slow ones 1 more, and none sees 1." in said
