"""The tutorials are run as they are written: Python, recipe, commands, output, messages."""

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pages import DOCS, ROOT, blocks
from test_cli import Run

PAGE = DOCS / "how-to" / "from-a-map-to-a-flight.md"
SHORTEST = DOCS / "how-to" / "shortest-recipe.md"
REFUSED = DOCS / "how-to" / "refused.md"
RESEARCH = DOCS / "tutorials" / "research.md"
SHOW, FLY = "show scene.toml -o bad.html", "fly scene.toml plan.json --smooth -o bad.csv"


def in_words(text: str) -> list[str]:
    """Lines of a text with single blanks, so that the widths of columns do not matter.

    Nor does it matter whether notes are a list, which depends on how many there are.
    """
    lines = (" ".join(line.split()).removeprefix("- ") for line in text.splitlines())
    return [line for line in lines if line]


class Reader:
    """Someone who does all that a page says, in the current folder."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.capsys = capsys
        self.printed: list[str] = []  # by the last block of commands

    def follow(self, language: str, text: str) -> None:
        """Do what a block says, or compare what it shows."""
        todo: dict[str, Callable[[str], None]] = {
            "python": self.python, "toml": self.recipe, "sh": self.commands, "text": self.output,
        }  # fmt: skip
        todo[language](text)

    def python(self, text: str) -> None:
        """Run Python."""
        exec(compile(text, "page", "exec"), {})

    def recipe(self, text: str) -> None:
        """Save a file, whose first line is its name."""
        Path(text.splitlines()[0].removeprefix("# ")).write_text(text)

    def commands(self, text: str) -> None:
        """Run commands, which must succeed."""
        self.printed = []
        for line in text.splitlines():
            name, *words = shlex.split(line)
            run = Run(self.capsys, *words)
            assert (name, run.code) == ("cocap-opt", 0), f"{line}: {run.err}"
            self.printed += in_words(run.out)

    def output(self, text: str) -> None:
        """Find lines, or their beginnings, among those printed last, in their order."""
        rest = iter(self.printed)
        for line in in_words(text):
            found = any(printed.startswith(line) for printed in rest)
            assert found, f"{line!r} is not in the output: {self.printed}"


def swapped(file: str, old: str, new: str) -> Callable[[], None]:
    """Returns what replaces something in a file."""

    def swap() -> None:
        text = Path(file).read_text()
        assert old in text
        Path(file).write_text(text.replace(old, new))

    return swap


def straight(old: str, new: str) -> Callable[[], None]:
    """Returns what replaces something in the recipe, whose plans are then flown straight."""

    def swap() -> None:
        swapped("scene.toml", old, new)()
        swapped("scene.toml", "steps = 5", 'flown = "straight"\nsteps = 5')()

    return swap


def told(**tags: Any) -> Callable[[], None]:
    """Returns what changes attributes of the map, such as its system of coordinates."""

    def tell() -> None:
        import rasterio

        with rasterio.open("houses.tif", "r+") as file:
            for name, value in tags.items():
                setattr(file, name, value)

    return tell


def walled(x: float, y: float, side: float) -> Callable[[], None]:
    """Returns what puts a recipe without a place in the scene's place: a wall on a flat map."""

    def wall() -> None:
        ring = f"{x} {y}, {x + side} {y}, {x + side} {y + side}, {x} {y}"
        system = "SRID=4326;" if side < 1 else ""  # of degrees
        Path("walls.wkt").write_text(f"{system}POLYGON (({ring}))")
        Path("scene.toml").write_text(
            'steps = 2\n[map]\nsize = [9, 9]\n[[walls]]\nfile = "walls.wkt"\nheight = 2\n'
            'polygons = "obstacles"\n[[drones]]\nstarts = [{ x = 2, y = 2 }]\n'
        )

    return wall


