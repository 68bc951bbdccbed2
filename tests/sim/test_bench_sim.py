"""The throughput benchmark runs on a CPU, with and without the room's colliders."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from cabinet import write_cabinet

TOOL = Path(__file__).parents[2] / "tools/bench_sim.py"


@pytest.mark.slow
def test_every_rate_is_measured(tmp_path: Path) -> None:
    """Two environments and the shortest PPO give a positive rate for each column, twice."""
    out = tmp_path / "bench.json"
    small = ["--num-envs", "2", "--ppo", "1x1x4", "--iterations", "4", "--device", "cpu"]
    subprocess.run([sys.executable, TOOL, write_cabinet(tmp_path / "sim.usda"), *small, "--out", out], check=True)
    rows = json.loads(out.read_text())["rows"]
    assert [row["room"] for row in rows] == [True, False]
    assert all(row[rate] > 0 for row in rows for rate in ("env_step", "physics", "ppo_1x1x4", "grasp_physics"))
