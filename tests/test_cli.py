import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.cli import main

KEYS = {
    "scene", "seed", "planner", "method", "reward", "bound", "gap", "reason", "limit", "seconds",
    "conflicts",
}  # fmt: skip
GAP_KEYS = KEYS | {"robots", "actors", "steps", "bound_method", "certificate"}


class Run:
    """Exit code and output of one command."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *words: object) -> None:
        capsys.readouterr()
        with pytest.raises(SystemExit) as caught:
            main([str(word) for word in words])
        self.code = caught.value.code
        self.out, self.err = capsys.readouterr()

    @property
    def json(self) -> dict:
        """The one JSON object on standard output."""
        return json.loads(self.out)


@pytest.fixture
def files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[Path, Path]:
    """A plan and a certificate of the tight corridor."""
    plan, certificate = tmp_path / "plan.json", tmp_path / "certificate.json"
    Run(capsys, "plan", "corridor-tight", "-o", plan)
    Run(capsys, "bound", "corridor-tight", "-o", certificate)
    return plan, certificate


def test_gap_prints_and_writes_the_keys_that_do_not_change(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`gap --json` prints {"rows": ...}; results.csv has a row per scene, seed and planner."""
    run = Run(capsys, "gap", "tiny-share", "tiny-queue", "--seeds", "0-1", "--out", tmp_path / "o",
              "--json")  # fmt: skip
    assert (run.code, run.err) == (0, "")
    rows = run.json["rows"]
    assert len(rows) == 2 * 2 * 5
    for row in rows:
        assert set(row) >= GAP_KEYS
        if row["conflicts"] == 0:
            assert row["reward"] <= row["bound"]
            assert row["gap"] == pytest.approx((row["bound"] - row["reward"]) / row["bound"])
        assert (tmp_path / "o" / row["certificate"]).is_file()
    header, *lines = (tmp_path / "o" / "results.csv").read_text().splitlines()
    assert set(header.split(",")) >= GAP_KEYS
    assert len(lines) == len(rows)


def test_every_plan_and_certificate_of_gap_is_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What `gap --out` writes passes `verify`, but for plans that ignore collisions."""
    Run(capsys, "gap", "corridor-tight", "--seeds", "0", "--out", tmp_path)
    certificate = tmp_path / "certificates" / "corridor-tight-0.json"
    for plan in sorted((tmp_path / "plans").iterdir()):
        run = Run(capsys, "verify", "corridor-tight", plan, certificate, "--json")
        answer = run.json
        assert answer["valid"] is (run.code == 0)
        assert answer["valid"] is ("greedy" not in plan.name)
        assert len(answer["reward_per_step"]) == 8
        assert sum(answer["reward_per_step"]) == pytest.approx(answer["reward"])


def test_a_certificate_can_be_verified_alone(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A bound needs no plan to be checked."""
    run = Run(capsys, "verify", "corridor-tight", files[1], "--json")
    assert (run.code, run.json["valid"]) == (0, True)
    assert run.json["bound"] > 0


def number_paths(content: object, path: tuple = ()) -> list[tuple]:
    """Paths to all numbers of plain data."""
    if isinstance(content, dict):
        return [p for key, value in content.items() for p in number_paths(value, (*path, key))]
    if isinstance(content, list):
        return [p for k, value in enumerate(content) for p in number_paths(value, (*path, k))]
    return [path] if isinstance(content, (int, float)) else []


