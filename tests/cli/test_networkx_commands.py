"""Commands that give networkx work: graphs as GraphML, and bounds priced a second time."""

import io
import json
import math
import os
import re
import signal
import time
from contextlib import nullcontext
from pathlib import Path

import networkx as nx
import pytest
from strategies import tiny
from test_cli import Run

from cocap_opt.console import progress
from cocap_opt.console.progress import Watch
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.second_opinion import TooLargeError
from cocap_opt.graph.networks import edges_in_reach, time_expanded_graph
from cocap_opt.output.graphml import graphml
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Objective, Problem
from cocap_opt.scenarios import load_scene


def test_graphml_holds_the_graph_and_its_rewards() -> None:
    """Read back, its longest path is worth what value iteration finds; places are in metres."""
    problem = tiny()
    rewarded = Objective(stationarity=3.0, keep_heading=1.0, count_start=True)
    problem = problem.replace(robots=problem.robots[1:], objective=rewarded)
    content = graphml(problem.replace(name="é <&>"), 0)
    graph = nx.read_graphml(io.BytesIO(content))
    assert "\n".join(nx.generate_graphml(graph)).encode() == content  # as networkx writes it
    expanded = time_expanded_graph(problem, 0)
    assert [graph.graph[key] for key in ("scene", "robot", "horizon")] == ["é <&>", 0, 2]
    assert (len(graph), graph.number_of_edges()) == (len(expanded), expanded.number_of_edges())
    for state, t in expanded:
        found = graph.nodes[f"{t}/{state.x}/{state.y}/0/{state.heading}/0"]
        assert (found["step"], found["x"], found["y"]) == (t, 4 * state.x + 2, 4 * state.y + 2)
        assert (found["z"], found["tilt"]) == (5.0, 0.6)
        assert found["heading"] == pytest.approx(math.tau * state.heading / 4)
    for _, head, data in graph.edges(data=True):
        data["weight"] = data["reward"] + graph.nodes[head]["reward"]
    start = graph.nodes["0/3/2/0/2/0"]["reward"]
    best = PLANNERS["greedy"](problem).value
    assert nx.dag_longest_path_length(graph) + start == pytest.approx(best, rel=1e-12)


def test_export_writes_the_graph_of_a_drone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The name's ending decides, a line says how far it is; --drone is for such files only."""
    monkeypatch.setattr(Watch, "_ticking", lambda watch: nullcontext())
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.0)
    path = tmp_path / "graph.GRAPHML"
    run = Run(capsys, "export", "tiny-share", "-o", path, "--drone", 1, "--json")
    named = {"scene": "tiny-share", "seed": 0, "drone": 1, "file": str(path)}
    assert run.json == {**named, "digest": problem_digest(load_scene("tiny-share"))}
    graph = nx.read_graphml(path)
    assert graph.graph["robot"] == 1
    assert f"node or edge 0/{len(graph) + graph.number_of_edges()}" in run.err
    for words, message in (
        (("-o", tmp_path / "a.graphml", "--drone", 2), "--drone: must be 0..1, not 2"),
        (("-o", tmp_path / "a.json", "--drone", 1), "--drone: applies only to files that end in"),
    ):
        run = Run(capsys, "export", "tiny-share", *words)
        assert (run.code, run.err.count("\n")) == (2, 1)
        assert message in run.err
    assert list(tmp_path.iterdir()) == [path]


def test_graphs_that_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is too large is refused before it is made, in one line that names the drone."""
    monkeypatch.setattr("cocap_opt.output.graphml.MOST_EDGES", 3)
    run = Run(capsys, "export", "tiny-share", "-o", tmp_path / "a.graphml")
    assert run.code == 2
    assert (
        run.err == "cocap-opt: robots[0]: the graph has more than 3 edges, too many for GraphML\n"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_verify_asks_networkx(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both bounds are printed; where they part the claim is false; too large a graph is refused."""
    path = tmp_path / "c.json"
    Run(capsys, "bound", "tiny-share", "-o", path)
    found = Run(capsys, "verify", "tiny-share", path, "--second-opinion", "--json").json
    assert found["valid"]
    assert found["bound_by_verify"] == pytest.approx(found["second_bound"], rel=1e-12)
    assert "second_bound" not in Run(capsys, "verify", "tiny-share", path, "--json").json
    plan = tmp_path / "plan.json"
    Run(capsys, "plan", "tiny-share", "-o", plan)
    run = Run(capsys, "verify", "tiny-share", plan, "--second-opinion")
    assert run.code == 2
    assert run.err == "cocap-opt: --second-opinion: name a certificate or a proof\n"
    with monkeypatch.context() as patch:
        patch.setattr("cocap_opt.formulations.second_opinion.TOLERANCE", -1.0)
        run = Run(capsys, "verify", "tiny-share", path, "--second-opinion", "--json")
    assert (run.code, run.json["valid"]) == (1, False)
    assert "`verify` finds" in run.json["violations"][0]
    monkeypatch.setattr("cocap_opt.formulations.second_opinion.MOST_EDGES", 3)
    run = Run(capsys, "verify", "tiny-share", path, "--second-opinion")
    assert run.code == 2
    assert run.err.startswith(
        "cocap-opt: --second-opinion: the graph of robots[0] has more than 3 edges"
    )


