"""Every command with what it cannot take: exit code 2, one message, and nothing done before it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from command import call

CASE = '[kernel]\nname = "constant"\n[run]\ntimes = [1.0]\nparticles = 20\nreplicas = 2\nseed = 1\n'
FILES = {
    "no.toml": None,
    "folder": None,
    "binary.toml": bytes(range(256)),
    "empty.toml": b"",
    "key.toml": CASE.replace("particles", "particle").encode(),
    "bad.toml": b"[kernel\nname =",
}
#: what each command needs beside its file
CASES = {
    "check": (), "run": (), "compare": (), "efficiency": (),
    "sweep": ("--over", "kernel.scale=1,2"),
}  # fmt: skip
#: where the name of the file does not stand: the folder is meant to hold a run
RESULTS = ("show", "plot", "movie")
SETS = (
    "run.particle=5", "run.particles=abc", "run.particles=", "=5", "run.particles", "run=5",
    "kernel.name=constnat", "run.times=-1", "kernel.scale=nan", "no.such.key=1",
)  # fmt: skip


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("case.toml").write_text(CASE)
    for name, content in FILES.items():
        if content is not None:
            Path(name).write_bytes(content)
    return tmp_path


def refused(*arguments: str) -> str:
    """Call a command that is to fail before it does anything, and return its message."""
    before = sorted(os.listdir())
    found = call(*arguments, code=2)
    assert found.stdout == ""
    assert found.stderr.strip()
    assert "internal error" not in found.stderr
    assert "Traceback" not in found.stderr
    assert sorted(os.listdir()) == before
    return found.stderr


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("command", CASES)
def test_no_case(command: str, name: str) -> None:
    message = refused(command, name, *CASES[command])
    assert name in message or "key" in message


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("command", RESULTS)
def test_no_result(command: str, name: str) -> None:
    assert name in refused(command, name)


@pytest.mark.parametrize("change", SETS)
@pytest.mark.parametrize("command", CASES)
def test_wrong_changes(command: str, change: str) -> None:
    refused(command, "case.toml", *CASES[command], "--set", change)


@pytest.mark.parametrize("command", [*CASES, *RESULTS, "kernels", "verify", "demo", "new"])
def test_an_unknown_option(command: str) -> None:
    assert "No such option: --nothing" in refused(command, "--nothing")


@pytest.mark.parametrize(
    "arguments",
    [
        ("new", "x", "--template", "nothing"),
        ("new", "no/folder/x"),
        ("new", "case.toml"),
        ("run", "case.toml", "-o", "case.toml"),
        ("run", "case.toml", "-o", "case.toml/x"),
        ("sweep", "case.toml", "--over", "run.particles"),
        ("sweep", "case.toml", "--over", "run.particle=1,2"),
        ("sweep", "case.toml", "--over", "run.particles=10,abc"),
        ("sweep", "case.toml", "--over", "run.particles=1:10:0"),
        ("sweep", "case.toml", "--over", "kernel.name=constant,constnat"),
        ("sweep", "case.toml", "--over", "kernel.scale=1,2", "-o", "case.toml"),
        ("sweep", "case.toml", "--over", "kernel.scale=1,2", "-s", "kernel.scale=3"),
        ("compare", "case.toml", "-m", "nothing"),
        ("efficiency", "case.toml", "-m", "nothing"),
        ("efficiency", "case.toml", "-m", "inverse", "-m", "inverse"),
        ("efficiency", "case.toml", "-w", "nothing"),
        ("efficiency", "case.toml", "-o", "nothing"),
        *(
            (command, "case.toml", "-f", file)
            for command in ("compare", "efficiency")
            for file in ("x.xyz", "no/folder/x.png", "folder")
        ),
        ("kernels", "nothing"),
        ("verify", "-m", "nothing"),
        ("verify", "--seed", "abc"),
        ("demo", "--seed", "-1"),
        ("demo", "-o", "case.toml"),
    ],
    ids=" ".join,
)
def test_wrong_options(arguments: tuple[str, ...]) -> None:
    refused(*arguments)
