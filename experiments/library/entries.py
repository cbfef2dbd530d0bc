"""The list of the library's instances, and how each of them is made.

A family in `instances.toml` is a scene with changes to it, and seeds for training and for tests.
Most files of other projects are not in the library: a family has their names, their SHA-256 and
where they are published, and users who have downloaded them pass the folder.
"""

import hashlib
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError, read_bytes
from cocap_opt.output.files import read_text
from cocap_opt.problem import Problem
from cocap_opt.run.start_sets import with_free_starts
from cocap_opt.scenarios import load_scene, variants
from cocap_opt.scenarios.built_in.field import field
from cocap_opt.text import counted

DATA = Path(__file__).parent / "data"
LIST = "instances.toml"
FIRST_TEST_SEED = 1000  # for scenes with unlimited seeds; smaller seeds are for training

_Seeds = tuple[Annotated[int, msgspec.Meta(ge=0)], ...]


class Source(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file that a scene is made from.

    Attributes
    ----------
    name : of the file, in the folder of the scene
    sha256 : of its content
    """

    name: str
    sha256: str


class Field(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The size of a scene like `field`: drones, people, cells along each edge, and steps."""

    robots: int
    actors: int
    cells: int
    steps: int


class Family(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Scenes that differ only in their seed.

    Attributes
    ----------
    name : of the family; an instance's name is this with "-" and its seed
    scene : name of a built-in scene, or of a file among `files`
    field : size of a field, in place of `scene`
    train, test : seeds for training and for tests; no seed is in both
    steps : number of steps after which the scene ends; None if it is not shortened
    views : number of drones that should see each person; None if views are not counted
    free_starts : True if drones may start anywhere
    over_time : True if pixels add up over time, too
    options : how a file is read
    files : files that the scene needs
    source : where the files are published; empty if no files are needed
    licence : licence of the files
    ships : True if the files are in the library's folder
    """

    name: str
    scene: str = ""
    field: Field | None = None
    train: _Seeds = ()
    test: _Seeds = ()
    steps: int | None = None
    views: int | None = None
    free_starts: bool = False
    over_time: bool = False
    options: dict[str, str] = {}
    files: tuple[Source, ...] = ()
    source: str = ""
    licence: str = ""
    ships: bool = False

    def problem(self, seed: int, folder: Path | None) -> Problem:
        """Makes the scene of a seed; `folder` contains the files, if it needs any."""
        if self.field is not None:
            size = self.field
            made = field(seed, size.robots, size.actors, size.cells, size.steps)
        elif folder is None:
            made = load_scene(self.scene, seed, self.options)
        else:
            made = load_scene(str(folder / self.scene), seed, self.options)
        if self.steps is not None:
            made = made.until(self.steps)
        if self.free_starts:
            made = with_free_starts(made)
        if self.over_time:
            made = variants.over_time(made)
        if self.views is not None:
            made = variants.counting_views(made, self.views)
        return made


class Entry(msgspec.Struct, frozen=True):
    """An instance of the library.

    Attributes
    ----------
    name : of the instance
    seed : of its scene
    split : train or test: its use, for training or for tests
    """

    family: Family
    seed: int
    split: Literal["train", "test"]

    @property
    def name(self) -> str:
        """The name of the instance."""
        return f"{self.family.name}-{self.seed}"

    @property
    def is_by_reference(self) -> bool:
        """True if it needs files that are not in the library."""
        return bool(self.family.files) and not self.family.ships

    @property
    def recipe(self) -> str:
        """A description of how the scene is made."""
        made = self.family
        size = made.field
        words = [f"scene {made.scene}" if size is None else "scene field", f"seed {self.seed}"]
        if size is not None:
            words += [counted(size.robots, "drone"), counted(size.actors, "person")]
            words += [f"{size.cells} cells", counted(size.steps, "step")]
        words += [f"option {name}={value}" for name, value in made.options.items()]
        words += [] if made.steps is None else [counted(made.steps, "step")]
        words += ["free starts"] if made.free_starts else []
        words += ["pixels add up over time"] if made.over_time else []
        words += [] if made.views is None else [f"views by {made.views} drones"]
        return ", ".join(words)

    def problem(self, library: Path, folder: Path | None = None) -> Problem:
        """Makes the scene.

        Parameters
        ----------
        library : folder of the library's data
        folder : the user's folder with files that are not in the library

        Raises
        ------
        FileError
            If files are missing or differ from the listed ones, or make no scene; one line.
        """
        family = self.family
        if family.ships:
            folder = library / "maps"
        if family.files and folder is None:
            names = ", ".join(file.name for file in family.files)
            raise FileError(f"{self.name}: --from: name the folder with {names}; {family.source}")
        try:
            if not family.files or folder is None:
                return family.problem(self.seed, None)
            with tempfile.TemporaryDirectory() as place:  # copies cannot change after the check
                # The folder is named as published, as some scenes take their name from it.
                copies = Path(place) / family.source.rpartition("/")[2]
                for file in family.files:
                    self._copy(file, folder, copies)
                return family.problem(self.seed, copies)
        except ProblemError as error:
            raise FileError(f"{self.name}: {error}") from error

    def _copy(self, file: Source, folder: Path, into: Path) -> None:
        """Copies a file, after checking its SHA-256."""
        content = read_bytes(folder / file.name)
        if hashlib.sha256(content).hexdigest() != file.sha256:
            words = f"is not the file that the library lists; get it from {self.family.source}"
            raise FileError(f"{folder / file.name}: {words}")
        target = into / file.name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)


class _List(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole list.

    Attributes
    ----------
    version : of the library; it changes when an instance is added or made differently
    """

    version: str
    family: tuple[Family, ...]


def read_list(library: Path = DATA) -> tuple[str, tuple[Entry, ...]]:
    """Returns the version of a library and its instances, in the order of the list.

    Raises
    ------
    FileError
        If the list cannot be used; one line.
    """
    path = library / LIST
    try:
        found = msgspec.convert(tomllib.loads(read_text(path)), _List)
    except (tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise FileError(f"{path}: {error}") from error
    entries = tuple(entry for family in found.family for entry in _entries(family))
    names = [entry.name for entry in entries]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise FileError(f"{path}: family: {twice}: must be listed only once")
    return found.version, entries


def _entries(family: Family) -> Iterator[Entry]:
    for seed in family.train:
        yield Entry(family, seed, "train")
    for seed in family.test:
        yield Entry(family, seed, "test")
