from __future__ import annotations

import textwrap

import pytest

from smolux.case.lines import get, line_numbers, lookup

TEXT = textwrap.dedent(
    '''\
    title = "a # is no comment [here]"   # 1

    [kernel]
    name = "x" # [run]
    "quoted key" = 1
    nested.deep = 2
    long = """
    [run]
    times = 3 \\"""
    """
    literal = \'\'\'
    [no] \'\'\'\'

    [[processes]]
    name = "a"
    [[processes]] # second
    name = 'b'
    rate = [
      1, [2,
      3],
      # between
      { in = 4, out.put = "}" },

    ]
    [processes.inner]
    key = 2020-01-01
    [ run . more ]
    times = 1e5
    '''
)


def find(path: tuple[str | int, ...]) -> int:
    """The line of a key, found by hand."""
    return line_numbers(TEXT)[path]


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("title",), 1),
        (("kernel",), 3),
        (("kernel", "name"), 4),
        (("kernel", "quoted key"), 5),
        (("kernel", "nested", "deep"), 6),
        (("kernel", "long"), 7),
        (("kernel", "literal"), 11),
        (("processes",), 14),
        (("processes", 0), 14),
        (("processes", 0, "name"), 15),
        (("processes", 1), 16),
        (("processes", 1, "rate"), 18),
        (("processes", 1, "rate", 0), 19),
        (("processes", 1, "rate", 1), 19),
        (("processes", 1, "rate", 1, 1), 20),
        (("processes", 1, "rate", 2, "in"), 22),
        (("processes", 1, "rate", 2, "out", "put"), 22),
        (("processes", 1, "inner", "key"), 26),
        (("run",), 27),
        (("run", "more", "times"), 28),
    ],
)
def test_every_key_has_its_line(path, line):
    assert find(path) == line


def test_every_path_exists_in_the_parsed_text():
    import tomllib

    content = tomllib.loads(TEXT)
    lines = line_numbers(TEXT)
    for path in lines:
        get(content, path)
    assert len(lines) > 25


def test_carriage_returns_do_not_count_twice():
    assert line_numbers("a = 1\r\nb = 2\r\n") == {("a",): 1, ("b",): 2}


def test_a_missing_key_stands_where_its_table_does():
    lines = line_numbers("[run]\nx = 1\n")
    assert lookup(lines, ("run", "times")) == 1
    assert lookup(lines, ("kernel",)) is None
