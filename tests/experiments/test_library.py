import gzip
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from others import DATA as OTHERS
from others import data

from cocap_opt.cli import commands
from cocap_opt.experiments.lab.studies.library import library as fill
from cocap_opt.experiments.library.entries import DATA, FIRST_TEST_SEED
from cocap_opt.experiments.library.judge import proved
from cocap_opt.experiments.library.records import MOST_BYTES, Library
from cocap_opt.experiments.library.tables import in_words
from cocap_opt.files.documents import FileError
from cocap_opt.output.printing import Record as Row
from cocap_opt.scenarios import SCENES

LIST = """
version = "7"

[[family]]
name = "trap"
scene = "tiny-trap"
train = [0]

[[family]]
name = "queue"
scene = "tiny-queue"
train = [0]
"""
GOOD = ("trap.plan.json", "trap.bound.json")


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library of two instances with their records, and the files that were accepted."""
    folder = tmp_path_factory.mktemp("library")
    (folder / "files").mkdir()
    (folder / "instances.toml").write_text(LIST)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COCAP_OPT_CACHE", str(folder / "cache"))
        assert fill(folder=folder) == 0
    known = Library(folder)
    for record in known.records("trap-0"):
        (folder / f"trap.{record.kind}.json").write_bytes(known.content(record))
    return folder


@pytest.fixture
def empty(filled: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Library:
    """The same library without records."""
    folder = tmp_path / "library"
    shutil.copytree(filled, folder)
    (folder / "records.csv").unlink()
    shutil.rmtree(folder / "files")
    (folder / "files").mkdir()
    monkeypatch.setenv("COCAP_OPT_CACHE", str(folder / "cache"))
    return Library(folder)


def content(library: Library) -> dict[str, bytes]:
    """All that counts of a library."""
    paths = [library.folder / "records.csv", library.folder / "digests.csv"]
    paths += (library.folder / "files").iterdir()
    return {path.name: path.read_bytes() for path in paths if path.exists()}


def forged(library: Library, name: str, change: Callable[[Row], object]) -> Path:
    """Returns a good file in which something was changed."""
    fields = json.loads((library.folder / name).read_bytes())
    change(fields)
    path = library.folder / "forged.json"
    path.write_text(json.dumps(fields))
    return path


def test_what_the_checker_proves_is_recorded(empty: Library) -> None:
    """Best plan and bound of tiny-trap are 27, as its docstring works it out; it is solved."""
    for name in GOOD:
        empty.submit(empty.folder / name, who="Ada\nLovelace", seconds=1.5)
    plan, bound = empty.records("trap-0")
    assert (plan.value, plan.who, plan.seconds) == (27.0, "Ada Lovelace", 1.5)
    assert 27.0 <= bound.value <= 27.00001
    assert empty.standing("trap-0").state == "solved"
    assert empty.standing("queue-0").state == "none"
    assert [empty.recheck(record).value for record in (plan, bound)] == [plan.value, bound.value]


def test_the_number_is_that_of_the_checker_not_of_the_file(empty: Library) -> None:
    """A plan that claims less, and a bound that claims more, count for what they are."""
    low = forged(empty, GOOD[0], lambda file: file.update(reward=1.0))
    assert empty.submit(low).value == 27.0
    high = forged(empty, GOOD[1], lambda file: file.update(bound=9999.0))
    assert empty.submit(high).value <= 27.00001


@pytest.mark.parametrize(
    "field", [{"seconds": 10**400}, {"seconds": -1}, {"seconds": "soon"}, {"planner": ["a"]},
              {"scene": 5}, {"limit": "x"}]
)  # fmt: skip
def test_what_nobody_could_read_is_refused(empty: Library, field: Row) -> None:
    """Fields on which no proof depends count as well: `get` and `page` read the whole file."""
    path, before = forged(empty, GOOD[0], lambda file: file.update(field)), content(empty)
    with pytest.raises(FileError) as caught:
        empty.submit(path)
    assert "\n" not in str(caught.value)
    assert content(empty) == before


def test_names_of_programs_stay_in_their_line(empty: Library) -> None:
    """A file may name any program; the records can be read afterwards."""
    path = forged(empty, GOOD[0], lambda file: file.update(seconds=None, planner="a\n,b"))
    assert empty.submit(path).value == 27.0
    (record,) = empty.records()
    assert "\n" not in record.program


FORGERIES: dict[str, tuple[str, Callable[[Row], object], str]] = {
    "bound": (GOOD[1], lambda f: f.update(bound=26.0), "claims less than its numbers prove"),
    "no plan": (GOOD[1], lambda f: f.update(bound=None), "claims less than its numbers prove"),
    "reward": (GOOD[0], lambda f: f.update(reward=28.0), "claims more than the plan's J"),
    "state": (GOOD[0], lambda f: f["plan"]["paths"][0][-1].__setitem__(0, 1), "refused"),
    "heading": (GOOD[0], lambda f: f["plan"]["paths"][0][0].__setitem__(3, 0), "refused"),
    "drone": (GOOD[0], lambda f: f["plan"]["paths"].pop(), "refused"),
    "objective": (
        GOOD[1],
        lambda f: f.update(objective={"pixels": 0.5}),
        "objective: must be the objective of trap-0",
    ),
    "digest": (GOOD[0], lambda f: f.update(digest="0" * 64), "does not match any instance"),
    "version": (
        GOOD[1],
        lambda f: f.update(version=99),
        "version: must be one of 3, 4, 5, 6, not 99",
    ),
}


@pytest.mark.parametrize("forgery", FORGERIES)
def test_forged_files_are_refused(empty: Library, forgery: str) -> None:
    """A false bound, reward, path or digest is refused in one line, and nothing is written."""
    name, change, words = FORGERIES[forgery]
    path, before = forged(empty, name, change), content(empty)
    with pytest.raises(FileError, match=words) as caught:
        empty.submit(path)
    assert "\n" not in str(caught.value)
    assert content(empty) == before


def test_a_file_of_another_instance_does_not_pass_with_a_forged_digest(empty: Library) -> None:
    """A plan of one instance that names the digest of another is judged on that one."""
    other = empty.digests()["queue-0"].digest
    for name in GOOD:
        path = forged(empty, name, lambda file: file.update(digest=other))
        with pytest.raises(FileError, match="refused"):
            empty.submit(path)
    assert empty.records() == []


def test_two_drones_in_a_cell_are_refused(empty: Library, filled: Path) -> None:
    """The plan of tiny-queue in which both drones share the last cell would pay 2 more."""
    full = Library(filled)
    (plan, _) = full.records("queue-0")
    fields = json.loads(full.content(plan))
    fields["plan"]["paths"][1][-1] = fields["plan"]["paths"][0][-1]
    path = empty.folder / "together.json"
    path.write_text(json.dumps(fields))
    with pytest.raises(FileError, match="refused"):
        empty.submit(path)


@pytest.mark.parametrize("text", ["", "[]", "{}", "nonsense", "[" * 100_000, '{"digest": NaN}'])
def test_what_is_no_file_of_ours_is_refused(empty: Library, text: str) -> None:
    """Whatever is handed in, the answer is one line."""
    path = empty.folder / "nonsense.json"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        empty.submit(path)
    assert "\n" not in str(caught.value)


def test_only_what_is_better_is_accepted(empty: Library) -> None:
    """Neither the same again nor what is worse takes the place of a record."""
    for name in GOOD:
        empty.submit(empty.folder / name)
        with pytest.raises(FileError, match="equals the record"):
            empty.submit(empty.folder / name)

    def stay(file: Row) -> None:
        file["reward"] = 0.0
        for path in file["plan"]["paths"]:
            path[1:] = [path[0]] * (len(path) - 1)

    with pytest.raises(FileError, match="not better than the record, 27"):
        empty.submit(forged(empty, GOOD[0], stay))
    assert len(empty.records()) == 2


def test_a_claim_that_rests_on_a_search_is_refused(
    empty: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The checker's exit code 3 is no acceptance."""
    checker = tmp_path / "checker.py"
    says = "no plan has more than 1.000000, by its multipliers; .."
    checker.write_text(f"import sys; print('instance'); print(f'{{sys.argv[4]}}: {says}'); exit(3)")
    monkeypatch.setattr("cocap_opt.experiments.library.judge._CHECKER", checker)
    with pytest.raises(FileError, match="needs a search that is too large"):
        empty.submit(empty.folder / GOOD[1])


