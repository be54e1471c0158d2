"""Result files: the same bits back, whole or not at all."""

import csv
import errno
import json
import os
import stat
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import synthetic
import xarray as xr

import smolux as sx
from smolux import results
from smolux.runtime import files


@pytest.fixture
def ds():
    return synthetic.constant_dataset(replicas=3, particles=300, distribution=True)


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def test_round_trip_is_bit_for_bit(ds, tmp_path):
    ds["n"][0, 0, 0] = -0.0
    ds["moment"][1, 2, 3] = np.nextafter(1.0, 2.0)
    ds["number_density"][2, 4:] = np.nan
    ds["n_bin"][0, 1, 0] = 5e-324
    ds.attrs["seed"] = str(2**127)
    path = results.save(ds, tmp_path / "results.nc")
    back = results.load(path)
    xr.testing.assert_identical(back, ds)
    for name in ds.variables:
        assert back[name].dtype == ds[name].dtype, name
        assert back[name].values.tobytes() == ds[name].values.tobytes(), name
    assert all(type(back.attrs[k]) is type(v) for k, v in ds.attrs.items())
    assert names(tmp_path) == ["results.nc"]


ODD = {
    "flag": True,
    "nothing": None,
    "table": {"a": [1, None], "b": np.arange(2)},
    "keys": {(1, 2): 3},
    "array": np.array([0.5, 2.0]),
    "matrix": np.eye(2),
    "huge": 2**70,
    "duration": np.timedelta64(3, "s"),
    "bytes": "a\0b",
    7: "a key that is a number",
}
WRITTEN = {
    "flag": 1,
    "nothing": "null",
    "table": '{"a": [1, null], "b": [0, 1]}',
    "keys": '"{(1, 2): 3}"',
    "matrix": "[[1.0, 0.0], [0.0, 1.0]]",
    "huge": str(2**70),
    "duration": '"3 seconds"',
    "bytes": json.dumps("a\0b"),
    "7": "a key that is a number",
}


def test_any_attribute_is_written_wherever_it_is(ds, tmp_path):
    for holder in (ds, ds["n"], ds["size"]):
        holder.attrs |= ODD
    back = results.load(results.save(ds, tmp_path / "results.nc"))
    for holder in (back, back["n"], back["size"]):
        assert {k: v for k, v in holder.attrs.items() if k in WRITTEN} == WRITTEN
        np.testing.assert_array_equal(holder.attrs["array"], [0.5, 2.0])
    np.testing.assert_array_equal(back["n"], ds["n"])
    assert ds["n"].attrs["flag"] is True, "what is saved stays as it is"


def test_any_attribute_of_a_group_is_written(ds, tmp_path):
    tree = xr.DataTree.from_dict({"/": ds.assign_attrs(kind="spatial"), "/group": ds.copy()})
    for holder in (tree, tree["group"], tree["group"].dataset["n"]):
        holder.attrs |= ODD
    tree["group"]["n"].attrs |= ODD
    back = results.load(results.save(tree, tmp_path / "results.nc"))
    for holder in (back, back["group"], back["group"]["n"]):
        assert {k: v for k, v in holder.attrs.items() if k in WRITTEN} == WRITTEN


def test_second_round_trip_and_units_of_time(tmp_path):
    # a time in seconds must stay a number
    records = synthetic.constant_kernel(particles=50, replicas=1, units={"time": "seconds"})
    ds = results.to_dataset(synthetic.model(), records)
    once = results.load(results.save(ds, tmp_path / "a.nc"))
    twice = results.load(results.save(once, tmp_path / "b.nc"))
    xr.testing.assert_identical(twice, ds)
    assert twice["time"].dtype == float


def test_big_arrays_are_compressed(tmp_path):
    ds = synthetic.constant_dataset(times=np.linspace(0, 10, 200))
    path = results.save(ds, tmp_path / "results.nc")
    assert path.stat().st_size < 0.3 * ds.nbytes


def test_summaries_are_kept_too(ds, tmp_path):
    summary = sx.summary(ds)
    xr.testing.assert_identical(results.load(results.save(summary, tmp_path / "s.nc")), summary)


def test_load_says_what_is_wrong(tmp_path):
    with pytest.raises(sx.InputError, match="no such file"):
        results.load(tmp_path / "none.nc")
    with pytest.raises(sx.InputError, match="is a folder"):
        results.load(tmp_path)
    text = tmp_path / "text.nc"
    text.write_text("not netCDF")
    with pytest.raises(sx.InputError, match="cannot be read as netCDF-4"):
        results.load(text)
    other = tmp_path / "other.nc"
    xr.Dataset({"a": 1.0}).to_netcdf(other, engine="h5netcdf")
    with pytest.raises(sx.InputError, match="not one that smolux wrote"):
        results.load(other)


