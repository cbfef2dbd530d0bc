import sys
from pathlib import Path

import numpy as np
import pytest
from studies import rows_of, study
from test_flight import flights

from cocap_opt.experiments.lab.results import STORED
from cocap_opt.experiments.lab.studies.flight.flight import tell
from cocap_opt.experiments.lab.studies.flight.measures import (
    delays,
    errors,
    least_apart,
    least_clearance,
)
from cocap_opt.experiments.lab.studies.flight.runs import FlightRun, fitting_step
from cocap_opt.experiments.lab.studies.flight.simulation import Reference, Simulated
from cocap_opt.experiments.lab.studies.flight.tables import flights_in_markdown, sentences
from cocap_opt.experiments.lab.studies.flight.wind import Wind
from cocap_opt.flight.pace import Demand
from cocap_opt.flight.smooth import Smooth
from cocap_opt.output.files import save_csv
from cocap_opt.scenarios.hardware import AIRFRAMES

ROOT = Path(__file__).parents[2]
FLIGHTS = STORED / "flight.csv"


def test_all_flights_are_stored() -> None:
    """There is one run for each scene, seed, kind of flight and wind."""
    runs = FlightRun.read(FLIGHTS)
    kinds = {(run.scene, run.seed, run.flight, run.wind) for run in runs}
    assert len(kinds) == len(runs) == 2 * 3 * 2 * 3


def test_stored_flights_are_of_plans_that_can_be_flown() -> None:
    """Planned distances keep the separation, and what is filmed is never more than J by far."""
    for run in FlightRun.read(FLIGHTS):
        assert run.apart_planned >= run.separation - 1e-6
        assert 0 <= run.error_mean <= run.error_most
        assert run.apart_flown >= run.apart_planned - 2 * run.error_most
        assert 0 < run.reward_flown < 1.05 * run.reward


def test_what_is_stored_is_told_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without the simulator: tables of 80 columns, a figure, and a table in Markdown."""
    runs = FlightRun.read(FLIGHTS)
    tell(runs, tmp_path)
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith(" ")]
    assert rows and max(map(len, map(str.rstrip, rows))) <= 80
    assert flights_in_markdown(runs).startswith("| scene ")
    assert (tmp_path / "flight.png").stat().st_size > 10_000


def test_a_separation_that_is_too_small_is_called_so() -> None:
    """What is left is the separation less twice the largest error; it must hold a vehicle."""
    run = FlightRun.read(FLIGHTS)[0]._replace(flight="smooth", wind=3.0, span=0.5, error_most=0.7)
    both = [run, run._replace(flight="straight")]
    told = " ".join(sentences(both))
    assert "0.60 m of the 2 m is left, which is enough" in told
    assert "So 2 m is enough up to 3 m/s of wind." in told
    told = " ".join(sentences([one._replace(error_most=0.8) for one in both]))
    assert "which is too little for vehicles 0.5 m wide; 2.1 m would be needed" in told


def test_errors_are_those_of_flights_that_are_late() -> None:
    """A flight that is a tenth of a second late is found to be so, and nothing is off across."""
    flown = flights(2)[0][2].trajectory
    reference = Reference.of(flown, 4)
    times, robots = reference.times, len(flown.pieces)
    assert times[1] <= 0.01 and times[-1] == pytest.approx(flown.seconds)
    np.testing.assert_allclose(reference.states[..., :3].reshape(-1, 3), flown.at(times).place)
    np.testing.assert_allclose(
        np.gradient(reference.states, times[1], axis=1)[:, 1:-1], reference.rates[:, 1:-1],
        atol=0.02,
    )  # fmt: skip
    late = flown.at(np.maximum(times - 0.02, 0)).place.reshape(robots, -1, 3)
    made = Simulated(reference, late, reference.states[..., 3])
    whole, most = delays(made)
    assert whole == pytest.approx(0.02, rel=0.01) and most < 0.05
    assert errors(made).max() <= 0.02 * np.linalg.norm(reference.rates[..., :3], axis=-1).max()
    assert least_apart(reference.states[..., :3]) >= flown.least_distance() - 1e-9


def test_clearance_is_the_distance_to_the_nearest_matter() -> None:
    """As by brute force over all cells; a place inside matter has none."""
    rng = np.random.default_rng(0)
    for problem, _, made in flights(2):
        corner = np.array([*problem.height_map.origin, 0.0])
        places = corner + rng.uniform([0, 0, 1], [7, 7, 30], size=(40, 3))
        columns, expected = problem.workspace.columns, []
        for place in places - corner:
            for k, i, j in np.argwhere(columns.low <= columns.high):
                low = np.array([i, j, columns.low[k, i, j]])
                high = np.array([i + 1, j + 1, columns.high[k, i, j]])
                expected.append(
                    np.linalg.norm(np.maximum(np.maximum(low - place, place - high), 0))
                )
        found = [least_clearance(problem, place[None, None], 5) for place in places]
        np.testing.assert_allclose(found, np.reshape(expected, (40, -1)).min(axis=1))
        assert least_clearance(problem, made.trajectory.at(np.zeros(1)).place[None], 9) > 0


def test_steps_that_fit_keep_the_limits_and_half_a_second_less_does_not() -> None:
    """Smooth flights in steps as short as PX4's limits allow, in halves of a second."""
    problem, plan, _ = flights(2)[1]
    step = fitting_step(problem.replace(step=None), plan)
    limits = AIRFRAMES["px4"]
    kept = []
    for seconds in (step, step - 0.5):
        flown = Smooth.of(problem.replace(step=seconds), plan).trajectory
        asked = Demand.all_of(flown, True)
        found = [one._replace(limit=getattr(limits, one.kind)) for one in asked]
        kept.append(all(one.is_kept for one in found))
    assert kept == [True, False]


