"""What several test files share."""

from __future__ import annotations

import fcntl
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


@pytest.fixture(scope="session")
def common(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that all workers of a run share."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


@pytest.fixture(scope="session", autouse=True)
def _own_cache(common: Path) -> None:
    """Keep the user's cache out of the tests, and the tests out of the user's cache."""
    os.environ["S2A_CACHE"] = str(common / "cache")


OFFICE = ("room=office", "seed=101")
"""The demo's room; its drawers are drawer_14, drawer_15 and drawer_16, with rails."""


@pytest.fixture(scope="session")
def office_scan(common: Path) -> Path:
    """A virtual office as the demo scans it; one worker makes it for all."""
    pytest.importorskip("s2a.homes", reason="needs s2a.homes")
    from s2a.core import config
    from s2a.homes.sample import SampleConfig, sample  # not needed where only the simulation is tested

    out = common / "office/scan"
    with (common / "office.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not out.exists():
            out.mkdir(parents=True)
            sample(config.load(SampleConfig, config.compose("sample", [*OFFICE, f"out={out}"])), out)
    return out


@pytest.fixture(scope="session")
def office(office_scan: Path) -> Scene:
    """The scene in that scan."""
    from s2a import scan

    return scan.read(office_scan)
