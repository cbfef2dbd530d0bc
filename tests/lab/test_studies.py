import hashlib
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import fmean

import pytest
from cyclopts import CycloptsError
from pages import pages
from studies import rows_of, study

import cocap_opt as co
from cocap_opt.experiments.lab.results import STORED, load_csv
from cocap_opt.experiments.lab.studies import app as app_module
from cocap_opt.experiments.lab.studies import runs
from cocap_opt.experiments.lab.studies.app import app
from cocap_opt.experiments.lab.studies.gamma import discounted_runs, gammas_in_markdown
from cocap_opt.experiments.lab.studies.lazy import ALL, lazy_in_markdown, means, measured_lazily
from cocap_opt.experiments.lab.studies.releases import DEVELOPMENT, Release
from cocap_opt.experiments.lab.studies.runs import Build, Measurable, Run
from cocap_opt.experiments.lab.studies.separation.points import SeparationPoint
from cocap_opt.experiments.lab.studies.separation.separation import built
from cocap_opt.experiments.lab.studies.separation.tables import separation_in_markdown
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.output.files import save_csv
from cocap_opt.planners import RECOMMENDED, view_search
from cocap_opt.result import Reason

ROOT = Path(__file__).parents[2]
CALL = r"cocap-opt study ([a-z][^`\n]*)"
SLOW = {
    "matplotlib", "pandas", "scipy", "cvxpy", "highspy", "ortools", "distributed",
    "networkx", "pyproj", "rasterio", "shapely", "ssl",
}  # fmt: skip


def test_commands_load_their_work_late() -> None:
    """No command waits for a solver, plotting or networks, and the list of studies for no study."""
    studies = "cocap_opt.experiments.lab.studies"
    code = f"import sys, {studies}.app, cocap_opt.cli.commands; "
    code += f"print(*({SLOW!r} & sys.modules.keys()), "
    code += f"*(n for n in sys.modules if n.startswith('{studies}.') and n != '{studies}.app'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_every_study_that_is_named_exists() -> None:
    """Texts, docstrings and notebooks name commands of `cocap-opt study` that there are."""
    files = [ROOT / name for name in ("README.md", "CONTRIBUTING.md")]
    for folder in ("cocap_opt", "formulations", "scenarios", "experiments", "docs"):
        files += [
            path for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".md", ".ipynb")
        ]
    named = {
        name
        for path in files
        if path.is_file()
        for name in re.findall(r"cocap-opt study ([a-z][a-z-]*)", path.read_text(encoding="utf-8"))
    }
    assert "paper" in named
    assert named <= set(app)


def test_studies_are_told_and_shown() -> None:
    """Pages or CONTRIBUTING tell of each study, and each has an example in its help."""
    texts = [page.read_text(encoding="utf-8") for page in (*pages(), ROOT / "CONTRIBUTING.md")]
    described, shown = (
        {
            call.split("[")[0].strip()
            for text in some
            for call in re.findall(CALL, text)
            if "[OPTIONS]" not in call  # which pages have above all options
        }
        for some in (texts, [inspect.getsource(app_module)])
    )
    commands = set(app) - {"--help", "-h"}
    assert {call.split()[0] for call in described} == commands
    assert {call.split()[0] for call in shown} >= commands
    for call in described | shown:
        app.parse_args(call, print_error=False, exit_on_error=False)
    with pytest.raises(CycloptsError):
        app.parse_args("gamma --no-such-option 1", print_error=False, exit_on_error=False)


# -- the discount of view search ----------------------------------------------------------

GAMMAS = STORED / "gamma.csv"
ORDERS = ("cocap-vs", "cocap-vs-undiscounted")


def stored_shares(planner: str, gamma: float) -> list[str]:
    """J and views of the stored table, means in %, as texts quote them."""
    rows = [r for r in rows_of(GAMMAS) if (r["planner"], float(r["gamma"])) == (planner, gamma)]
    assert len(rows) == 10
    return [f"{100 * fmean(float(row[key]) for row in rows):.0f}" for key in ("reward", "views")]


def test_the_table_of_gammas_is_that_of_the_stored_runs() -> None:
    """Each line has the means of both orders, in %."""
    lines = gammas_in_markdown().splitlines()[2:]
    assert len(lines) >= 5
    for line in lines:
        gamma, *shares = re.findall(r"[\d.]+", line)
        assert shares == [share for name in ORDERS for share in stored_shares(name, float(gamma))]


