"""What several test files share."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import pytest

from s2a.scene.scene import Scene

gc.disable()  # until all modules are imported: it would go through the objects of torch and Newton again and again


def pytest_collection_finish() -> None:
    """Start Python's collector, without what the modules hold."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep the user's cache out of the tests, and the tests out of the user's cache."""
    os.environ["S2A_CACHE"] = str(tmp_path_factory.mktemp("cache"))


OFFICE = ("room=office", "seed=101")
"""The demo's room; its drawers are drawer_14, drawer_15 and drawer_16, with rails."""


@pytest.fixture(scope="session")
def office_scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual office as the demo scans it."""
    pytest.importorskip("s2a.homes", reason="needs s2a.homes")
    from s2a.core import config
    from s2a.homes.sample import SampleConfig, sample  # not needed where only the simulation is tested

    out = tmp_path_factory.mktemp("office") / "scan"
    out.mkdir()
    sample(config.load(SampleConfig, config.compose("sample", [*OFFICE, f"out={out}"])), out)
    return out


@pytest.fixture(scope="session")
def office(office_scan: Path) -> Scene:
    """The scene in that scan."""
    from s2a import scan

    return scan.read(office_scan)
