"""The second exporter finds in a scene's file what the instance has, and notices what is not."""

import json
from pathlib import Path
from typing import Any

import pytest
from second_export import UnknownError, differences, facts_of_instance, facts_of_scene

from cocap_opt.cli.commands import run

SCENES = [
    "tiny-approach", "tiny-hover", "tiny-share", "tiny-queue", "tiny-doorway", "tiny-turn",
    "tiny-trap", "tiny-hidden", "tiny-give-way", "tiny-head-on", "corridor", "bottleneck",
]  # fmt: skip


def exported(name: str, folder: Path) -> tuple[dict[str, Any], str]:
    """Returns the scene of a file, and the text of its instance."""
    scene, instance = folder / "scene.json", folder / "scene.instance"
    for path in (scene, instance):
        assert run(["export", name, "-o", str(path)]) == 0
    return json.loads(scene.read_text())["problem"], instance.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_both_exporters_agree(name: str, tmp_path: Path) -> None:
    """Places, moves, turns, starts, goals, rewards, rules and weights are equal."""
    problem, text = exported(name, tmp_path)
    assert differences(facts_of_scene(problem), facts_of_instance(text)) == []


def test_changed_instances_are_noticed(tmp_path: Path) -> None:
    """A dropped move, another weight, rule or reward is told by its name."""
    problem, text = exported("tiny-doorway", tmp_path)
    known = facts_of_scene(problem)
    for before, after, told in (
        (": 0= 1 3 4", ": 0= 1 3", "moves of drone 0"),
        ("weight 5 0x1.0", "weight 5 0x1.1", "weights"),
        ("rules 1 1", "rules 1 0", "rules"),
        ("rewards 0x0", "rewards 0x1", "rewards"),
        ("drone 1 : 2,0", "drone 1 : 1,0", "start of drone 1"),
    ):
        assert before in text
        changed = facts_of_instance(text.replace(before, after, 1))
        assert told in differences(known, changed)


def test_what_it_does_not_know_is_refused(tmp_path: Path) -> None:
    """A scene with a ceiling is refused in words, never compared without it."""
    problem, _ = exported("tiny-doorway", tmp_path)
    problem["airspace"]["ceiling"] = 5.0
    with pytest.raises(UnknownError, match="a ceiling"):
        facts_of_scene(problem)
