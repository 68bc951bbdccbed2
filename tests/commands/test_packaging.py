"""What is installed, and from where."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PINS = dict(line.split("==") for line in (ROOT / "requirements.lock").read_text().splitlines() if "==" in line)


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


EXTRAS = PROJECT["optional-dependencies"]
LOCKED = [
    text for extra in ("sim", "learn", "llm", "collect", "dev") for text in EXTRAS[extra] if not text.startswith("s2a[")
]


@pytest.mark.parametrize("text", [*PROJECT["dependencies"], *LOCKED])
def test_the_lock_pins_every_requirement_within_its_range(text: str):
    requirement = Requirement(text)
    pinned = {plain(name): version for name, version in PINS.items()}
    assert requirement.specifier.contains(pinned[plain(requirement.name)])


def test_the_lock_leaves_the_choice_between_cpu_and_cuda_to_pip():
    assert [name for name, version in PINS.items() if "nvidia" in name or "triton" in name or "+" in version] == []


@pytest.mark.slow
def test_the_wheel_works_away_from_the_checkout_with_its_values(tmp_path: Path):
    build = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "-w",
        str(tmp_path),
        str(ROOT),
    ]
    subprocess.run(build, check=True)
    venv.create(tmp_path / "venv", symlinks=True)
    site = next((tmp_path / "venv").glob("lib/python*/site-packages"))
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(site)]
    subprocess.run([*install, str(next(tmp_path.glob("s2a-*.whl")))], check=True)
    # The rest of what is installed here, without the checkout, which only a .pth file inside it would add.
    (site / "rest.pth").write_text("\n".join(path for path in sys.path if path.endswith("site-packages")))
    code = "import s2a; from s2a.core import config; print(s2a.__file__); print(config.compose('train')['reward'])"
    python = tmp_path / "venv" / "bin" / "python"
    alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    output = subprocess.check_output([python, "-c", code], cwd=tmp_path, text=True, env=alone).splitlines()
    assert output[0].startswith(str(site))
    assert "'opening': 10.0" in output[1]
