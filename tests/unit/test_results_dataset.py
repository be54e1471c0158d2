"""The shape of a result."""

import json

import numpy as np
import pytest
import synthetic

import smolux as sx
from smolux import results

DIMS = {
    "number_density": ("replica", "time"),
    "largest": ("replica", "time"),
    "particles": ("replica", "time"),
    "collisions": ("replica", "time"),
    "volume": ("replica", "time"),
    "moment": ("replica", "time", "order"),
    "n": ("replica", "time", "size"),
    "n_bin": ("replica", "time", "bin"),
    "events": ("replica", "time", "process"),
    "extinction_time": ("replica",),
}


@pytest.fixture(scope="module")
def ds():
    return synthetic.constant_dataset(replicas=3, particles=500, distribution=True)


@pytest.mark.parametrize("make", [synthetic.constant_dataset, synthetic.solver_dataset])
def test_every_method_gives_the_same_shape(make):
    ds = make()
    assert {name: ds[name].dims for name in DIMS} == DIMS
    for name, variable in ds.variables.items():
        assert variable.attrs["long_name"], name
        if name not in ("process", "replica"):
            assert variable.attrs["units"] == "1", name


def test_selection_by_labels(ds):
    assert ds["moment"].sel(order=2, time=1.0).shape == (3,)
    assert ds["n"].sel(size=1).dims == ("replica", "time")
    assert ds["events"].sel(process="aggregation", drop=True).equals(ds["collisions"])


def test_bins_hold_whole_sizes(ds):
    lower, upper = ds["bin_lower"].values, ds["bin_upper"].values
    assert lower[0] == synthetic.SIZES + 1
    assert np.array_equal(lower[1:], upper[:-1])
    assert np.array_equal(ds["bin_width"].values, upper - lower)
    assert np.allclose(ds["bin"].values, np.sqrt(lower * (upper - 1)))


def test_edges_between_sizes_and_no_bins():
    records = synthetic.constant_kernel(particles=100, replicas=2)
    records.bin_edges = np.array([64.5, 70.2, 100.0, np.inf])
    records.values["n_bin"] = records.values["n_bin"][:, :, :3]
    ds = results.to_dataset(synthetic.model(), records)
    # sizes 65 .. 70, 71 .. 99, 100 ...
    assert ds["bin_width"].values.tolist() == [6, 29, np.inf]
    records.bin_edges = np.array([65.0])
    records.values["n_bin"] = records.values["n_bin"][:, :, :0]
    assert results.to_dataset(synthetic.model(), records).sizes["bin"] == 0


def test_mass_in_sizes_and_bins_is_the_mass(ds):
    in_sizes = (ds["n"] * ds["size"]).sum("size")
    low = in_sizes + (ds["n_bin"] * ds["bin_lower"]).sum("bin")
    high = in_sizes + (ds["n_bin"] * (ds["bin_upper"] - 1)).sum("bin")
    assert np.all(low <= 1 + 1e-12)
    assert np.all(high >= 1 - 1e-12)
    count = ds["n"].sum("size") + ds["n_bin"].sum("bin")
    assert np.allclose(count, ds["number_density"], rtol=1e-13)


def test_whole_populations(ds):
    assert ds["row_size"].attrs["sample_dimension"] == "sample"
    assert int(ds["row_size"].sum()) == ds.sizes["sample"]
    for r in range(3):
        for time in (0.0, 2.0, 10.0):
            sizes, counts = results.population(ds, r, time)
            at = ds.sel(replica=r, time=time)
            assert int(sizes @ counts) == 500
            assert int(counts.sum()) == int(at["particles"])
            assert sizes.max() == int(at["largest"])


def test_population_not_there(ds):
    with pytest.raises(sx.InputError, match="distribution=True"):
        results.population(synthetic.constant_dataset(replicas=1), 0, 0.0)
    with pytest.raises(sx.InputError, match="replicas are 0 to 2"):
        results.population(ds, 3, 0.0)


def test_populations_of_a_run_that_stopped():
    records = synthetic.constant_kernel(replicas=2, particles=100, distribution=True)
    records.distribution[1] = records.distribution[1][:2]
    ds = results.to_dataset(synthetic.model(), records)
    assert results.population(ds, 1, 0.5)[0].size > 0
    assert results.population(ds, 1, 10.0)[0].size == 0
    assert int(results.population(ds, 0, 10.0)[1].sum()) == int(ds["particles"][0, -1])


def test_provenance(ds):
    attributes = ds.attrs
    assert all(isinstance(v, str | int | float) for v in attributes.values())
    assert attributes["Conventions"].startswith("CF-")
    assert attributes["smolux_schema"] == results.SCHEMA
    versions = json.loads(attributes["versions"])
    assert {"smolux", "numpy", "numba", "xarray", "python"} <= set(versions)
    assert json.loads(attributes["model"])["kernel"]["name"] == "constant"
    assert attributes["seed"] == 1
    assert attributes["method"] == "synthetic"
    assert {"created", "platform", "warnings"} <= set(attributes)


def test_attributes_of_any_kind_become_plain():
    records = synthetic.constant_kernel(
        particles=50,
        replicas=1,
        seed=5,
        entropy=2**127 + 1,
        executor=None,
        policy={"doubling": True},
        flag=True,
        wall=np.float32(0.5),
        threads=np.int64(3),
    )
    records.warnings += ["first", "second"]
    attributes = results.to_dataset(synthetic.model(), records).attrs
    assert int(attributes["entropy"]) == 2**127 + 1
    assert "executor" not in attributes
    assert json.loads(attributes["policy"]) == {"doubling": True}
    assert (attributes["flag"], attributes["wall"], attributes["threads"]) == (1, 0.5, 3)
    assert json.loads(attributes["warnings"]) == ["first", "second"]


def test_units_where_there_are_some():
    records = synthetic.constant_kernel(
        particles=50, replicas=1, units={"time": "s", "number_density": "m-3"}
    )
    ds = results.to_dataset(synthetic.model(), records)
    assert ds["time"].attrs["units"] == "s"
    assert ds["number_density"].attrs["units"] == "m-3"
    assert ds["largest"].attrs["units"] == "1"
    assert "units" not in ds.attrs