def test_wind_is_as_strong_as_it_says() -> None:
    """Its mean over seeds and time, the strength of its gusts, and the same by the same seed."""
    times = np.arange(0, 200, 0.1)
    air = [Wind(5.0, seed).on(0, 6.096, times) for seed in range(8)]
    speeds = [np.hypot(*one[:, :2].mean(axis=0)) for one in air]
    assert np.mean(speeds) == pytest.approx(5.0, rel=0.05)
    assert np.mean([one[:, 2].std() for one in air]) == pytest.approx(0.5, rel=0.1)
    np.testing.assert_array_equal(air[3], Wind(5.0, 3).on(0, 6.096, times))
    assert not np.allclose(air[3], Wind(5.0, 3).on(1, 6.096, times))
    assert not Wind(0.0, 0).on(0, 5.0, times).any()


def test_what_cannot_be_simulated_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One line, the exit code 2, and nothing written."""
    monkeypatch.setitem(sys.modules, "rotorpy", None)
    out, bad = tmp_path / "out", tmp_path / "bad.csv"
    save_csv(bad, [{"scene": "a", "seed": "one"}])
    for words, expected in (
        (("tiny-turn",), "rotorpy is not installed: pip install 'cocap-opt[flight]'"),
        (("tiny-turn", "--wind", "-1"), "--wind: must be 0..30 m/s"),
        (("tiny-turn", "--step", "0"), "--step: must be a positive number of seconds"),
        (("tiny-turn", "--seeds", "x"), "--seeds: must be numbers"),
        (("tiny-turn", "--stored"), "--stored: must be given without scenes"),
    ):
        assert study("flight", *words, "--out", out) == 2
        err = capsys.readouterr().err.splitlines()
        assert len(err) == 1 and expected in err[0]
        assert not out.exists()
    with pytest.raises(ValueError, match=r"bad\.csv: must be a file of"):
        FlightRun.read(bad)


@pytest.mark.slow
def test_flights_are_simulated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In still air a smooth flight of a few metres is flown to a decimetre, and films about J."""
    pytest.importorskip("rotorpy", reason="needs rotorpy: pip install 'cocap-opt[flight]'")
    done = study(
        "flight", "tiny-approach", "--seeds", 0, "--wind", 0, "--step", 1, "--out", tmp_path
    )
    assert done == 0
    smooth_, straight = rows_of(tmp_path / "flight.csv")
    assert (smooth_["flight"], straight["flight"]) == ("smooth", "straight")
    assert 0 < float(smooth_["error_most"]) < 0.2 < float(straight["error_most"]) < 0.5
    assert float(smooth_["reward_flown"]) == pytest.approx(float(smooth_["reward"]), rel=0.05)
    assert 0 < float(smooth_["late_mean"]) < 0.2
    assert [run.apart_flown for run in FlightRun.read(tmp_path / "flight.csv")] == [np.inf, np.inf]
