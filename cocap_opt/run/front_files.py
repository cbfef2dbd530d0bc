"""The folder of a trade-off: its plans, and the certificates that prove its half-planes.

Each certificate file contains the objective of its direction, so `cocap-opt verify` can check it
with the scene. Files are checked again when they are read: a bound by its certificate, a plan by
the referee.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from cocap_opt.console.progress import Watch
from cocap_opt.files.documents import (
    FileError,
    PlanFile,
    decode_document,
    encode,
    problem_digest,
    read_bytes,
)
from cocap_opt.formulations.certificates import (
    CertificateError,
    CertificateFile,
    ProofFile,
    verify,
)
from cocap_opt.output.files import make_folder, save_csv, save_files
from cocap_opt.problem import Problem
from cocap_opt.referee import check
from cocap_opt.run.front import VIEWS_ALONE, Direction, Front, HalfPlane
from cocap_opt.stop import Stop, never

_BOUND, _PLAN = "direction-{}.bound.json", "plan-{}.json"
_SCENE = "direction-{}.scene.json"  # scene files that older versions wrote beside their bounds
TABLE = "front.csv"


def save(front: Front, folder: Path) -> None:
    """Writes the files of a trade-off; removes plans and bounds with higher numbers."""
    make_folder(folder)
    contents: dict[Path, bytes] = {}
    for n, certificate in enumerate(filter(None, map(front.file, front.half_planes)), 1):
        contents[folder / _BOUND.format(n)] = encode(certificate)
    for n, point in enumerate(front.plans, 1):
        reward = check(front.problem, point.plan).reward
        file = PlanFile.of(front.problem, point.plan, reward, planner="front")
        contents[folder / _PLAN.format(n)] = encode(file)
    save_files(contents)
    for name in (_BOUND, _PLAN, _SCENE):
        for old in _numbered(folder, name):
            if old not in contents:
                old.unlink()
    rows = front.rows()
    keys = list(dict.fromkeys(key for row in rows for key in row))
    save_csv(folder / TABLE, [{key: row.get(key, "") for key in keys} for row in rows])


def read(front: Front, folder: Path, stop: Stop = never, watch: Watch | None = None) -> Front:
    """Returns a trade-off extended by everything in its folder, if the folder exists.

    Raises
    ------
    FileError
        If a file is damaged or belongs to another scene, or if its bound is not proved.
    LimitReached
        If a limit is reached.
    """
    planes, watch = [], watch or Watch()
    paths = [*_numbered(folder, _BOUND)]
    for number, path in enumerate(paths, 1):
        watch.begin(f"{front.problem.name}: checking bound {number} of {len(paths)}")
        file = decode_document(read_bytes(path), str(path), CertificateFile, ProofFile)
        assert isinstance(file, CertificateFile | ProofFile)
        if (folder / path.name.replace(".bound.", ".scene.")).exists():
            raise FileError(
                f"{path}: written by an older version; remove it and the scene beside it"
            )
        try:
            direction = _direction(front, file.problem_of(front.problem), path)
            bound = verify(front.problem, file, stop=stop).bound
        except CertificateError as error:
            raise FileError(f"{path}: {error}") from error
        planes.append(HalfPlane(direction, bound, file))
    plans = []
    for path in _numbered(folder, _PLAN):
        found = decode_document(read_bytes(path), str(path), PlanFile)
        if found.digest != problem_digest(front.problem):
            raise FileError(f"{path}: the plan is for another scene")
        try:
            obeys_rules = check(front.problem, found.plan).valid
        except ValueError as error:
            raise FileError(f"{path}: {error}") from error
        if not obeys_rules:
            raise FileError(f"{path}: the plan breaks a rule; remove the file to continue")
        plans.append(found.plan)
    return replace(front, half_planes=(*front.half_planes, *planes)).with_plans(plans)


def _direction(front: Front, scene: Problem, path: Path) -> Direction:
    """Returns the direction to which a scene belongs."""
    views = scene.objective.views
    if views is None:
        raise FileError(f"{path}: must belong to a direction of the trade-off")
    weight = max(views.weights(len(scene.actors)), default=0.0)
    direction = Direction(1.0, weight) if scene.objective.pixels else VIEWS_ALONE
    if problem_digest(front.scene(direction)) != problem_digest(scene):
        raise FileError(f"{path}: belongs to another scene, number of cameras or share")
    return direction


def _numbered(folder: Path, name: str) -> Iterator[Path]:
    """Yields the files with a name pattern, in numerical order."""
    before, _, after = name.partition("{}")
    found = {}
    for path in folder.glob(name.format("*")):
        number = path.name.removeprefix(before).removesuffix(after)
        if number.isascii() and number.isdecimal():
            found[int(number)] = path
    yield from (found[number] for number in sorted(found))