def test_the_planner_quotes_the_stored_table() -> None:
    """The comment that says why gamma is what it is has the numbers of the stored runs."""
    code = inspect.getsource(view_search).split("\nGAMMA = ")[0].splitlines()
    words = " ".join(line.lstrip("# ") for line in code[-2:])
    quoted = re.findall(r"(0\.\d+) gets (\d+) %.*? from (\d+) %", words)
    assert [float(gamma) for gamma, *_ in quoted] == [view_search.GAMMA, 0.8, 0.99]
    for gamma, *shares in quoted:
        assert shares == stored_shares("cocap-vs", float(gamma))


def test_the_stored_table_is_what_planners_do() -> None:
    """Some of its runs, made again, get the same J from the same views."""
    rows = {(r["planner"], r["gamma"], r["scene"], r["seed"]): r for r in rows_of(GAMMAS)}
    for run in discounted_runs("corridor", 0, [0.97], 60.0):
        row = rows[run.planner, "0.97", "corridor", "0"]
        assert [float(row[key]) for key in ("reward", "views")] == pytest.approx(
            [run.reward, run.views], rel=1e-6
        )
        assert row["reason"] == "finished"


def test_gamma_is_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each gamma has a row for each order of view search; rewards are shares of CoCap's."""
    assert study("gamma", "--scene", "tiny-turn", "--seeds", "0", "--out", tmp_path) == 0
    rows = rows_of(tmp_path / "gamma.csv")
    assert len({(row["planner"], row["gamma"]) for row in rows}) == len(rows)
    assert all(0 < float(row["views"]) <= 1 and float(row["reward"]) > 0 for row in rows)
    assert "cocap-vs" in capsys.readouterr().out


@pytest.mark.slow
def test_views_are_measured(tmp_path: Path) -> None:
    """Each scene has a row with errors; a face in full view has the pixels of the picture."""
    assert study("views", "--scene", "corridor", "--poses", 4, "--out", tmp_path) == 0
    (row,) = rows_of(tmp_path / "views.csv")
    assert row["scene"] == "corridor" and float(row["clear, 99 % error (%)"]) < 5


# -- lazy value iteration ---------------------------------------------------------------------

LAZY = STORED / "lazy.csv"


def test_the_lazy_table_has_all_scenes() -> None:
    """The stored runs are those of the study without options."""
    assert [row["scene"] for row in means(rows_of(LAZY))] == ALL
    assert [line.split(" | ")[0].rstrip() for line in lazy_in_markdown().splitlines()[2:]] == [
        f"| {scene}" for scene in ALL
    ]


def test_the_stored_views_are_what_planners_evaluate() -> None:
    """The corridor, planned again, has the same J from the same views."""
    (row,) = (row for row in rows_of(LAZY) if row["scene"] == "corridor")
    again = measured_lazily("corridor", int(row["seed"]))
    for name in ("states", "views", "reward"):
        assert float(row[name]) == pytest.approx(again[name], rel=1e-9)


def test_lazy_planning_is_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A row for each scene and seed, with J and views as shares of those of all coverage."""
    assert study("lazy", "--scene", "tiny-turn", "--seeds", "0", "--out", tmp_path) == 0
    (row,) = rows_of(tmp_path / "lazy.csv")
    assert float(row["reward"]) == 1 and 0 < float(row["views"]) <= 1
    assert "tiny-turn" in capsys.readouterr().out


# -- the price of separation ----------------------------------------------------------------

SEPARATION = STORED / "separation.csv"


def point(
    separation: float, value: float, bound: float, seconds: float, limit: str
) -> SeparationPoint:
    """What was measured at a separation; cocap-lns takes a second and finds the best."""
    return SeparationPoint(
        "made", 0, separation, value - 10, seconds, limit, value, 1.0, "none", value, bound, 3.0,
        "none",
    )  # fmt: skip


def test_tables_of_separation_say_what_is_above_the_goal(tmp_path: Path) -> None:
    """Prices are certified ranges, times are multiples, and what a limit stopped has a star."""
    rules = point(0, 100.0, 110.0, 1.0, "none")
    points = [rules, point(1, 90.0, 95.0, 2.0, "none"), point(2, 50.0, 80.0, 5.0, "time")]
    text = separation_in_markdown(points)
    text = re.sub(" +", " ", text)
    assert "| made | 5.00 to 18.18 % | 20.00 to 54.55 % |" in text
    assert "| `cocap` | made | 1 s | 2.0 | **5.0**\\* | 27.99 % |" in text
    assert "| `cocap-lns` | made | 1 s | 1.0 | 1.0 | 17.28 % |" in text
    assert "`cocap` in 1 of 2 runs and `cocap-lns` in 2 of 2 runs." in text
    path = tmp_path / "separation.csv"
    save_csv(path, [one._asdict() for one in points])
    assert SeparationPoint.read(path) == points
    path.write_text("scene,seed\nmade,x\n")
    with pytest.raises(FileError, match=r"separation\.csv: must be a file .* must be scene,seed,"):
        SeparationPoint.read(path)


def test_stored_prices_are_those_of_the_methods() -> None:
    """The corridor's optima, proved again, are the stored ones."""
    for point in SeparationPoint.read(SEPARATION):
        if (point.scene, point.seed) == ("corridor", 0) and point.separation in (0, 2):
            problem = built("corridor", 0, point.separation, 3.0)
            assert branch_and_price(problem).value == pytest.approx(point.best, rel=1e-9)