def test_every_altered_number_of_a_plan_is_noticed(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan whose file was altered is refused, or still is what it claims to be."""
    honest = Run(capsys, "verify", "corridor-tight", files[0], "--json").json["reward"]
    plain = json.loads(files[0].read_text())
    paths = number_paths(plain)
    assert len(paths) == 2 + 2 * 9 * 5
    for path in paths[::7]:
        altered = json.loads(files[0].read_text())
        inner = altered
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] += 1
        files[0].with_name("altered.json").write_text(json.dumps(altered))
        run = Run(capsys, "verify", "corridor-tight", files[0].with_name("altered.json"), "--json")
        if run.code == 0:
            assert run.json["reward"] == pytest.approx(honest, rel=1e-9), path


def test_files_of_another_seed_are_refused(
    files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan and a certificate belong to one scene and seed."""
    for file in files:
        assert Run(capsys, "verify", "corridor-tight", file, "--seed", 1).code == 1


def test_a_plan_without_a_way_is_a_result(capsys: pytest.CaptureFixture[str]) -> None:
    """Infeasible is an answer in words with exit code 0, not an error."""
    run = Run(capsys, "plan", "tiny-head-on", "--json")
    assert run.code == 0
    assert (run.json["reward"], run.json["reason"]) == (None, "infeasible")
    assert "no plan obeys the rules" in run.json["message"]


def test_a_proof_that_there_is_no_plan_is_verified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A negative bound proves that there is no plan, since J >= 0; -infinity is null in files."""
    scene, certificate = tmp_path / "scene.json", tmp_path / "certificate.json"
    Run(capsys, "export", "tiny-head-on", "-o", scene)
    content = json.loads(scene.read_text())
    content["problem"]["horizon"] = 1  # too short for one robot alone
    scene.write_text(json.dumps(content))
    bound = Run(capsys, "bound", scene, "-o", certificate, "--json").json
    assert (bound["reason"], bound["bound"]) == ("infeasible", None)
    verified = Run(capsys, "verify", scene, certificate, "--json")
    assert (verified.code, verified.json["valid"]) == (0, True)
    assert "no plan" in verified.json["message"]


WRONG = [
    (["plan", "no-such-scene"], "no such scene"),
    (["plan", "absent.json"], "absent.json"),
    (["plan", "corridor", "--planner", "best"], "--planner"),
    (["plan", "corridor", "--seed", "-1"], "seed"),
    (["plan", "corridor", "--seed", "one"], "--seed"),
    (["plan", "corridor", "--time-limit", "-1"], "--time-limit"),
    (["plan", "corridor", "--time-limit", "nan"], "--time-limit"),
    (["plan", "corridor", "--colour", "red"], "--colour"),
    (["plan", "corridor", "-o", "no/such/folder/plan.json"], "no/such/folder"),
    (["plan", "bottleneck", "--planner", "joint"], "one or two robots"),
    (["plan"], "SCENE"),
    (["fly", "corridor"], "fly"),
    (["bound", "corridor", "--method", "guess"], "--method"),
    (["bound", "corridor", "--method", "relaxation"], "at most"),
    (["gap"], "SCENE"),
    (["gap", "corridor", "--seeds", "3-1"], "--seeds"),
    (["gap", "corridor", "--seeds", "a"], "--seeds"),
    (["gap", "corridor", "--out", "/dev/null/x"], "/dev/null/x"),
    (["verify", "corridor", "absent.json"], "absent.json"),
    (["show", "corridor", "absent.json", "-o", "x.txt"], "-o"),
    (["show", "corridor", "absent.json", "-o", "x.png"], "absent.json"),
    (["export", "corridor"], "-o"),
]


@pytest.mark.parametrize(("words", "named"), WRONG, ids=lambda value: " ".join(value))
def test_wrong_input_is_one_line_and_exit_code_2(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line on standard error that names what is wrong, nothing on standard output."""
    run = Run(capsys, *words)
    assert run.code == 2
    assert run.out == ""
    assert len(run.err.splitlines()) == 1
    assert named in run.err
    assert "Traceback" not in run.err


def test_wrong_content_of_a_file_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that is no plan, and a scene with a wrong field, name the file and the field."""
    scene = tmp_path / "scene.json"
    Run(capsys, "export", "corridor", "-o", scene)
    content = json.loads(scene.read_text())
    content["problem"]["robots"][1]["camera"]["width"] = 0
    scene.write_text(json.dumps(content))
    for words in (["plan", scene], ["verify", "corridor", scene], ["gap", scene]):
        run = Run(capsys, *words)
        assert run.code == 2
        assert len(run.err.splitlines()) == 1
        assert str(scene) in run.err
    assert "width: must be >= 1 px" in Run(capsys, "plan", scene).err


def test_exported_scene_is_the_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A scene's file gives the same plan as its name and seed."""
    file = tmp_path / "scene.json"
    Run(capsys, "export", "corridor", "--seed", 3, "-o", file)
    by_name = Run(capsys, "plan", "corridor", "--seed", 3, "--json").json
    by_file = Run(capsys, "plan", file, "--json").json
    assert by_name["reward_per_step"] == by_file["reward_per_step"]


@pytest.mark.parametrize("suffix", [".png", ".gif"])
def test_show_draws_a_picture(
    suffix: str, tmp_path: Path, files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A PNG of the last step, or a GIF with a frame for each step."""
    from PIL import Image

    picture = tmp_path / f"picture{suffix}"
    assert Run(capsys, "show", "corridor-tight", files[0], "-o", picture).code == 0
    with Image.open(picture) as image:
        assert getattr(image, "n_frames", 1) == (9 if suffix == ".gif" else 1)
        assert image.width > 300


def test_scenes_lists_all_scenes_and_formats(capsys: pytest.CaptureFixture[str]) -> None:
    """Everything that can stand for SCENE is listed."""
    from scenarios import FORMATS, SCENES

    listed = Run(capsys, "scenes", "--json").json
    assert {row["scene"] for row in listed["scenes"]} == set(SCENES)
    assert {row["format"] for row in listed["formats"]} == set(FORMATS)


def test_a_time_limit_of_zero_still_answers(capsys: pytest.CaptureFixture[str]) -> None:
    """Out of time is a result: the best there is, with the reason and the limit."""
    rows = Run(capsys, "gap", "corridor", "--time-limit", 0, "--json").json["rows"]
    assert {row["limit"] for row in rows} == {"time"}
    for row in rows:
        assert row["reason"] == "stopped"
        assert row["reward"] > 0  # all stay where they are
        assert row["conflicts"] == 0
        assert row["bound"] is None or row["bound"] >= row["reward"]


def test_the_same_plan_file_in_any_process(tmp_path: Path) -> None:
    """Same scene and seed: the same plan file, byte for byte, whatever the hash seed."""
    contents = []
    for hash_seed in ("1", "2"):
        target = tmp_path / f"plan-{hash_seed}.json"
        words = ["plan", "bottleneck", "-o", str(target)]
        code = f"from experiments.cli import main; main({words})"
        subprocess.run(
            [sys.executable, "-c", code], check=True, capture_output=True,
            env=os.environ | {"PYTHONHASHSEED": hash_seed},
        )  # fmt: skip
        contents.append(target.read_bytes())
    assert contents[0] == contents[1]


def test_ctrl_c_prints_what_is_finished(tmp_path: Path) -> None:
    """An interrupted gap table is printed as far as it got, with exit code 0."""
    code = (
        "from experiments.cli import main;"
        f"main(['gap', 'bottleneck', '--seeds', '0-999', '--json', '--out', {str(tmp_path)!r}])"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    while not list(tmp_path.glob("plans/*")) and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert 0 < len(json.loads(out)["rows"]) < 4000
    assert (tmp_path / "results.csv").is_file()


@pytest.mark.parametrize(
    ("redirection", "code"), [(">&-", 0), ("> /dev/full", 2), ("| head -n 1", 0)]
)
def test_standard_output_that_takes_nothing(redirection: str, code: int) -> None:
    """A closed, full or cut-off standard output is no traceback."""
    if "full" in redirection and not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    python = f"{sys.executable} -c 'from experiments.cli import main; main([\"scenes\"])'"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {python} {redirection}"], capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == code
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == (1 if code else 0)
