"""What a script can do where its text is not looked at, and what is kept of what it did."""

from __future__ import annotations

import os
import re
import socket
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import newton_usd_schemas
import numpy as np
import pxr
import pytest
from harmless_scripts import scripts
from hostile_scripts import ALL, GOOD
from placed_mug import CONFIG, PLAN, UPRIGHT, write_stage

from s2a.core.errors import InputError
from s2a.language.insert.batch import geometry_free_text, write
from s2a.language.insert.prompts import ScriptResult, run_sandboxed, write_script
from s2a.language.sandbox import jail
from s2a.language.sandbox.diff import Placement
from s2a.language.sandbox.jail import Sandbox, SandboxConfig
from s2a.language.sandbox.operations import PolicyViolation
from s2a.scene.usd import geometric
from s2a.scene.usd.stage import problems

SECRET = "the secret that no script may see"
TRIED = {name: hostile for name, hostile in ALL.items() if hostile.process is not None}
QUICK = (
    "read",
    "save through a link",
    "move another prim",
    "payload",
    "socket",
    "fork",
    "kill",
    "forge the report",
    "huge text",
    "endless loop",
    "binary stage",
)
"""One of each kind, for every day; `pytest -m slow` runs them all."""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_stage(tmp_path_factory.mktemp("stage"))


def run_script(text: str, stage: str, plan: Placement, config: SandboxConfig, *, trusted: bool = False) -> ScriptResult:
    """Run a script in a cell of its own."""
    with Sandbox(stage, config, trusted) as sandbox:
        return run_sandboxed(sandbox, text, plan)


def attack(name: str, stage: Path, folder: Path, config: SandboxConfig) -> str:
    """Run an attack with the allowlist off; return why it was refused, and check that nothing came of it."""
    (folder / "secret").write_text(SECRET)
    (folder / "other.usda").write_text(f'#usda 1.0\n(\n    defaultPrim = "{SECRET}"\n)\n')
    before = stage.read_bytes(), sorted(folder.iterdir()), facts(folder), facts(folder / "secret")
    said = ""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.0)
        text = GOOD + TRIED[name].attack
        port, parent = str(server.getsockname()[1]), str(os.getpid())
        for word, value in (("SECRET", folder / "secret"), ("FOLDER", folder), ("PORT", port), ("PARENT", parent)):
            text = text.replace(word, str(value))
        try:
            with Sandbox(geometry_free_text(stage), config, trusted=False) as sandbox:
                run = sandbox.run(text, {})
                layer = sandbox.compare(run.saved, UPRIGHT)
            assert SECRET not in layer.ExportToString()
        except PolicyViolation as violation:
            said = violation.reason
        with pytest.raises(BlockingIOError):
            server.accept()
    assert SECRET not in said and (folder / "secret").read_text() == SECRET
    assert before == (stage.read_bytes(), sorted(folder.iterdir()), facts(folder), facts(folder / "secret"))
    return said


def facts(path: Path) -> tuple:
    """Return what a script may not change of a file or folder."""
    found = path.stat()
    return found.st_mode, found.st_uid, found.st_gid, found.st_size, found.st_mtime_ns, found.st_nlink


def expect(name: str, said: str) -> None:
    """Check that an attack was refused for the stated reason, or accepted if it has no effect."""
    expected = TRIED[name].process
    assert expected is not None
    assert re.search(expected, said) if expected else said == ""


@pytest.mark.parametrize("name", QUICK)
def test_without_the_allowlist_an_attack_fails_for_the_stated_reason(name: str, stage: Path, tmp_path: Path) -> None:
    expect(name, attack(name, stage, tmp_path, CONFIG))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in TRIED if name not in QUICK])
def test_without_the_allowlist_every_attack_fails_for_the_stated_reason(name: str, stage: Path, tmp_path: Path) -> None:
    config = replace(CONFIG, seconds=2.0) if name == "sleep" else CONFIG
    expect(name, attack(name, stage, tmp_path, config))


def test_half_of_the_attacks_are_tried_without_the_allowlist() -> None:
    assert len(TRIED) >= len(ALL) / 2 and len(ALL) >= 80


@pytest.mark.parametrize("layers", [("landlock", "seccomp"), ("namespaces", "seccomp")])
def test_either_of_two_locks_keeps_the_files(layers: tuple, stage: Path, tmp_path: Path) -> None:
    config = replace(CONFIG, layers=layers)
    said = attack("read", stage, tmp_path, config)
    assert "No such file" in said or "Permission denied" in said


@pytest.mark.parametrize("name", ["permit", "permit by descriptor", "own", "set times", "truncate", "many large files"])
def test_without_namespaces_files_keep_their_permissions_and_the_disk_is_bounded(
    name: str, stage: Path, tmp_path: Path
) -> None:
    expect(name, attack(name, stage, tmp_path, replace(CONFIG, layers=("landlock", "seccomp"))))


@pytest.mark.slow
def test_what_a_script_could_see_of_the_system_is_recorded(stage: Path) -> None:
    for layers, exposed in ((("landlock", "seccomp"), 1), (CONFIG.layers, 0)):
        config = replace(CONFIG, layers=layers)
        record = run_script(write_script(PLAN), geometry_free_text(stage), PLAN, config).record
        assert len(record["exposed"]) == exposed


@pytest.mark.slow
@pytest.mark.parametrize("name", TRIED)
@pytest.mark.parametrize("layers", [("landlock", "seccomp"), ("namespaces", "seccomp")])
def test_either_of_two_locks_keeps_all_attacks_without_effect(
    name: str, layers: tuple, stage: Path, tmp_path: Path
) -> None:
    config = replace(CONFIG, layers=layers, seconds=2.0 if name == "sleep" else CONFIG.seconds)
    said = attack(name, stage, tmp_path, config)
    assert said or TRIED[name].process == ""