def test_a_scene_without_room_for_a_separation_is_refused() -> None:
    """No drone keeps a start that is too close: the message says which one, and how far."""
    with pytest.raises(FileError, match=r"tiny-queue: no free cell for drone 1 .* is 500 m from"):
        built("tiny-queue", 0, 0.0, 500.0)


def test_where_runs_without_a_separation_fail_there_is_no_price(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A failed run at a separation leaves that out; one without any leaves out all."""
    fine = Run((), 90.0, 100.0, Reason.OPTIMAL, None, 1.0, 1.0)
    fails: list[int] = []

    def each(builds: Sequence[object], method: object, limit: float) -> list[Run | Run.Error]:
        return [Run.Error("it died") if k in fails else fine for k, _ in enumerate(builds)]

    monkeypatch.setattr(Run, "each", each)
    arguments = ["separation", "--scene", "tiny-queue", "--seeds", 0, "--metres", 1, "--limit", 5]
    assert study(*arguments) == 0
    assert "1 m" in capsys.readouterr().out
    for failed, shown in ([1], "none"), ([0], ""):
        fails[:] = failed
        assert study(*arguments) == 1
        out, told = capsys.readouterr()
        assert "it died" in told
        assert "  1 m" not in out and (shown in out if shown else "tiny-queue" not in out)


def test_separations_are_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A row and a point for each separation, under the same starts; wider is never better.

    The runs are in this process; their own ones are tested with growth and solvers.
    """

    def outcomes(builds: Sequence[Build], method: Measurable, *_: float) -> Iterator[Run]:
        return (runs._measured(build, method, 1.0) for build in builds)

    monkeypatch.setattr(runs, "_outcomes", outcomes)
    done = study("separation", "--scene", "tiny-approach", "--seeds", "0", "--metres", 1,
                 "--limit", 1, "--out", tmp_path)  # fmt: skip
    assert done == 0
    assert [row["separation"] for row in rows_of(tmp_path / "separation.csv")] == ["0.0", "1.0"]
    assert (tmp_path / "separation.png").stat().st_size > 10_000


# -- releases -------------------------------------------------------------------------------

# The rows of releases, as they were stored first. Nobody changes one, not when a number got worse.
KEPT = {"0.2.0": "1250b802a903"}


def test_rows_of_releases_are_kept() -> None:
    """Each release has the row that it had, in the order of their dates, the newest first."""
    text = (STORED / "releases.csv").read_text(encoding="utf-8").splitlines()[1:]
    rows = {line.split(",")[0]: hashlib.sha256(line.encode()).hexdigest()[:12] for line in text}
    assert {version: rows.get(version) for version in KEPT} == KEPT
    assert set(rows) - set(KEPT) <= {DEVELOPMENT, Release.stored()[0].version}
    dates = [release.date for release in Release.stored()]
    assert dates == sorted(dates, reverse=True)


def test_the_first_row_follows_what_is_stored() -> None:
    """It is made from the stored results, which `study releases` does."""
    first = Release.stored()[0]
    again = Release.of(first.version, first.date, co.COVERAGE_VERSION, STORED, RECOMMENDED)
    assert first == again, "run cocap-opt study releases"


def test_a_release_takes_the_place_of_its_development(tmp_path: Path) -> None:
    """Rows of other releases stay; a version that is there is made anew."""
    assert study("releases", "9.0.0", "2030-01-01", "--out", tmp_path) == 0
    rows = load_csv(tmp_path / "releases.csv", Release, "releases")
    kept = [release for release in Release.stored() if release.version != DEVELOPMENT]
    assert [row.version for row in rows] == ["9.0.0", *(release.version for release in kept)]
    assert rows[1:] == kept
