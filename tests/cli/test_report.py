from __future__ import annotations

import base64
import re
from html.parser import HTMLParser

import pytest

import smolux
from smolux.case import parse
from smolux.case.settings import FIGURES
from smolux.cli import figures, report

CASE = """\
title = "Tom & <Jerry>"
[kernel]
name = "constant"
[run]
times = [1, 2]
particles = 300
replicas = 4
seed = 5
sizes = 16
method = "acceptance-rejection"
"""


class Page(HTMLParser):
    """Checks that every element is closed, and keeps links and texts."""

    VOID = ("meta", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)
        self.sources += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    case = parse(CASE)
    ds = smolux.simulate(
        case.model, [1, 2], particles=300, replicas=4, seed=5, sizes=16,
        method="acceptance-rejection",
    )  # fmt: skip
    ds.attrs["warnings"] = '["mind the <gap>"]'
    files, remarks = figures.write(("clusters",), ds, folder)
    assert remarks == []
    return case, ds, files


def test_the_page_is_whole_and_needs_nothing_else(made):
    case, ds, files = made
    solution = smolux.solve(case.model, [1, 2], tolerance=1e-6, sizes=16)
    text = report.page(case, ds, solution, files)
    page = Page()
    page.feed(text)
    assert page.open == []
    assert len(page.sources) == 1
    kind, _, data = page.sources[0].partition(",")
    assert kind == "data:image/png;base64"
    assert base64.b64decode(data) == files[0].read_bytes()
    assert not re.search(r"(https?:)?//[a-z]", text.replace(data, ""))
    words = " ".join(page.texts)
    for part in (
        "Tom & <Jerry>", "mind the <gap>", "seed 5", "300 particles", 'name = "constant"',
        "agrees with the solution", "smolux " + smolux.__version__, "numba",
    ):  # fmt: skip
        assert part in words


def test_the_numbers_are_those_of_the_summary(made):
    case, ds, _ = made
    rows = smolux.analysis.tables(smolux.summary(ds), ["number_density"])[0][1]
    text = report.page(case, ds)
    for cell in rows[1]:
        assert f"<td>{cell}</td>" in text


def test_every_kind_of_figure_in_case_files_can_be_drawn():
    for name in FIGURES:
        assert callable(getattr(smolux.plotting, name.replace("-", "_")))


def test_a_figure_that_cannot_be_drawn_is_a_remark(made, tmp_path, monkeypatch):
    def nothing(*_: object, **__: object) -> None:
        raise smolux.InputError("no cycle")

    monkeypatch.setattr(smolux.plotting, "oscillations", nothing)
    files, remarks = figures.write(("oscillations", "moments"), made[1], tmp_path)
    assert [f.name for f in files] == ["moments.png"]
    assert remarks == ["no figure 'oscillations': no cycle"]
