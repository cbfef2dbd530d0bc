"""The page of messages tells what the program says."""

import re
from pathlib import Path

import pytest
from pages import DOCS
from test_cli import Run

PAGE = DOCS / "troubleshooting.md"
# For each message of the page: the commands that say it, beside the files below.
SAID = {
    "no such scene or file; there are": "plan nowhere",
    "did you mean cocap?": "plan corridor --planner cocapp",
    "the folder": "plan corridor -o none/plan.json",
    "name a file that ends in .json": "plan corridor -o plan.txt",
    "joint planning takes one or two drones": "plan bottleneck --planner joint",
    "brute force tries at most 2000000 plans": "solve bottleneck --method brute-force",
    "the plan was made for bottleneck, not corridor": (
        "verify corridor plan.json; show corridor plan.json -o player.html; "
        "quality corridor plan.json; gap corridor --plan plan.json; "
        "fly corridor plan.json --step 2 -o flight.csv"
    ),
    "ends before its JSON is complete": "verify corridor half.json",
    "must be a plan, not a certificate": "bound bottleneck --start claim.json",
    "but the multipliers prove only": "verify tiny-turn false.json",
    "Unknown option": "plan corridor --no-such-option",
    "--step: must be given": "fly bottleneck plan.json -o flight.csv",
    "earth: must say where the scene is": "fly bottleneck plan.json --step 2 -o flight.plan",
    "no plan: stopped by the time limit": "plan corridor --time-limit 0.001",
}
SUCCEED = ("no plan: stopped by the time limit",)  # with a file that says so


@pytest.mark.slow
def test_messages_are_those_of_the_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each row of the table is said by a command, which fails, and writes nothing."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "300")

    def run(words: str) -> Run:
        return Run(capsys, *words.split())

    for words in (
        "plan bottleneck --planner sequential -o plan.json",
        "bound tiny-turn -o claim.json",
    ):
        assert run(words).code == 0
    Path("half.json").write_text(Path("plan.json").read_text()[:100])
    claim = Path("claim.json").read_text()
    Path("false.json").write_text(re.sub(r'"bound": [\d.]+', '"bound": 1.0', claim, count=1))
    before = set(Path().iterdir())
    told = re.findall(r"^\| `(.+?)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert told == list(SAID)
    for message, commands in SAID.items():
        for words in commands.split("; "):
            done = run(words)
            assert message in " ".join(f"{done.out} {done.err}".split()), words
            assert (done.code == 0) == (message in SUCCEED), words
    assert set(Path().iterdir()) == before