def test_load_of_a_truncated_file(ds, tmp_path):
    path = results.save(ds, tmp_path / "results.nc")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(sx.InputError, match="damaged"):
        results.load(path)


def test_load_of_a_newer_schema(ds, tmp_path):
    ds.attrs["smolux_schema"] = results.SCHEMA + 1
    path = results.save(ds, tmp_path / "results.nc")
    with pytest.raises(sx.InputError, match=r"newer version.*pip install --upgrade smolux"):
        results.load(path)


def test_full_disk_leaves_the_old_file(ds, tmp_path, monkeypatch):
    path = results.save(ds, tmp_path / "results.nc")
    before = path.read_bytes()

    def full(self, data):
        with open(self, "wb") as handle:
            handle.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(
        OSError, match=r"results\.nc.*No space left.*old file is as it was"
    ) as caught:
        results.save(ds.isel(replica=[0]), path)
    assert caught.value.errno == errno.ENOSPC
    assert path.read_bytes() == before
    assert names(tmp_path) == ["results.nc"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit of the file size")
def test_a_real_limit_of_the_file_size_neither_crashes_nor_leaves_a_trace(tmp_path):
    # HDF5 itself would end the process with a segmentation fault
    code = textwrap.dedent(
        """
        import resource, sys
        import numpy as np, xarray as xr
        from smolux import results
        ds = xr.Dataset({"a": ("x", np.random.default_rng(1).random(100_000))})
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))
        for _ in range(2):
            try:
                results.save(ds, sys.argv[1])
            except OSError as error:
                print("refused", error.strerror)
        """
    )
    target = str(tmp_path / "results.nc")
    run = subprocess.run(
        [sys.executable, "-c", code, target], capture_output=True, text=True, check=True
    )
    assert run.stdout.count("refused") == 2
    assert "nothing was written" in run.stdout
    assert names(tmp_path) == []


def test_interruption_leaves_the_old_file(tmp_path):
    path = tmp_path / "state.bin"
    path.write_bytes(b"old")

    def interrupted():
        with files.replacing(path) as temporary:
            temporary.write_bytes(b"half of the ne")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["state.bin"]


def test_what_a_killed_process_left_is_removed(tmp_path, monkeypatch):
    mine, young, other = ".state.01234567.bin", ".state.89abcdef.bin", ".other.01234567.bin"
    for name in (mine, young, other):
        (tmp_path / name).write_bytes(b"half")
    for name in (mine, other):
        os.utime(tmp_path / name, (1e9, 1e9))
    monkeypatch.setattr(files, "_looked_at", set())
    with files.replacing(tmp_path / "state.bin") as temporary:
        temporary.write_bytes(b"new")
    # another process may be writing the young one; the other is of another file
    assert set(names(tmp_path)) == {"state.bin", young, other}


def test_replacing_syncs_before_it_moves(tmp_path, monkeypatch):
    calls = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (calls.append("fsync"), fsync(fd))[1])
    monkeypatch.setattr(os, "replace", lambda a, b: (calls.append("replace"), replace(a, b))[1])
    with files.replacing(tmp_path / "a.txt") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".txt"
        temporary.write_text("new")
    assert calls[:2] == ["fsync", "replace"]
    assert (tmp_path / "a.txt").read_text() == "new"


@pytest.mark.skipif(sys.platform == "win32", reason="permissions and links of POSIX")
def test_usual_permissions_and_links(tmp_path):
    (tmp_path / "plain").write_text("x")
    target = tmp_path / "target"
    target.write_text("old")
    (tmp_path / "link").symlink_to(target)
    with files.replacing(tmp_path / "link") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "link").is_symlink()
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == stat.S_IMODE((tmp_path / "plain").stat().st_mode)


def test_replacing_wants_a_file_in_a_folder(tmp_path):
    with pytest.raises(sx.InputError, match="is a folder"), files.replacing(tmp_path):
        pass
    with (
        pytest.raises(sx.InputError, match="create it first"),
        files.replacing(tmp_path / "a/b.nc"),
    ):
        pass


def test_csv_for_spreadsheets(ds, tmp_path):
    ds["number_density"][2, 4:] = np.nan
    path = results.to_csv(ds, tmp_path / "series.csv")
    with path.open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert len(rows) == ds.sizes["replica"] * ds.sizes["time"]
    assert {"replica", "time", "number_density", "moment_2", "events_aggregation"} <= set(rows[0])
    for row in rows:
        at = ds.sel(replica=int(row["replica"]), time=float(row["time"]))
        assert float(row["moment_2"]) == float(at["moment"].sel(order=2))
        density = float(at["number_density"])
        assert row["number_density"] == ("" if np.isnan(density) else repr(density))