def test_ctrl_c_during_a_second_opinion_keeps_what_is_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The answer is that of verification, the opinion interrupted; the exit code is that of Ctrl-C.

    All bounds are verified before the first second opinion. A false claim is still exit code 1.
    """
    good, other, wrong = (tmp_path / name for name in ("a.json", "b.json", "wrong.json"))
    Run(capsys, "bound", "tiny-share", "-o", good)
    other.write_bytes(good.read_bytes())
    plain = Run(capsys, "verify", "tiny-share", good, other, "--json").json

    def press(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(10)  # which Ctrl-C ends

    monkeypatch.setattr("cocap_opt.run.verified.SecondOpinion.of", press)
    words = "verify", "tiny-share", good, other, "--second-opinion"
    run = Run(capsys, *words, "--json")
    assert (run.code, run.json) == (130, plain | {"second_opinion": "interrupted"})
    assert run.err == f"cocap-opt: interrupted, no second opinion on {good}, {other}\n"
    assert re.search(r"second opinion +interrupted", Run(capsys, *words).out)
    claim = json.loads(good.read_text())
    wrong.write_text(json.dumps(claim | {"bound": claim["bound"] / 2}))
    run = Run(capsys, "verify", "tiny-share", good, wrong, "--second-opinion", "--json")
    assert (run.code, run.json["valid"]) == (1, False)
    assert run.json["second_opinion"] == "interrupted"


def test_what_is_too_large_only_for_a_search_keeps_what_is_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second opinion finds out late that it would take too long: the answer says so."""
    path = tmp_path / "a.json"
    Run(capsys, "bound", "tiny-share", "-o", path)
    plain = Run(capsys, "verify", "tiny-share", path, "--json").json

    def give_up(*_: object) -> None:
        raise TooLargeError("a cut has too many corners")

    monkeypatch.setattr("cocap_opt.run.verified.SecondOpinion.of", give_up)
    run = Run(capsys, "verify", "tiny-share", path, "--second-opinion", "--json")
    assert (run.code, run.json) == (2, plain | {"second_opinion": "none, too large"})
    assert run.err == "cocap-opt: --second-opinion: a cut has too many corners\n"


def test_the_edges_of_drones_are_counted_once_for_a_second_opinion(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counting takes seconds on large scenes; it is done before anything is verified."""
    path, counted = tmp_path / "c.json", list[int]()
    Run(capsys, "bound", "tiny-share", "-o", path)

    def count(problem: Problem, robot: int, most: int) -> int:
        counted.append(robot)
        return edges_in_reach(problem, robot, most)

    monkeypatch.setattr("cocap_opt.formulations.second_opinion.edges_in_reach", count)
    assert Run(capsys, "verify", "tiny-share", path, "--second-opinion").code == 0
    assert counted == sorted(set(counted)) != []


def test_verify_without_compiled_code_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bound is the same; without one there is nothing that would be compiled."""
    path, plan = tmp_path / "c.json", tmp_path / "plan.json"
    Run(capsys, "bound", "tiny-share", "-o", path)
    found = Run(capsys, "verify", "tiny-share", path, "--json").json
    assert Run(capsys, "verify", "tiny-share", path, "--plain", "--json").json == found | {
        "plain": True
    }
    assert "without compiled code" in Run(capsys, "verify", "tiny-share", path, "--plain").out
    Run(capsys, "plan", "tiny-share", "-o", plan)
    run = Run(capsys, "verify", "tiny-share", plan, "--plain")
    assert run.code == 2
    assert run.err == "cocap-opt: --plain: name a certificate or a proof\n"
