"""The folder of a trade-off: plans, and the bounds that prove its half-planes.

Each bound's file has the objective of its direction, so that `cocap-opt verify` checks it with the
scene. What is read is checked again: a bound by its certificate, a plan by the referee.
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
_SCENE = "direction-{}.scene.json"  # that bounds had beside them before they named an objective
TABLE = "front.csv"


def save(front: Front, folder: Path) -> None:
    """Writes a trade-off's files; those of more plans or bounds than there are now are removed."""
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
    """Returns a trade-off with all that its folder holds; with nothing more if there is none.

    Raises
    ------
    FileError
        If a file is damaged, of another scene, or its bound is not proved.
    LimitReached
        At a limit.
    """
    planes, watch = [], watch or Watch()
    paths = [*_numbered(folder, _BOUND)]
    for number, path in enumerate(paths, 1):
        watch.begin(f"{front.problem.name}, bound {number} of {len(paths)} is checked")
        file = decode_document(read_bytes(path), str(path), CertificateFile, ProofFile)
        assert isinstance(file, CertificateFile | ProofFile)
        if (folder / path.name.replace(".bound.", ".scene.")).exists():
            raise FileError(
                f"{path}: is from an older version, with a scene beside it; remove both"
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
            raise FileError(f"{path}: is a plan for another scene")
        try:
            obeys_rules = check(front.problem, found.plan).valid
        except ValueError as error:
            raise FileError(f"{path}: {error}") from error
        if not obeys_rules:
            raise FileError(f"{path}: is a plan that breaks a rule; remove it to go on")
        plans.append(found.plan)
    return replace(front, half_planes=(*front.half_planes, *planes)).with_plans(plans)


def _direction(front: Front, scene: Problem, path: Path) -> Direction:
    """Returns the direction that a scene is of."""
    views = scene.objective.views
    if views is None:
        raise FileError(f"{path}: must be a direction of the trade-off")
    weight = max(views.weights(len(scene.actors)), default=0.0)
    direction = Direction(1.0, weight) if scene.objective.pixels else VIEWS_ALONE
    if problem_digest(front.scene(direction)) != problem_digest(scene):
        raise FileError(f"{path}: is a direction of another scene, number of cameras or share")
    return direction


def _numbered(folder: Path, name: str) -> Iterator[Path]:
    """Yields the files of a name in the order of their numbers."""
    before, _, after = name.partition("{}")
    found = {}
    for path in folder.glob(name.format("*")):
        number = path.name.removeprefix(before).removesuffix(after)
        if number.isascii() and number.isdecimal():
            found[int(number)] = path
    yield from (found[number] for number in sorted(found))
