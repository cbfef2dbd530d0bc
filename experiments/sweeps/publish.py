"""The files that rows name: scene, plans, certificates and traces of one scene and seed.

They are written whenever a run takes their cells, be they computed or recalled, so they prove
what its rows say, whatever ran in the folder before.
"""

from collections.abc import Sequence
from pathlib import Path

from msgspec.structs import replace

from cocap_opt.experiments.results.files import remove, save_bytes
from cocap_opt.experiments.results.layout import certificate_path, plan_path, scene_path, trace_path
from cocap_opt.experiments.results.rows import Row, without_rules
from cocap_opt.experiments.sweeps.cells import FREE, RULES, CellFile
from cocap_opt.experiments.sweeps.run import Group
from cocap_opt.files.documents import SceneFile, encode

Files = dict[Path, bytes | None]  # None: there is to be none


def published(folder: Path, group: Group, rows: Sequence[Row]) -> list[Row]:
    """Write the files of a scene and seed that are whole; its rows, with certificates' names."""
    assert group.bound is not None
    files: Files = {scene_path(rows[0]): encode(SceneFile(problem=group.problem))}
    for row, cell in zip(rows, group.cells.values(), strict=True):
        plan = group.found[cell].plan
        files[plan_path(row)] = None if plan is None else encode(plan)
    named, proofs = _certificates(group, rows[0])
    files |= proofs | _traces(group.bound, rows[0])
    for path, content in files.items():
        _put(folder / path, content)
    group.bound = replace(group.bound, certificates={}, traces={})  # proofs can be large
    return [row | named for row in rows]


def _certificates(group: Group, row: Row) -> tuple[Row, Files]:
    """Columns that name the certificates, and their files."""
    assert group.bound is not None
    known = group.bound.certificates
    paths = {name: certificate_path(row, free=name == FREE) for name in (RULES, FREE)}
    files = {p: group.bound.certificate(n) if n in known else None for n, p in paths.items()}
    named = {name: path.as_posix() if name in known else "" for name, path in paths.items()}
    if without_rules(group.problem) is group.problem:  # one bound is both
        named[FREE] = named[RULES]
    return {"certificate": named[RULES], "certificate_free": named[FREE]}, files


def _traces(bound: CellFile, row: Row) -> Files:
    texts = {trace_path(row, free=name == FREE): bound.traces.get(name) for name in (RULES, FREE)}
    return {path: None if text is None else text.encode() for path, text in texts.items()}


def _put(path: Path, content: bytes | None) -> None:
    """Make a file have this content, or not be there."""
    if content is None:
        remove(path)
    elif not (path.is_file() and path.read_bytes() == content):
        save_bytes(path, content)