INPUTS = ("scene.toml", "houses.tif", "people.csv", "plan.json")
# For each message of the page's table: the last of these commands says it when this is wrong.
WRONG: dict[str, tuple[str, Callable[[], None]]] = {
    "must be metres of a projection, not degrees": (SHOW, told(crs="EPSG:4326")),
    "need [earth] in the recipe": (SHOW, walled(13.059, 52.401, 0.0001)),
    "origin = ": (SHOW, walled(505000, 4790000, 5)),
    "coordinates: must be metres, not US survey foot": (SHOW, told(crs="EPSG:2263")),
    "heights: must be in m, cm, mm, ft, us-ft": (SHOW, told(units=("fathom",))),
    "unit: must be given, as the file does not state it": (
        SHOW, swapped("people.csv", "x [m],y [m]", "x,y"),
    ),
    "must be slower than": (SHOW, swapped("people.csv", "2,0.0,505024.0", "2,0.0,505924.0")),
    "cell (13, 15) is blocked: height 7 m, flight height 5 m": (
        SHOW.replace("show", "plan").replace("html", "json"),
        swapped("scene.toml", "x = 505018.5, y = 4790013.5", "x = 505013.5, y = 4790015.5"),
    ),
    "motion.radius: must allow at most 1 m/s": (
        SHOW, straight("endurance = 1200", "speed = 1"),
    ),
    "cannot fly this: acceleration": (
        f"plan scene.toml --planner cocap-lns -o plan.json; {FLY}",
        straight("endurance = 1200", "endurance = 1200, acceleration = 1"),
    ),
    "comes closer than 4.5 m to id 2 (1)": (
        f"plan scene.toml --planner sequential -o plan.json; {FLY}",
        straight("people = 3 ", "people = 4.5 "),
    ),
    "items, more than the 9 that PX4 takes": (
        "fly scene.toml plan.json --items 9 -o bad.plan", lambda: None,
    ),
    "cannot fly this mission: from the take-off": (
        "plan scene.toml --planner sequential -o plan.json; "
        "fly scene.toml plan.json -o bad.plan",
        swapped("scene.toml", "endurance = 1200", "endurance = 20"),
    ),
    "--smooth: must be left out, as waypoints have straight legs": (
        FLY.replace("bad.csv", "bad.plan"), lambda: None,
    ),
}  # fmt: skip


@pytest.mark.slow(seconds=9)
def test_the_how_tos_run_as_they_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their blocks work one after the other; messages come as the table of refusals quotes them."""
    pytest.importorskip("rasterio")
    pytest.importorskip("pyproj")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")  # the page's lines are not folded
    reader = Reader(capsys)
    for page in (SHORTEST, PAGE):
        for language, text in blocks(page.read_text(encoding="utf-8")):
            reader.follow(language, text)
    quoted = re.findall(r"^\| `(.+?)` \|", REFUSED.read_text(encoding="utf-8"), re.MULTILINE)
    assert quoted == list(WRONG)
    kept = {name: Path(name).read_bytes() for name in INPUTS}
    for words, (commands, spoil) in WRONG.items():
        spoil()
        *_, run = [Run(capsys, *command.split()) for command in commands.split("; ")]
        assert (run.code, words in run.err) == (2, True), (words, run.err)
        assert not list(Path().glob("bad*"))
        for name, content in kept.items():
            Path(name).write_bytes(content)


@pytest.mark.slow(seconds=9)
def test_the_research_tutorial_runs_as_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its blocks work one after the other, and print the numbers that the page shows."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")  # the page's lines are not folded
    reader = Reader(capsys)
    for language, text in blocks(RESEARCH.read_text(encoding="utf-8")):
        reader.follow(language, text)
    for name in ("gaps.pdf", "table.tex", "report.html", "scene.html"):
        assert Path(name).stat().st_size > 0


def test_the_how_to_can_be_found() -> None:
    """The README leads to it."""
    name = PAGE.relative_to(ROOT).as_posix()
    assert f"]({name})" in (ROOT / "README.md").read_text(encoding="utf-8")
