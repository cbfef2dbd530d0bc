"""Parameters of column generation: checked where they are made, and all of them are told."""

from dataclasses import fields

import pytest

from cocap_opt.formulations.certificates import verify
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.column_generation.parameters import (
    DEFAULTS,
    LargeRootParameters,
    ListParameters,
    Parameters,
    RelaxationParameters,
    SearchParameters,
    TreeParameters,
)
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import WorkLimit


def test_all_parameters_are_told_with_unit_and_meaning() -> None:
    """Each of every section once, so that a reference made of them is complete."""
    rows = [*DEFAULTS.rows()]
    names = [f"{part.name}.{one.name}" for part in fields(DEFAULTS)
             for one in fields(getattr(DEFAULTS, part.name))]  # fmt: skip
    assert [row[0] for row in rows] == names and len(set(names)) == len(names) > 100
    assert all(value and unit and meaning for _, value, unit, meaning in rows)


@pytest.mark.parametrize(
    ("section", "name", "value"),
    [
        (RelaxationParameters, "most_cuts", 1.5),
        (RelaxationParameters, "most_cuts", True),
        (RelaxationParameters, "most_cuts", -1),
        (RelaxationParameters, "smoothing", 0.5),
        (RelaxationParameters, "smoothing", (0.5, 1.5)),
        (SearchParameters, "exact", float("nan")),
        (ListParameters, "slack", float("inf")),
        (TreeParameters, "rough", 1.1),
        (TreeParameters, "rough", "0.1"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(section: type, name: str, value: object) -> None:
    """The message names section and parameter, and says what is allowed."""
    with pytest.raises(ValueError, match=f"{section.__name__}.{name}: .* is not a") as told:
        section(**{name: value})
    assert "\n" not in str(told.value)


@pytest.mark.long
def test_a_bound_holds_whatever_the_parameters_are() -> None:
    """They guide the search, and reach it: as a large scene it goes otherwise."""
    problem = load_scene("bottleneck", 0).replace(horizon=6)
    few = Parameters(
        relaxation=RelaxationParameters(smoothing=(), most_cut_rounds=0),
        large_root=LargeRootParameters(many_robot_steps=0),
    )
    results = [
        branch_and_price(problem, WorkLimit(30), parameters=parameters)
        for parameters in (DEFAULTS, few)
    ]
    for result in results:
        assert verify(problem, result.certificate).bound == result.bound
    assert results[0].statistics["columns"] != results[1].statistics["columns"]
    assert max(r.value for r in results) <= min(r.bound for r in results) * (1 + 1e-9)
