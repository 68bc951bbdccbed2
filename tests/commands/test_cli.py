"""The command line: what it says, what it returns, and that a failure changes nothing."""

from __future__ import annotations

import errno
import logging
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
import satellites
import tiny_scan

from s2a.commands import cli, usage
from s2a.core import config
from s2a.scene.usd import descriptive, geometric


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    return tiny_scan.write(tmp_path / "scan")


@pytest.fixture(autouse=True)
def _restore_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    """Undo what a sweep sets for Hydra."""
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")


def refused(capsys: pytest.CaptureFixture[str], arguments: Sequence[str], code: int = 2) -> str:
    """Return the one line with which the command line refuses the arguments."""
    assert cli.main(arguments) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1 and captured.err.startswith("s2a: ")
    return captured.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["exprt"], ["'exprt'", "did you mean: export"]),
        (["zzz"], ["'zzz'", "possible: import, annotate, check, export, prepare"]),
        (["export", "--halp"], ["'--halp'", "--help"]),
        (["export", "scam=x", "out=y"], ["'scam'", "did you mean: scan"]),
        (["train", "ppo.iteration=3"], ["'ppo.iteration'", "ppo.iterations"]),
        (["train", "reward=handel"], ["'reward'", "'handel'", "handle"]),
        (["train", "stage=x", "out=y", "+warp=9"], ["'warp'", "unknown"]),
        (["train", "stage=x", "out=y", "num_envs=many"], ["'num_envs'", "'many'", "whole number"]),
        (["train", "stage=x", "out=y", "sim.cone=round"], ["'sim.cone'", "'round'", "elliptic, pyramidal"]),
        (["train", "stage=x", "out=y", "sim.dt=1,2"], ["'sim.dt=1,2'", "add -m"]),
        (["export", "out=y"], ["'scan'", "no value", "scan=..."]),
        (["export", "scan"], ["'scan'", "not key=value"]),
        (["train", "stage=x", "out=y", "num_envs=["], ["'num_envs=['", "quote"]),
        (["export", "scan=3.5", "out=y"], ["3.5", "does not exist"]),
        (["export", "scan=nowhere", "out=y"], ["nowhere", "does not exist"]),
        (["view", "path=nowhere.usd", "text=true"], ["nowhere.usd"]),
        (["view", "path=x", "image=y.png", "camera.width=0"], ["'camera.width'", "0", "1 or more"]),
        (["view", "path=.", "part=drawer_7"], ["'part'", "image=FILE.png"]),
        (["view", "path=nowhere"], ["nowhere", "a scan's folder, or a .usd"]),
        (["view", "path=.", "image=x.xyz"], ["'image'", "'x.xyz'", "image=FILE.png"]),
        (["insert", "stage=x.usd", "out=y", "plans=0"], ["'plans'", "0", "1 or more"]),
        (["insert", "stage=x.usd", "out=y", "image=x.jpg"], ["'image'", "'x.jpg'", "image=FILE.png"]),
        (["insert", "stage=x.usd", "out=y", "object=a.obj", "label="], ["object=FILE and label=WORDS"]),
        (["prepare", "stage=nowhere.usd", "targets=drawer_7", "out=y.usd"], ["nowhere.usd"]),
        (["evaluate", "stage=nowhere.usd", "out=y.json"], ["nowhere.usd"]),
        (["train", "stage=nowhere.usd", "out=y"], ["nowhere.usd"]),
        (["train", "stage=x", "out=y", "device=cuda:99"], ["'device'", "'cuda:99'", "auto, cpu"]),
        (["train", "stage=x", "out=y", "num_envs=0"], ["'num_envs'", "0", "1 or more"]),
        (["train", "stage=x", "out=y", "ppo.iterations=0"], ["'ppo.iterations'", "0", "1 or more"]),
        (
            ["train", "stage=x", "out=y", "num_envs=1", "ppo.num_mini_batches=41"],
            ["'ppo.num_mini_batches'", "41", "40 or less"],
        ),
        (["train", "stage=x", f"out={__file__}"], [__file__, "is a file where a folder"]),
        (["train", "stage=x", "out=y", "task=fly"], ["'task'", "'fly'", "open_part"]),
        (["train", "stage=x", "out=y", "task.name=fly"], ["task 'fly' is unknown", "open_part"]),
        (["train", "stage=x", "out=y", "reward.fingers=1"], ["'reward.fingers'", "reward.finger"]),
    ],
)
def test_bad_input_is_one_line_that_names_it_and_the_remedy(
    arguments: list[str],
    words: list[str],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    satellites.need(arguments[0])
    monkeypatch.chdir(tmp_path)
    message = refused(capsys, arguments)
    assert [word for word in words if word not in message] == []
    assert list(tmp_path.iterdir()) == []


def test_without_a_command_every_command_is_explained(capsys: pytest.CaptureFixture[str]):
    assert cli.main([]) == 0
    text = capsys.readouterr().out
    assert [command for command in cli.commands() if f"  {command} " not in text] == []


def test_help_of_a_command_tells_each_key_its_value_and_meaning(capsys: pytest.CaptureFixture[str]):
    assert cli.main(["export", "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split() == ["scan=(required)", "folder", "of", "the", "scan."] for line in lines)


@pytest.mark.parametrize("columns", [80, 120])
def test_help_fits_a_terminal_and_loses_no_word(columns: int) -> None:
    text = usage.command("export", "writes stages", cli.settings_of("export"))
    text += "\n  policy=null                              " + "one of several words " * 12
    lines = usage.fitted(text, columns).splitlines()
    assert max(map(len, lines)) <= columns and " ".join(lines).split() == text.split()


def test_export_writes_both_flavours_and_says_so(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "usd"
    assert cli.main(["export", f"scan={scan}", f"out={out}", "check=false"]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["descriptive.usda", "geometric.usd"]
    captured = capsys.readouterr()
    assert "6 parts" in captured.out and "door_3" in captured.out
    assert captured.err.startswith("export: ")


def test_a_warning_is_one_line(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    files = tiny_scan.contents()
    files[tiny_scan.ARTIC]["data"]["articulations"] *= 2
    tiny_scan.write(scan, files)
    assert cli.main(["export", f"scan={scan}", f"out={tmp_path / 'usd'}", "check=false"]) == 0
    warnings = [line for line in capsys.readouterr().err.splitlines() if line.startswith("s2a: ")]
    assert len(warnings) == 1 and "warning: " in warnings[0] and "several articulations of part 3" in warnings[0]


def test_a_bug_is_one_line_and_the_earlier_output_stays(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    out = tmp_path / "usd"
    arguments = ["export", f"scan={scan}", f"out={out}"]
    cli.main(arguments)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    capsys.readouterr()

    def fail(scene: object, path: Path) -> None:
        path.write_text("half")
        raise RuntimeError("a wheel\ncame off")

    monkeypatch.setattr(geometric, "write", fail)
    assert "RuntimeError: a wheel came off; this is a bug" in refused(capsys, arguments, code=1)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_bug_names_the_tunables_that_may_be_its_cause(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(cli, "run", lambda command, values: 1 / 0)
    arguments = ["certify", "stage=a.usd", "out=b", "certify.physics.dt=9"]
    said = refused(capsys, arguments, code=1)
    assert "this is a bug, unless certify.physics.dt=9 makes no sense: report" in said


def test_debug_shows_the_traceback(capsys: pytest.CaptureFixture[str]):
    assert cli.main(["--debug", "export", "scan=nowhere", "out=x"]) == 2
    assert "Traceback" in capsys.readouterr().err


def test_an_interrupt_is_one_line_and_leaves_nothing(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def interrupt(scene: object, path: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(descriptive, "write", interrupt)
    refused(capsys, ["export", f"scan={scan}", f"out={tmp_path / 'usd'}"], code=130)
    assert [path.name for path in tmp_path.iterdir()] == ["scan"]


def test_a_sweep_runs_every_value_each_into_its_own_folder(scan: Path, tmp_path: Path):
    other = tiny_scan.write(tmp_path / "other")
    sweep = tmp_path / "sweep"
    handlers = logging.getLogger().handlers[:]
    assert cli.main(["export", "-m", f"scan={scan},{other}", "out=usd", f"hydra.sweep.dir={sweep}"]) == 0
    left = [handler for handler in logging.getLogger().handlers if handler not in handlers]
    assert not any(isinstance(handler, logging.StreamHandler) for handler in left)
    assert sorted(p.name for p in sweep.glob("[01]/usd/*.usd*")) == ["descriptive.usda"] * 2 + ["geometric.usd"] * 2


@pytest.mark.slow
def test_a_sweep_runs_side_by_side_in_processes_of_its_own(scan: Path, tmp_path: Path):
    sweep = tmp_path / "sweep"
    arguments = [f"scan={scan},{tiny_scan.write(tmp_path / 'other')}", "out=usd", f"hydra.sweep.dir={sweep}"]
    assert cli.main(["export", "-m", "hydra/launcher=joblib", *arguments]) == 0
    assert len(list(sweep.glob("[01]/usd/geometric.usd"))) == 2


def test_what_every_job_of_a_sweep_would_overwrite_is_refused(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    arguments = [f"scan={scan},{scan}", f"out={tmp_path / 'usd'}", f"hydra.sweep.dir={tmp_path / 'sweep'}"]
    assert cli.main(["export", "-m", *arguments]) == 2
    assert "in a sweep, whose runs would overwrite it" in capsys.readouterr().err
    assert not (tmp_path / "usd").exists()


def test_an_output_in_an_inputs_place_is_refused(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert cli.main(["export", f"scan={scan}", f"out={tmp_path}"]) == 0
    stage = tmp_path / "geometric.usd"
    before = stage.read_bytes()
    for command in (["prepare", "targets=drawer_3"], ["evaluate", "agent=zero"]):
        assert cli.main([*command, f"stage={stage}", f"out={tmp_path}/./geometric.usd"]) == 2
        assert "would replace what the key 'stage' names" in capsys.readouterr().err
    assert stage.read_bytes() == before


def test_a_typo_in_a_sweep_is_told_like_any_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert cli.main(["export", "-m", "scan=a,b", "uot=usd", f"hydra.sweep.dir={tmp_path}"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == "s2a: key 'uot' is unknown; did you mean: out"


@pytest.mark.slow
def test_a_failing_job_of_a_sweep_does_not_stop_the_others(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    arguments = [f"scan={tmp_path / 'nowhere'},{scan}", "out=usd", f"hydra.sweep.dir={tmp_path / 'sweep'}"]
    assert cli.main(["export", "-m", *arguments]) == 2
    assert "does not exist" in capsys.readouterr().err.splitlines()[-1]
    assert (tmp_path / "sweep" / "1" / "usd" / "geometric.usd").exists()


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("s2a.commands.cli", ["torch", "warp", "newton", "pxr", "numpy"]),
        ("s2a.commands.export", ["torch", "warp", "newton"]),
    ],
)
def test_a_quick_command_imports_nothing_slow(module: str, heavy: list[str]):
    code = f"import sys, {module}; print([name for name in {heavy} if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_what_a_command_imports_is_frozen_once_and_the_collector_goes_on() -> None:
    code = """
import gc
from s2a.commands import cli
cli._module("view")
frozen = gc.get_freeze_count()
cli._module("view")
print(gc.isenabled(), frozen > 10_000, gc.get_freeze_count() == frozen)
print(gc.isenabled())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.stdout.split() == ["True"] * 4, done.stderr


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        MemoryError("Unable to allocate 8.0 TiB for an array"),
        RuntimeError("CUDA out of memory. Tried to allocate 2.00 GiB"),
        RuntimeError("Failed to allocate 17179869184 bytes on device 'cuda:0'"),
        RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried to allocate 1 bytes"),
    ],
)
def test_too_little_memory_is_one_line_and_no_bug(
    error: Exception, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    def fail(config: object) -> str:
        raise error

    monkeypatch.setattr("s2a.commands.export.run", fail)
    monkeypatch.setattr("s2a.commands.evaluate.run", fail)
    for arguments, size in ((["export", "scan=x"], "a size"), (["evaluate", "stage=x"], "num_envs")):
        message = refused(capsys, [*arguments, f"out={tmp_path / 'y'}"])
        assert "out of memory" in message and f"lower {size}" in message and "bug" not in message


@pytest.mark.parametrize(
    ("number", "is_path"),
    [(number, True) for number in (errno.ENOENT, errno.ENOTDIR, errno.EACCES, errno.EPERM, errno.EROFS)]
    + [(errno.ENOSPC, False), (errno.EISDIR, False), (errno.EMFILE, False)],
)
def test_only_errors_of_a_path_or_its_permissions_have_them_as_the_remedy(
    number: int, is_path: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    def fail(config: object) -> str:
        raise OSError(number, os.strerror(number), "/scans/hall.ply")

    monkeypatch.setattr("s2a.commands.export.run", fail)
    message = refused(capsys, ["export", "scan=x", f"out={tmp_path / 'y'}"])
    assert f"/scans/hall.ply: {os.strerror(number)}" in message and ("check the path" in message) == is_path


def test_a_current_folder_that_was_deleted_is_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    tmp_path.rmdir()
    assert "the current folder does not exist any more" in refused(capsys, ["export", "scan=x", "out=y"])


def test_a_user_without_a_home_has_one_for_caches(tmp_path: Path):
    code = (
        "import os, pwd, sys\n"
        "def unknown(uid): raise KeyError(uid)\n"
        "pwd.getpwuid = unknown\n"
        "from s2a.commands.cli import main\n"
        "main(['--version']); print(os.environ['HOME'])"
    )
    environment = {name: value for name, value in os.environ.items() if name != "HOME"} | {"TMPDIR": str(tmp_path)}
    ran = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines()[-1] == str(tmp_path / f"s2a-{os.getuid()}") and "set HOME" in ran.stderr
    assert not (tmp_path / "~").exists()


@pytest.mark.slow
def test_help_that_was_shown_before_imports_no_command(tmp_path: Path) -> None:
    code = "import sys; from s2a.commands import cli; cli.main(['check', '--help']); print('s2a.commands.check' in sys.modules)"
    quiet = os.environ | {"S2A_CACHE": str(tmp_path)}
    calls = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=quiet) for _ in range(2)]
    first, second = (call.stdout.rsplit("\n", 2)[:2] for call in calls)
    assert first == [second[0], "True"] and second[1] == "False" and "scan=(required)" in first[0]


@pytest.mark.slow
def test_help_names_the_options_of_now(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = shutil.copytree(config.folder(), tmp_path / "conf")
    monkeypatch.setattr(config, "folder", lambda: tree)
    monkeypatch.setenv("S2A_CACHE", str(tmp_path / "cache"))

    def rewards() -> str:
        assert cli.main(["train", "--help"]) == 0
        return next(line for line in capsys.readouterr().out.splitlines() if "reward=...  one of: " in line)

    before = rewards()
    (tree / "reward/real.yaml").rename(tree / "reward/renamed.yaml")
    assert rewards() == before.replace(" real", " renamed")


def test_help_is_made_again_for_another_robot_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("S2A_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("S2A_ROBOTS", str(tmp_path / "robot.yaml"))
    for text in ("first: 1", "first: 1", "second: 1"):
        (tmp_path / "robot.yaml").write_text(text)
        assert cli.main(["check", "--help"]) == 0
    assert len(list((tmp_path / "cache/help").iterdir())) == 2
