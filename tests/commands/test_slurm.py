"""A sweep through Hydra's launcher for Slurm, against a real Slurm that runs on this machine alone."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from cabinet import write_cabinet

SCRIPT = Path(__file__).parents[2] / "tools/slurm_local.sh"
PROGRAMS = ("slurmctld", "slurmd", "slurmdbd", "munged", "mariadbd")
MISSING = [name for name in PROGRAMS if not shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")]


@pytest.fixture
def slurm(tmp_path: Path) -> Iterator[dict[str, str]]:
    """The environment in which Slurm's commands find it."""
    folder = tmp_path / "slurm"
    try:
        subprocess.run([SCRIPT, "up", folder], check=True)
        yield os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}
    finally:
        subprocess.run([SCRIPT, "down", folder], check=True)
    assert not folder.exists()


@pytest.mark.slow
@pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")
def test_four_jobs_of_a_sweep_are_completed_by_slurm(tmp_path: Path, slurm: dict[str, str]) -> None:
    stage, tiny = write_cabinet(tmp_path / "sim.usda"), ("num_envs=4", "ppo.iterations=1", "ppo.num_steps_per_env=8")
    sweep = ("-m", "hydra/launcher=submitit_slurm", "seed=0,1,2,3", f"hydra.sweep.dir={tmp_path}/sweep")
    subprocess.run(
        [sys.executable, "-m", "s2a", "train", *sweep, *tiny, f"stage={stage}", "out=run"], env=slurm, check=True
    )
    asked = ["sacct", "--noheader", "--allocations", "--parsable2", "--format=State"]
    states = subprocess.run(asked, env=slurm, check=True, capture_output=True, text=True).stdout.split()
    assert states == ["COMPLETED"] * 4
    assert len(list(tmp_path.glob("sweep/*/run/metrics.json"))) == 4


@pytest.mark.slow
def test_rooms_that_submitit_runs_become_one_index(tmp_path: Path) -> None:
    for name in ("hall", "attic"):
        (tmp_path / f"{name}.ply").write_text("nothing")
    scans = ",".join(f"{tmp_path}/{name}.ply" for name in ("hall", "attic"))
    sweep = ("-m", "hydra/launcher=submitit_local", f"hydra.sweep.dir={tmp_path}/sets")
    subprocess.run([sys.executable, "-m", "s2a", "dataset", *sweep, f"scans={scans}", "out=rooms"], check=True)
    rows = json.loads((tmp_path / "sets/pool.json").read_text())["verdicts"]
    assert [row["name"] for row in rows] == ["hall", "attic"] and all("import: " in row["failed"] for row in rows)
