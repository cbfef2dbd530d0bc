"""What is published: the sdist, the wheel that is made of it, and the files that describe both."""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import msgspec
import pytest
import yaml
from jsonschema import Draft7Validator

ROOT = Path(__file__).parents[2]
CHANGES = ROOT / "CHANGELOG.md"
PACKAGES = ("cocap_opt", "formulations", "scenarios", "experiments")
PUBLISHED = ("pyproject.toml", "setup.py", "README.md", "LICENSE", *PACKAGES)


def run(words: Sequence[object], folder: Path, seconds: float = 120, **environment: str) -> str:
    """Run a program, which must succeed; returns what it prints."""
    done = subprocess.run(
        [str(word) for word in words], cwd=folder, capture_output=True, text=True, timeout=seconds,
        check=False, env=os.environ | environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def install(wheel: Path, folder: Path) -> tuple[Path, dict[str, str]]:
    """Installs a wheel alone into a folder; returns its program, and the environment for it."""
    run([sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--no-compile",
         "--target", folder, wheel], folder.parent)  # fmt: skip
    cache = folder.parent / "cache"
    return folder / "bin" / "cocap-opt", {"PYTHONPATH": str(folder), "COCAP_OPT_CACHE": str(cache)}


def modules(text: str) -> list[str]:
    """Returns the lines of a notebook's cells that import something."""
    notebook = msgspec.json.decode(text)
    cells = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
    return [line for cell in cells for line in cell.splitlines() if re.match("import|from", line)]


def commands_of_readme() -> list[list[str]]:
    """The words after `cocap-opt` of each command in the README, in its order."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    lines = [shlex.split(line, comments=True) for block in blocks for line in block.splitlines()]
    return [
        words[k + 1 :]
        for words in lines
        for k, word in enumerate(words)
        if word.rpartition("/")[2] == "cocap-opt"
    ]


# Endings of files that are code, looks or data.
SHIPPED = (
    ".py", ".js", ".css", ".html", ".mplstyle", ".csv", ".gz", ".toml", ".asc", ".geojson", ".prj",
    ".md", ".txt",
)  # fmt: skip


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built of the sdist, which is built of what is published."""
    folder = tmp_path_factory.mktemp("wheel")
    source, built = folder / "source", folder / "built"
    source.mkdir()
    for name in PUBLISHED:
        path = ROOT / name
        if path.is_dir():
            shutil.copytree(path, source / name, symlinks=True,
                            ignore=shutil.ignore_patterns("__pycache__"))  # fmt: skip
        else:
            shutil.copy(path, source / name)
    run([sys.executable, "-m", "build", "-q", "--no-isolation", "-o", built], source)
    (made,) = built.glob("*.whl")
    assert len(list(built.glob("*.tar.gz"))) == 1
    return made


@pytest.mark.slow(seconds=9)
def test_the_wheel_works_without_the_repository(wheel: Path, tmp_path: Path) -> None:
    """Installed alone, without the lab, it plans, plays and measures."""
    within = {name for name in ZipFile(wheel).namelist() if name.startswith("cocap_opt/")}
    expected = {
        (path.relative_to(ROOT) if name == "cocap_opt" else "cocap_opt" / path.relative_to(ROOT))
        for name in PACKAGES
        for path in (ROOT / name).rglob("*")
        if path.is_file() and path.suffix in SHIPPED
    }
    lab = {path for path in expected if path.is_relative_to("cocap_opt/experiments/lab")}
    assert lab
    shipped = {path.as_posix() for path in expected - lab} | {"cocap_opt/py.typed"}
    assert shipped == within
    installed = tmp_path / "installed"
    command, alone = install(wheel, installed)
    run([command, "plan", "tiny-turn", "-o", "plan.json"], tmp_path, **alone)
    run([command, "show", "tiny-turn", "plan.json", "-o", "plan.html"], tmp_path, **alone)
    assert "</html>" in (tmp_path / "plan.html").read_text(encoding="utf-8")
    run([command, "gap", "tiny-turn", "--planner", "greedy", "--out", "sweep"], tmp_path, **alone)
    assert "study" not in run([command, "--help"], tmp_path, **alone)
    notebooks = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
    lines = [line for path in notebooks for line in modules(path.read_text(encoding="utf-8"))]
    assert len(lines) > 5
    lines = [line for line in lines if "experiments.lab" not in line]
    lines += ["import cocap_opt", "print(cocap_opt.__file__)"]
    found = run([sys.executable, "-c", "\n".join(lines)], tmp_path, **alone)
    assert Path(found.strip()) == installed / "cocap_opt" / "__init__.py"


@pytest.mark.slow(seconds=60)
def test_the_wheel_runs_every_command_of_the_readme(wheel: Path, tmp_path: Path) -> None:
    """In an empty folder, one after the other, as they stand; what measures the project is named.

    Only the number of seeds is cut to two, of what takes minutes.
    """
    command, alone = install(wheel, tmp_path / "installed")
    work = tmp_path / "work"
    work.mkdir()
    commands = commands_of_readme()
    assert {words[0] for words in commands} >= {"plan", "solve", "verify", "show", "gap"}
    for words in commands:
        run([command, *(word.replace("0-9", "0-1") for word in words)], work, 300, **alone)
    made = {path.name for path in work.iterdir()}
    assert made == {"plan.json", "best.json", "proof.json", "plans.html", "results"}
    studied = subprocess.run(
        [str(command), "study", "paper", "--out", "paper"], cwd=work, capture_output=True,
        text=True, timeout=60, check=False, env=os.environ | alone,
    )  # fmt: skip
    assert (studied.returncode, studied.stdout) == (2, "")
    (line,) = studied.stderr.splitlines()
    assert "study" in line and "repository" in line
    assert {path.name for path in work.iterdir()} == made


@pytest.mark.slow(seconds=9)
def test_the_page_on_pypi_has_no_relative_link(wheel: Path) -> None:
    """The wheel describes itself by the README, and each link and picture of that is absolute."""
    with ZipFile(wheel) as content:
        (name,) = (name for name in content.namelist() if name.endswith("METADATA"))
        metadata = content.read(name).decode()
    assert "Description-Content-Type: text/markdown" in metadata
    assert "proves how good each plan is" in metadata
    addresses = re.findall(r"\]\(([^)]*)\)", metadata)
    assert addresses and [each for each in addresses if not each.startswith("https://")] == []


def test_the_description_links_to_the_repository_where_its_address_is_known() -> None:
    """Files are those of the release; without an address words stay, pictures do not, and it says.

    Code stays as it is, also that of words of links.
    """
    described = runpy.run_path(str(ROOT / "setup.py"))["described"]
    code = "`[a](b.md)` ``c` [d](e.md)``\n```py\n![x](y.png) ` [p](q)\n```\n~~~\n[z](z)\n~~~"
    readme = (
        f"# T\n\n[![A](docs/a.webp)](docs/b.md) [c](docs/c.md#d) [e](https://e.org) ![f](f.png)\n"
        f"{code}\n[`g` h](g.md) `k` [l](l.md)"
    )
    at = "https://git.example/p"
    assert described("[![i](i.png)](https://i.org)", at, "1") == (
        f"[![i]({at}/raw/v1/i.png)](https://i.org)"
    )
    assert described(readme, f"{at}/", "1.0") == (
        f"# T\n\n[![A]({at}/raw/v1.0/docs/a.webp)]({at}/blob/v1.0/docs/b.md) "
        f"[c]({at}/blob/v1.0/docs/c.md#d) [e](https://e.org) ![f]({at}/raw/v1.0/f.png)\n"
        f"{code}\n[`g` h]({at}/blob/v1.0/g.md) `k` [l]({at}/blob/v1.0/l.md)"
    )
    title, note, *rest = described(readme, None, "1.0").split("\n\n")
    assert title == "# T" and "no public address" in note
    assert "\n\n".join(rest) == f" c [e](https://e.org) \n{code}\n`g` h `k` l"


def test_the_citation_is_valid() -> None:
    """CITATION.cff has the form of its format, version 1.2.0."""
    schema = msgspec.json.decode((ROOT / "tests" / "data" / "citation-schema.json").read_bytes())
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    citation["date-released"] = str(citation["date-released"])  # as the schema asks of readers
    assert [error.message for error in Draft7Validator(schema).iter_errors(citation)] == []
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
    assert citation.get("repository-code") == urls.get("Repository")


@pytest.mark.slow
def test_type_checkers_find_an_editable_install(tmp_path: Path) -> None:
    """It names the folder of the project in a .pth file, which they follow, unlike import hooks."""
    source, built = tmp_path / "source", tmp_path / "built"
    for name in PACKAGES:
        (source / name).mkdir(parents=True)
        (source / name / "__init__.py").touch()
    for name in PUBLISHED[:3]:
        shutil.copy(ROOT / name, source / name)
    built.mkdir()
    code = f"from setuptools.build_meta import build_editable; build_editable({str(built)!r})"
    run([sys.executable, "-c", code], source)
    (wheel,) = built.glob("*.whl")
    with ZipFile(wheel) as content:
        paths = [name for name in content.namelist() if name.endswith(".pth")]
        assert [content.read(name).decode().strip() for name in paths] == [str(source)]


def test_the_version_is_stated_once() -> None:
    """pyproject.toml has it, and the citation, its page and the changelog follow."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"]
    assert citation["title"] == project["name"]
    page = (ROOT / "docs" / "cite.md").read_text(encoding="utf-8")
    assert f"version = {{{project['version']}}}" in page
    heads = re.findall(r"^## (\S+)(?: \((\S+)\))?$", CHANGES.read_text(encoding="utf-8"), re.M)
    assert heads[0] == (project["version"], str(citation["date-released"]))


def test_pictures_are_drawn_by_the_release_that_tests_compare() -> None:
    """What writes the pages is the same in the extra that writes and in the one that compares."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert any(requirement.startswith("matplotlib") for requirement in extras["docs"])
    assert set(extras["docs"]) <= set(extras["test"])


def test_the_changelog_says_first_what_changes_numbers() -> None:
    """It goes by versions, and of each that has several sections numbers come first."""
    first = CHANGES.read_text(encoding="utf-8").split("\n## ")[1]
    assert re.findall(r"^### .*$", first, re.M)[0] == "### What changes numbers"
    assert "COVERAGE_VERSION" in first.split("### ")[1]


def workflow(name: str) -> dict[object, Any]:
    """Returns a workflow of GitHub's, in which `on` is a truth value."""
    text = (ROOT / ".github" / "workflows" / f"{name}.yml").read_text(encoding="utf-8")
    return dict(yaml.safe_load(text))


def test_the_workflow_runs_what_is_run_here() -> None:
    """It runs .ci/run on each Python that is stated, with the programs that tests need."""
    job = workflow("ci")["jobs"]["test"]
    lines = [line for step in job["steps"] for line in step.get("run", "").splitlines()]
    programs = [f"{name} --version" for name in ("chromium", "chromedriver", "coqc")]
    assert set(programs) <= set(lines[: lines.index(".ci/run")])
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    stated = re.findall(r"Python :: (3\.\d+)", "\n".join(project["classifiers"]))
    assert job["strategy"]["matrix"]["python"] == stated


def test_the_workflow_publishes_each_version() -> None:
    """Pages of all changes are built without warnings, in one job; those pushed are published.

    No run takes the place of one of another branch or tag that waits.
    """
    site = workflow("site")
    assert site[True] == {"push": {"branches": ["main"], "tags": ["v*"]}, "pull_request": None}
    assert "github.ref" in site["concurrency"]["group"]
    steps = site["jobs"]["site"]["steps"]
    assert any("sphinx -W" in step.get("run", "") for step in steps)
    assert not any("sphinx" in str(job) for job in workflow("ci")["jobs"].values())
    (publish,) = [step for step in steps if ".ci/publish" in step.get("run", "")]
    assert publish["if"] == "github.event_name == 'push'"


def add_version(built: Path, site: Path, name: str) -> None:
    """Adds pages whose `llms.txt` has the name."""
    (built / "llms.txt").write_text(f"- [{name}](_sources/index.md)")
    run([sys.executable, ROOT / ".ci" / "add_version.py", built, site, name], built.parent)


def test_versions_stand_beside_each_other(tmp_path: Path) -> None:
    """A new version leaves the others; the newest release is first for whoever comes.

    A candidate is older than its release, and first only while there is no release.
    """
    built, site = tmp_path / "built", tmp_path / "site"
    (built / ".doctrees").mkdir(parents=True)
    site.mkdir()
    firsts = {
        "latest": "latest", "v0.9.0rc1": "0.9.0rc1", "v0.9.0": "0.9.0", "v0.10.0": "0.10.0",
        "v1.0.0rc1": "0.10.0", "v1.0.0rc10": "0.10.0", "v1.0.0rc2": "0.10.0",
    }  # fmt: skip
    for name, first in firsts.items():
        add_version(built, site, name)
        assert f'url={first}/"' in (site / "index.html").read_text()
    add_version(built, site, "latest")
    assert msgspec.json.decode((site / "versions.json").read_bytes()) == [
        "latest", "1.0.0rc10", "1.0.0rc2", "1.0.0rc1", "0.10.0", "0.9.0", "0.9.0rc1",
    ]  # fmt: skip
    assert (site / "llms.txt").read_text() == "- [v0.10.0](0.10.0/_sources/index.md)"
    assert not (site / "latest" / ".doctrees").exists()
    assert (site / "0.9.0" / "llms.txt").read_text().startswith("- [v0.9.0]")
    add_version(built, site, "v1.0.0")
    assert 'url=1.0.0/"' in (site / "index.html").read_text()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    add_version(built, site, f"v{project['version']}")
    assert (site / project["version"]).is_dir()
    with pytest.raises(AssertionError, match="main: must be latest or a version"):
        add_version(built, site, "main")


@pytest.mark.slow(seconds=3)
def test_runs_that_publish_at_once_lose_nothing(tmp_path: Path) -> None:
    """A push that another run has overtaken is made again, beside the other run's pages."""
    origin, clone, other = tmp_path / "origin", tmp_path / "clone", tmp_path / "other"
    run(["git", "init", "-q", "--bare", "-b", "main", origin], tmp_path)
    for folder in (clone, other):
        run(["git", "clone", "-q", origin, folder], tmp_path)
        shutil.copytree(ROOT / ".ci", folder / ".ci")
        (folder / "built").mkdir()
        (folder / "built" / "llms.txt").write_text(folder.name)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    hook = clone / ".git" / "hooks" / "pre-push"  # runs once git knows what is published
    hook.parent.mkdir(exist_ok=True)
    hook.write_text(
        f'#!/bin/sh\nrm "$0"\nunset $(git rev-parse --local-env-vars)\n'
        f"cd {shlex.quote(str(other))} && .ci/publish built v0.2.0\n"
    )
    hook.chmod(0o755)
    for name in ("latest", "v0.3.0rc1"):
        run([".ci/publish", "built", name], clone, PATH=path)
    assert not hook.exists()
    run(["git", "clone", "-q", "-b", "gh-pages", origin, "site"], tmp_path)
    site = tmp_path / "site"
    versions = msgspec.json.decode((site / "versions.json").read_bytes())
    assert versions == ["latest", "0.3.0rc1", "0.2.0"]
    texts = [(site / version / "llms.txt").read_text() for version in versions]
    assert texts == ["clone", "clone", "other"]
    assert run(["git", "worktree", "list"], clone).count("\n") == 1