@pytest.mark.parametrize("number", (0, 1, 2))
def test_what_a_model_writes_places_the_object(number: int, stage: Path) -> None:
    assert run_script(scripts()[number], geometry_free_text(stage), PLAN, CONFIG).record["script"]


@pytest.mark.slow
@pytest.mark.parametrize("number", range(3, len(scripts())))
def test_whatever_a_model_writes_places_the_object(number: int, stage: Path) -> None:
    assert run_script(scripts()[number], geometry_free_text(stage), PLAN, CONFIG).record["script"]


def test_the_object_joins_the_room_as_a_fixed_part_and_leaves_it_with_the_layer(stage: Path) -> None:
    before, path = stage.read_bytes(), stage.parent / "overlay.usda"
    write(run_script(write_script(PLAN), geometry_free_text(stage), PLAN, CONFIG).layer, stage.name, path)
    room = geometric.read(path)
    mug = room.parts["mug_8"]
    assert (mug.label, mug.motion, mug.parent, list(room.parts)) == ("coffee mug", "fixed", None, ["wall_1", "mug_8"])
    assert np.allclose(mug.mesh.vertices[1], (1.5, -0.25 + 0.5, 0.75), atol=1e-6)  # (1, 0, 0) halved, then turned to +y
    assert problems(path) == []
    assert stage.read_bytes() == before and list(geometric.read(stage).parts) == ["wall_1"]


@pytest.mark.slow
def test_the_same_script_gives_the_same_bytes(stage: Path, tmp_path: Path) -> None:
    for name in ("first.usda", "second.usda"):
        write(run_script(scripts()[0], geometry_free_text(stage), PLAN, CONFIG).layer, "geometric.usd", tmp_path / name)
    assert (tmp_path / "first.usda").read_bytes() == (tmp_path / "second.usda").read_bytes()


def test_an_object_joins_a_room_that_another_joined_before(stage: Path) -> None:
    first, second = stage.parent / "one.usda", stage.parent / "two.usda"
    write(run_script(write_script(PLAN), geometry_free_text(stage), PLAN, CONFIG).layer, stage.name, first)
    plan = replace(PLAN, part_id="mug_9", position=(0.0, 0.0, 2.0))
    write(run_script(write_script(plan), geometry_free_text(first), plan, CONFIG).layer, first.name, second)
    assert list(geometric.read(second).parts) == ["wall_1", "mug_8", "mug_9"]


def test_a_system_without_locks_runs_only_what_is_trusted(stage: Path) -> None:
    bare = replace(CONFIG, layers=())
    with pytest.raises(InputError, match="cannot keep files, network, processes from a script"):
        run_script(write_script(PLAN), geometry_free_text(stage), PLAN, bare)
    assert run_script(write_script(PLAN), geometry_free_text(stage), PLAN, bare, trusted=True).record["active"] == []


def test_an_error_in_a_script_names_its_line(stage: Path) -> None:
    with pytest.raises(PolicyViolation, match=r"\(process\), line 2: ZeroDivisionError"):
        run_script("x = 0\ny = 1 / x\n", geometry_free_text(stage), PLAN, CONFIG)


@pytest.mark.parametrize("change", [{"position": (1.5, -0.25, 0.75001)}, {"scale": 0.50001}, {"label": "cup"}])
def test_a_script_that_follows_another_plan_is_refused(change: dict, stage: Path) -> None:
    with pytest.raises(PolicyViolation, match="comparison"):
        run_script(write_script(replace(PLAN, **change)), geometry_free_text(stage), PLAN, CONFIG)


@pytest.mark.slow
def test_a_refused_script_leaves_room_for_the_next_in_a_process_of_its_own(stage: Path) -> None:
    with Sandbox(geometry_free_text(stage), CONFIG, False) as sandbox:
        with pytest.raises(PolicyViolation, match="ZeroDivisionError"):
            run_sandboxed(sandbox, "x = 1 / 0\n", PLAN)
        first, second = (run_sandboxed(sandbox, write_script(PLAN), PLAN) for _ in range(2))
    assert first.layer.ExportToString() == second.layer.ExportToString()
    assert first.record["active"] == list(CONFIG.layers)


def test_packages_may_lie_in_folders_of_their_own_and_a_missing_one_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, package in (("pxr", pxr), ("newton_usd_schemas", newton_usd_schemas), ("np", np)):
        link = tmp_path / name / package.__name__
        link.parent.mkdir()
        link.symlink_to(Path(str(package.__file__)).parent)
        monkeypatch.setattr(jail, name, SimpleNamespace(__file__=str(link / "__init__.py")))
    with Sandbox("#usda 1.0\n", CONFIG, False) as sandbox, pytest.raises(PolicyViolation):
        sandbox.compare(b"#usda 1.0\n", PLAN)
    link.unlink()
    with (
        Sandbox("#usda 1.0\n", CONFIG, False) as sandbox,
        pytest.raises(InputError, match="did not start: ModuleNotFoundError: No module named 'numpy'$"),
    ):
        sandbox.compare(b"#usda 1.0\n", PLAN)


def test_a_process_that_got_no_script_ends_with_the_cell() -> None:
    def children() -> set[str]:
        threads = Path("/proc/self/task").iterdir()
        return {child for thread in threads for child in (thread / "children").read_text().split()}

    before = children()
    with Sandbox("#usda 1.0\n", CONFIG, False):
        assert len(children() - before) == 2
    assert children() <= before
