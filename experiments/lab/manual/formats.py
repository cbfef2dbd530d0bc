"""The page of file formats: each document's fields, its JSON Schema, and an example."""

import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from cocap_opt.experiments.sweeps.results import RunFile
from cocap_opt.files.documents import Document, PlanFile, SceneFile, encode, problem_digest
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.output.files import read_text
from cocap_opt.run.engine import run
from cocap_opt.scenarios import load_scene

DOCUMENTS: Mapping[str, type[Document]] = {
    "scene": SceneFile, "plan": PlanFile, "certificate": CertificateFile, "proof": ProofFile,
    "run": RunFile,
}  # fmt: skip


class _Page(NamedTuple):
    """The parts of a document that a page shows, from a first one to a last one.

    Attributes
    ----------
    first, last : names of the first and the last part; None for the first and last of all
    beside : documents whose parts are on other pages, and not shown again
    """

    document: str
    first: str | None = None
    last: str | None = None
    beside: tuple[str, ...] = ()

    def parts(self) -> dict[str, Mapping[str, Any]]:
        """Returns the name and schema of each part."""
        every = schema(DOCUMENTS[self.document])["$defs"]
        names = list(every)
        first = 0 if self.first is None else names.index(self.first)
        last = len(names) if self.last is None else names.index(self.last) + 1
        shown = {title for name in self.beside for title in schema(DOCUMENTS[name])["$defs"]}
        return {title: every[title] for title in names[first:last] if title not in shown}


PAGES: Mapping[str, _Page] = {
    "scene": _Page("scene", last="Limits"),
    "scene_people": _Page("scene", first="Actor"),
    "plan": _Page("plan", beside=("scene",)),
    "certificate": _Page("certificate", last="ReferencePixels", beside=("scene",)),
    "staged": _Page("certificate", first="Staged", beside=("scene",)),
    "proof": _Page("proof", beside=("scene", "certificate")),
    "run": _Page("run"),
}
_THREE_PLACES = Path(__file__).resolve().parents[3] / "docs" / "reference" / "three-places"
_EXAMPLE = "tiny-approach"  # the smallest scene
_ARRAY = {"type": "array", "items": {"type": "array", "items": {"type": "number"}}}


def _json(name: str) -> str:
    return f"```json\n{example(name).strip()}\n```"


def _three_places(name: str, language: str) -> str:
    """Returns a file of the instance that is worked through by hand, as a block of code."""
    return f"```{language}\n{read_text(_THREE_PLACES / name).strip()}\n```"


def schema(kind: type[Document]) -> dict[str, Any]:
    """Returns the JSON Schema of a document; arrays of numbers have two axes."""
    return msgspec.json.schema(kind, schema_hook=lambda _: _ARRAY)


def schemas() -> dict[str, str]:
    """Returns the JSON Schema of each document, by the name of its file."""
    texts = {name: msgspec.json.encode(schema(kind)) for name, kind in DOCUMENTS.items()}
    return {
        f"{name}.json": msgspec.json.format(text).decode() + "\n" for name, text in texts.items()
    }


def fields_in_markdown(name: str) -> str:
    """Returns a table of the fields of each part of a document that a page shows."""
    return "\n\n".join(_part(title, part) for title, part in PAGES[name].parts().items())


def _part(title: str, part: Mapping[str, Any]) -> str:
    about, meanings = _told(part.get("description", ""))
    if "properties" not in part:
        return f"**{title}** is {_kind(part)}. {about}"
    required = part.get("required", ())
    rows = [
        f"| `{name}` | {_kind(field)} | {_default(name, field, required)} "
        f"| {meanings.get(name, '')} |"
        for name, field in part["properties"].items()
    ]
    table = "\n".join(["| field | type | default | meaning |", "|---|---|---|---|", *rows])
    return f"**{title}**: {about}\n\n{table}"


def _told(docstring: str) -> tuple[str, dict[str, str]]:
    """Returns the first paragraph of a docstring, and the meaning of each attribute."""
    first, _, rest = docstring.partition("\n\n")
    _, _, attributes = rest.partition("----------\n")
    found = re.findall(r"(?ms)^ *([\w, ]+) : (.*?)(?=^ *[\w, ]+ : |\n\n|\Z)", attributes)
    meanings = {
        name.strip(): " ".join(words.split()).replace("|", "\\|")
        for names, words in found
        for name in names.split(",")
    }
    return " ".join(first.split()), meanings


def _default(name: str, field: Mapping[str, Any], required: object) -> str:
    assert isinstance(required, tuple | list)
    if name in required:
        return "required"
    default = field.get("default")
    return "" if default is None or isinstance(default, dict | list) else f"`{default}`"


def _kind(field: Mapping[str, Any]) -> str:
    """Describes what a field of a JSON Schema may contain."""
    if "$ref" in field:
        return str(field["$ref"]).removeprefix("#/$defs/")
    if "anyOf" in field:
        return " or ".join(dict.fromkeys(map(_kind, field["anyOf"])))
    if "enum" in field:
        return " or ".join(f"`{word}`" for word in field["enum"])
    if field.get("type") == "array":
        return _array(field)
    return str(field.get("type", "anything")) + "".join(_range(field))


def _array(field: Mapping[str, Any]) -> str:
    if "prefixItems" in field:
        return f"[{', '.join(map(_kind, field['prefixItems']))}]"
    return f"array of {_kind(field['items'])}"


def _range(field: Mapping[str, Any]) -> Iterator[str]:
    words = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
    for key, sign in words.items():
        if key in field:
            yield f" {sign} {field[key]:g}"


def example(name: str) -> str:
    """Returns a small document of a kind, as the project writes it, but with arrays on one line."""
    text = encode(_example(name)).decode()
    return re.sub(r"\[\s*([^\[\]{}\"]*?)\s*\]", lambda m: f"[{' '.join(m[1].split())}]", text)


def _example(name: str) -> msgspec.Struct:
    problem = load_scene(_EXAMPLE)
    if name == "scene":
        return SceneFile.of(problem)
    if name == "certificate":
        found: CertificateFile = run(problem, "alone").result.certificate
        return found
    result = run(problem, "greedy").result
    assert result.plan is not None
    return PlanFile(
        scene=problem.name, digest=problem_digest(problem), planner="greedy", reward=result.value,
        plan=result.plan,
    )  # fmt: skip


FORMATS: Mapping[str, Callable[[], str]] = {
    **{f"{name}_fields": partial(fields_in_markdown, name) for name in PAGES},
    **{f"{name}_example": partial(_json, name) for name in ("scene", "plan", "certificate")},
    "three_places_instance": partial(_three_places, "three-places.instance", "text"),
    **{
        f"three_places_{name}": partial(_three_places, f"{name}.json", "json")
        for name in ("plan", "multipliers", "cuts", "stages")
    },
}
