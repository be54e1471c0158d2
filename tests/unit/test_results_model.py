"""Models as plain data and back."""

import json

import pytest

import smolux as sx
from smolux.model_dict import model_from_dict, model_to_dict

ARGUMENTS = {
    "bilinear": {"A": 0.5, "B": 0.25},
    "long": {"monomer_diameter": 4e-6},
    "product": {"mu": 0.4},
    "generalized-brownian": {"a": 0.95},
}
INITIALS = [
    sx.initial.monodisperse(0.3, 7),
    sx.initial.from_sizes({1: 0.1, 3: 1 / 3}),
    sx.initial.exponential(3.3, 2.0),
    sx.initial.lognormal(50.0, 1.5),
]


def there_and_back(model):
    return model_from_dict(json.loads(json.dumps(model_to_dict(model))))


@pytest.mark.parametrize("law", sx.kernels.KERNELS, ids=lambda law: law.name)
def test_every_kernel(law):
    given = ARGUMENTS.get(law.name, {})
    model = sx.Model(kernel=law(**given) * (1 / 3))
    assert there_and_back(model) == model


@pytest.mark.parametrize("initial", INITIALS, ids=lambda i: i.name)
@pytest.mark.parametrize("rate", [0.01, "0.01 * (1 - t/400)"])
def test_processes_and_initial_conditions(initial, rate):
    model = sx.Model(
        kernel=sx.kernels.Ballistic(),
        processes=[sx.processes.Aggregation(), sx.processes.Shattering(rate)],
        initial=initial,
    )
    back = there_and_back(model)
    assert back == model
    assert back.processes[1].factor(100.0) == model.processes[1].factor(100.0)


def test_formula():
    kernel = sx.kernels.formula("(i/j)**a + (j/i)**a", a=0.95, degree=0.0)
    back = there_and_back(sx.Model(kernel=kernel))
    assert back.kernel == kernel
    assert float(back.kernel(2, 9)) == float(kernel(2, 9))


def test_functions_are_kept_as_text_and_not_rebuilt():
    def rate(i, j, a=1.0):
        return a * (i + j)

    def strength(t):
        return 0.01

    model = sx.Model(
        kernel=sx.kernels.from_function(rate, a=0.5),
        processes=[sx.processes.Aggregation(), sx.processes.Shattering(strength)],
    )
    data = json.loads(json.dumps(model_to_dict(model)))
    assert "return a * (i + j)" in data["kernel"]["source"]
    assert "return 0.01" in data["processes"][1]["rate"]["source"]
    with pytest.raises(sx.InputError) as caught:
        model_from_dict(data)
    assert len(caught.value.problems) == 2
    assert "from_function" in caught.value.problems[0]


def test_all_mistakes_at_once_with_the_nearest_name():
    with pytest.raises(sx.InputError) as caught:
        model_from_dict(
            {
                "kernel": {"name": "balistic"},
                "processes": [{"name": "shatering"}, {"name": "shattering", "rat": 1.0}],
                "initial": {"name": "sizes", "densities": [1, 2]},
                "inital": 1,
            }
        )
    text = str(caught.value)
    for part in ("'ballistic'", "'shattering'", "'rate'", "densities", "'initial'"):
        assert f"{part}" in text
    assert len(caught.value.problems) == 6


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "must be a dictionary"),
        ({}, "'kernel' is missing"),
        ({"kernel": {"name": "ballistic", "scal": 2}}, "scale"),
        ({"kernel": {"name": "ballistic"}, "processes": "aggregation"}, "list of tables"),
        ({"kernel": {"name": "ballistic"}, "processes": [3]}, "with a 'name'"),
        ({"kernel": {"name": "ballistic"}, "initial": {"size": 1}}, "'name' is missing"),
        (
            {"kernel": {"name": "ballistic"}, "initial": {"name": "sizes", "densities": {"x": 1}}},
            "invalid literal",
        ),
    ],
)
def test_wrong_data(data, message):
    with pytest.raises(sx.InputError, match=message):
        model_from_dict(data)


def test_monodisperse_by_name():
    data = {"kernel": {"name": "constant"}, "initial": {"name": "monodisperse", "density": 2.0}}
    assert model_from_dict(data).initial == sx.initial.monodisperse(2.0)