def test_a_file_that_keeps_the_checker_busy_is_refused(
    empty: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The checker is ended at the limit, and the library is as it was."""
    checker = tmp_path / "checker.py"
    checker.write_text("while True: pass")
    monkeypatch.setattr("cocap_opt.experiments.library.judge._CHECKER", checker)
    with pytest.raises(FileError, match=r"refused: `cocap-check` did not end within 0.2 s"):
        empty.submit(empty.folder / GOOD[1], time_limit=0.2)
    assert not empty.records()


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ("echo 'no plan has more than 54 / 2, that is 27.0 (1 leaf)'", "27.0"),
        ("echo 'no plan has more than 1 / 3, that is 0.333334 (1 leaf)'", "above a bound of"),
        ("echo 'refused: the claim does not follow'; exit 1", "refused: the claim does not"),
        ("echo 'not decided: too long'; exit 3", "refused: not decided: too long"),
        ("sleep 5", "`cocap-check-verified` did not end within 2 s"),
        ("echo 'no plan has more than 27'", "not judged: `cocap-check-verified` answered"),
        (None, "cannot be run: No such file"),
    ],
)
def test_the_verified_checker_may_judge_bounds(
    empty: Library, tmp_path: Path, answer: str | None, told: str
) -> None:
    """Its fraction is the record, rounded up; plans are judged by `cocap-check`."""
    program = tmp_path / "program"
    if answer is not None:
        program.write_text(f"#!/bin/sh\n{answer}\n")
        program.chmod(0o755)
    plan = empty.submit(empty.folder / GOOD[0], verified=program)
    assert (plan.value, "Coq" in plan.checked) == (27.0, False)
    path = empty.folder / GOOD[1]
    if told == "27.0":
        record = empty.submit(path, verified=program)
        assert (record.value, record.checked[-7:]) == (27.0, " in Coq")
        assert empty.recheck(record, verified=program).value == 27.0
        return
    with pytest.raises(FileError, match=told):
        empty.submit(path, time_limit=2.0, verified=program)
    assert len(empty.records()) == 1


def test_a_checker_that_was_killed_is_told(
    empty: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is not the file that is to blame, nor the instance."""
    checker = tmp_path / "checker.py"
    checker.write_text("import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    monkeypatch.setattr("cocap_opt.experiments.library.judge._CHECKER", checker)
    with pytest.raises(FileError, match="not judged: `cocap-check` ended with code -9"):
        empty.submit(empty.folder / GOOD[1])


def test_a_plan_above_a_bound_is_told(empty: Library) -> None:
    """Records changed by hand that contradict each other are no solved instance."""
    empty.submit(empty.folder / GOOD[0])
    record = empty.submit(empty.folder / GOOD[1])
    path = empty.folder / "records.csv"
    told = path.read_text()
    path.write_text(told.replace(f",{record.value},", f",{record.value - 0.5},"))
    assert path.read_text() != told
    with pytest.raises(FileError, match=r"records.csv: trap-0: a plan's J is .* one of them is wr"):
        empty.standings()
    other = next(entry.name for entry in empty.entries if entry.name != record.name)
    assert empty.standing(other).state == "none"


@pytest.mark.parametrize("renamed", [0, 1])
def test_a_kill_leaves_the_library_whole(empty: Library, renamed: int) -> None:
    """Killed before the first or the second file has its name, nothing is recorded or lost."""
    empty.submit(empty.folder / GOOD[0])
    before = empty.records()
    program = f"""
import os, signal, sys
from pathlib import Path
from cocap_opt.experiments.library.records import Library
replace, done = os.replace, []
def killing(*names):
    if len(done) == {renamed}:
        os.kill(os.getpid(), signal.SIGKILL)
    done.append(names)
    replace(*names)
os.replace = killing
Library(Path(sys.argv[1])).submit(Path(sys.argv[2]))
"""
    path = empty.folder / GOOD[1]
    killed = subprocess.run([sys.executable, "-c", program, empty.folder, path], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert empty.records() == before
    assert [empty.recheck(record).value for record in before] == [27.0]
    assert empty.submit(path).kind == "bound"


def test_a_stored_file_that_was_changed_is_noticed(empty: Library) -> None:
    """Records name the SHA-256 of their files."""
    record = empty.submit(empty.folder / GOOD[0])
    path = empty.folder / "files" / f"{record.file}.gz"
    path.write_bytes(gzip.compress(empty.content(record) + b" "))
    with pytest.raises(FileError, match="SHA-256 differs"):
        empty.content(record)


def test_an_instance_that_was_changed_is_made_again(empty: Library) -> None:
    """A kept instance counts only with the digest that the library has; so does one made anew."""
    entry = empty.entry("trap-0")
    path = empty.instance(entry)
    good = path.read_bytes()
    path.write_bytes(good.replace(b"weight 0 0x1", b"weight 0 0x9"))
    assert empty.instance(entry).read_bytes() == good
    digests = empty.folder / "digests.csv"
    right = empty.digests()["trap-0"]
    digests.write_text(digests.read_text().replace(right.sha256, "0" * 64))
    with pytest.raises(FileError, match="sha256"):
        empty.instance(entry)
    digests.write_text(digests.read_text().replace(right.digest, "1" * 64))
    with pytest.raises(FileError, match="digest"):
        empty.instance(entry)


def test_large_files_are_refused(empty: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library stays small."""
    assert MOST_BYTES <= 1_000_000
    monkeypatch.setattr("cocap_opt.experiments.library.records.MOST_BYTES", 100)
    with pytest.raises(FileError, match="at most 100 bytes"):
        empty.submit(empty.folder / GOOD[0])


# -- the library of the project --------------------------------------------------------------


def test_seeds_for_training_and_for_tests_are_apart() -> None:
    """No family has a seed in both; of scenes with seeds at will, tests begin at 1000.

    Nor has any scene of a test the digest of one for training.
    """
    library = Library()
    for entry in library.entries:
        family = entry.family
        assert not {*family.train} & {*family.test}
        if not family.source.startswith("https://github.com/GreedyPerspectives"):
            assert all(seed < FIRST_TEST_SEED for seed in family.train)
            assert all(seed >= FIRST_TEST_SEED for seed in family.test)
    digests = [row.digest for row in library.digests().values()]
    assert len({*digests}) == len(digests)


def test_instances_that_are_named_like_a_built_in_scene_are_made_of_it() -> None:
    """Nobody takes the one for the other."""
    families = [entry.family for entry in Library(DATA).entries]
    assert all(made.scene == made.name for made in families if made.name in SCENES)


def test_the_library_is_about_a_hundred_instances_from_easy_to_open() -> None:
    """Each instance has digests and a state; drones go from few to 64, and some are solved."""
    found = Library().standings()
    assert 95 <= len(found) <= 130
    assert all(standing.digest for standing in found)
    assert max(s.digest.drones for s in found if s.digest) == 64
    states = [standing.state for standing in found]
    assert states.count("solved") > 30 and states.count("open") > 5 and "none" not in states


def test_each_stored_file_is_there_and_whole() -> None:
    """No record lacks its file, no file its record, and all of it stays below 8 MB."""
    library = Library()
    records = library.records()
    assert all(library.content(record) for record in records)
    files = {path.name for path in (DATA / "files").iterdir()}
    assert files == {f"{record.file}.gz" for record in records}
    assert sum(path.stat().st_size for path in DATA.rglob("*") if path.is_file()) < 8e6


def test_values_only_improve() -> None:
    """Records of an instance are in the order in which they were accepted, each one better."""
    library = Library()
    for entry in library.entries:
        plans = [r.value for r in library.records(entry.name) if r.kind == "plan"]
        bounds = [r.value for r in library.records(entry.name) if r.kind == "bound"]
        assert plans == sorted({*plans}) and bounds == sorted({*bounds}, reverse=True)
        assert not (plans and bounds) or plans[-1] <= bounds[-1]


SMALL = ("tiny-hover-0", "tiny-head-on-0", "tiny-hidden-0", "corridor-0", "corridor-1000")


@pytest.mark.parametrize("name", SMALL)
def test_small_stored_records_are_accepted_again(name: str) -> None:
    """The checker says of each stored file what its record has."""
    library = Library()
    records = library.records(name)
    assert records
    for record in records:
        library.recheck(record)


# The program `cocap-check-verified`, if bounds are to be checked by it, too.
VERIFIED = Path(os.environ["COCAP_OPT_VERIFIED"]) if "COCAP_OPT_VERIFIED" in os.environ else None
# Checks of these take minutes of CPU time.
HARD = {
    "crowd-16-1000", "field-1", "field-1000", "field-1001", "field-long-0", "field-views2-0",
    "field-views2-1000",
}  # fmt: skip


@pytest.mark.long(seconds=10)
@pytest.mark.parametrize("name", [entry.name for entry in Library().entries])
def test_all_stored_records_are_accepted_again(name: str) -> None:
    """The same of all; those by reference where their files are there."""
    if name in HARD and os.environ.get("COCAP_OPT_RECORDS") != "all":
        pytest.skip("takes minutes (COCAP_OPT_RECORDS=all)")
    library = Library()
    entry = library.entry(name)
    folder = folder_of(entry.family.name) if entry.is_by_reference else None
    if entry.is_by_reference and folder is None:
        pytest.skip(f"needs {entry.family.source} in the data folder (COCAP_OPT_DATA)")
    for record in library.records(name):
        library.recheck(record, folder, verified=VERIFIED)


def folder_of(family: str) -> Path | None:
    """Where files of others are, in the layout of the data folder; None without them."""
    if family.startswith("greedy-perspectives-"):
        folder = OTHERS / "greedy_perspectives" / family.removeprefix("greedy-perspectives-")
    elif family.startswith("movingai-"):
        folder = OTHERS / "movingai"
    else:
        folder = OTHERS / "hughes" / "published" / "split_and_join"
    return folder if folder.is_dir() else None


# -- commands --------------------------------------------------------------------------------


def test_a_scene_by_reference_must_be_the_one_that_is_published(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without its files the answer says where they are; with others that they are not the same."""
    name = "greedy-perspectives-corridor-0"
    get = ["library", "get", name, "-o", str(tmp_path / "out")]
    assert commands.run(get) == 2
    assert "https://github.com/GreedyPerspectives" in capsys.readouterr().err
    for file in ("map.npy", "seq.yaml", "starts.csv"):
        (tmp_path / file).write_bytes(b"1")
    assert commands.run([*get, "--from", str(tmp_path)]) == 2
    assert "is not the file that the library lists" in capsys.readouterr().err


def test_a_scene_by_reference_is_got_with_its_files(tmp_path: Path) -> None:
    """With the published files, `get` writes what it writes of any other."""
    folder = data("greedy_perspectives/corridor/seq.yaml").parent
    name = "greedy-perspectives-corridor-0"
    get = ["library", "get", name, "-o", str(tmp_path), "--from", str(folder)]
    assert commands.run(get) == 0
    assert len([*tmp_path.iterdir()]) == 4


@pytest.mark.slow
def test_what_is_got_is_accepted_by_the_checker(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`get` writes scene, instance, plan and certificate, which prove what `status` tells."""
    assert commands.run(["library", "get", "corridor-0", "-o", str(tmp_path)]) == 0
    capsys.readouterr()
    assert commands.run(["library", "status", "corridor-0", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    instance = tmp_path / "corridor-0.instance"
    for kind, field in (("plan", "reward"), ("certificate", "bound")):
        path = tmp_path / f"corridor-0.{kind}.json"
        assert proved(instance, path.read_bytes(), "file").value == told[field]
    scene = tmp_path / "corridor-0.scene.json"
    assert commands.run(["verify", str(scene), str(tmp_path / "corridor-0.plan.json")]) == 0


def test_what_is_got_unchecked_is_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--unchecked` calls no checker, and writes the same files."""
    assert commands.run(["library", "get", "corridor-0", "-o", str(tmp_path / "checked")]) == 0
    assert capsys.readouterr().err.count("again (--unchecked skips this)") == 2
    monkeypatch.delattr(Library, "recheck")
    get = ["library", "get", "corridor-0", "-o", str(tmp_path / "unchecked"), "--unchecked"]
    assert commands.run(get) == 0
    assert capsys.readouterr().err == ""
    for path in (tmp_path / "checked").iterdir():
        assert (tmp_path / "unchecked" / path.name).read_bytes() == path.read_bytes()


def test_the_table_fits_into_a_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`status --all` prints 80 columns, a line for each instance, and --csv all that is known."""
    monkeypatch.setenv("COLUMNS", "80")
    assert commands.run(["library", "status", "--all"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    named = [line.split()[0] for line in lines if line.strip()]
    assert {entry.name for entry in Library().entries} <= {*named}
    assert commands.run(["library", "status", "--csv"]) == 0
    table = capsys.readouterr().out.splitlines()
    assert len(table) == len(Library().entries) + 1


def test_what_is_open_comes_first(capsys: pytest.CaptureFixture[str]) -> None:
    """`status` says how many are solved, and lists the others alone, the largest gap first."""
    assert commands.run(["library", "status"]) == 0
    out = capsys.readouterr().out
    lines = [line.split() for line in out.splitlines() if line.strip()]
    standings = Library().standings()
    left = [found for found in standings if found.state != "solved"]
    begins = f"Library, version {Library().version}: {in_words(standings)}."
    assert " ".join(out.split()).startswith(begins)  # in lines of any width
    named = [line[0] for line in lines if line[-1] in ("open", "none")]
    assert sorted(named) == sorted(found.entry.name for found in left)
    gaps = [Library().standing(name).gap for name in named]
    assert gaps == sorted(gaps, reverse=True)
    assert "--all" in out
    assert commands.run(["library", "status", "corridor-0", "--all"]) == 2
    assert capsys.readouterr().err == "cocap-opt: --all: lists all instances; leave out NAME\n"


def test_a_library_of_which_nothing_is_known_is_listed(
    empty: Library, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without plan, bound or even a digest an instance is not solved, and is no error."""
    assert commands.run(["library", "status", "--library", str(empty.folder)]) == 0
    out = capsys.readouterr().out
    assert all(entry.name in out for entry in empty.entries)


def test_submit_answers_in_a_line(empty: Library, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 0 for what is accepted and 2, with a line, for what is refused."""
    submit = ["library", "submit", "--library", str(empty.folder), "--who", "Ada"]
    assert commands.run([*submit, str(empty.folder / GOOD[0]), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["accepted"] == "plan 27.000000"
    assert commands.run([*submit, str(empty.folder / GOOD[0])]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert commands.run(["library", "status", "nowhere-0"]) == 2
    assert "is not an instance" in capsys.readouterr().err


def test_a_page_has_records_player_and_how_to_cite(tmp_path: Path) -> None:
    """The page of an instance needs nothing else, also where there is no plan."""
    path = tmp_path / "page.html"
    for name in ("corridor-0", "tiny-head-on-0"):
        assert commands.run(["library", "page", name, "-o", str(path)]) == 0
        text = path.read_text()
        assert name in text and "How to cite" in text
        # All records are of one day, of which no curve is drawn.
        assert len({record.date for record in Library().records(name)}) == 1
        assert "data:image/svg+xml" not in text
        assert ("<iframe" in text) == (name == "corridor-0")
        solved = "&quot;optimal&quot;:true"  # as the player has it
        assert (solved in text) == (name == "corridor-0")
        assert Library().digests()[name].digest in text
