"""Work is shared with helper processes, which end with this one and leave other commands their cores."""

from __future__ import annotations

import operator
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from s2a.core import workers

WORK = """
import os, time

def work(shared, item):
    open(f"{shared}/{os.getpid()}", "w").close()
    time.sleep(600)
"""
"""Works for minutes, after it wrote a file named by its process."""
SCRIPT = """
import os, sys
from s2a.core import progress as terminal, workers
from work import work

os.sched_getaffinity = lambda pid: {0, 1, 2, 3}
terminal.set_up()
list(workers.spread(work, sys.argv[1], range(9)))
"""
"""Three processes that work, from a script without a guard."""


@pytest.fixture(autouse=True)
def _three_cores(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("S2A_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1, 2})


def test_results_come_in_the_order_of_the_items_and_other_work_is_done_once() -> None:
    done: list[int] = []
    found = list(workers.spread(operator.mul, 3, range(20), meanwhile=lambda: done.append(1)))
    assert found == [3 * k for k in range(20)] and done == [1]


@pytest.mark.parametrize(("items", "few", "meanwhile"), [(0, 1, True), (3, 3, True), (3, 3, False)])
def test_few_items_need_no_helper(items: int, few: int, meanwhile: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "processes", None)
    done: list[int] = []
    found = list(workers.spread(operator.mul, 3, range(items), few, (lambda: done.append(1)) if meanwhile else None))
    assert found == [3 * k for k in range(items)] and done == [1] * meanwhile


def test_what_a_helper_prints_is_dropped(capfd: pytest.CaptureFixture[str]) -> None:
    assert list(workers.apart(print, "Module load on device", ["cpu"], 1)) == [(0, None)]
    assert capfd.readouterr().out == ""


def test_what_a_helper_raises_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        list(workers.spread(operator.truediv, 1, [0, 1, 1, 1, 1, 1, 1, 1]))


def test_commands_side_by_side_have_fewer_helpers_than_cores() -> None:
    with workers._spare_cores(9) as first, workers._spare_cores(9) as second, workers._spare_cores(9) as third:
        assert (first, second, third) == (1, 1, 0)
    with workers._spare_cores(-1) as none:
        assert none == 0


def test_processes_of_one_training_share_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers.os, "sched_getaffinity", lambda _: set(range(9)))
    monkeypatch.setenv("LOCAL_WORLD_SIZE", "3")
    with workers._spare_cores(99) as first, workers._spare_cores(99) as second, workers._spare_cores(99) as third:
        assert (first, second, third) == (3, 3, 2)


def test_where_no_claim_can_be_made_the_work_is_done_alone(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("no folder")
    with workers._spare_cores(9) as helpers:
        assert helpers == 0
    assert list(workers.spread(operator.mul, 3, [1, 2, 3])) == [3, 6, 9]


def test_a_script_without_a_guard_runs_once(tmp_path: Path) -> None:
    script, runs = tmp_path / "script.py", tmp_path / "runs"
    runs.mkdir()
    script.write_text(
        f"import operator, os\nopen({str(runs)!r} + f'/{{os.getpid()}}', 'w').close()\n"
        "from s2a.core import workers\nos.sched_getaffinity = lambda pid: {0, 1, 2}\n"
        "assert list(workers.spread(operator.mul, 3, range(9))) == [3 * k for k in range(9)]\n"
    )
    subprocess.run([sys.executable, str(script)], check=True)
    assert len(list(runs.iterdir())) == 1


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_helpers_end_with_their_command(number: signal.Signals, tmp_path: Path) -> None:
    script, begun = tmp_path / "script.py", tmp_path / "begun"
    script.write_text(SCRIPT)
    (tmp_path / "work.py").write_text(WORK)
    begun.mkdir()
    command = subprocess.Popen([sys.executable, str(script), str(begun)], stderr=subprocess.DEVNULL)
    try:
        _wait(lambda: len(list(begun.iterdir())) == 3)
        command.send_signal(number)
        command.wait(30)
        _wait(lambda: not any(_runs(int(path.name)) for path in begun.iterdir()))
    finally:
        command.kill()


def _wait(until: object, seconds: float = 60.0) -> None:
    """Wait until something is true, far shorter than the work takes."""
    end = time.monotonic() + seconds
    while not until():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.05)


def _runs(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().split()[2] not in "ZX"
    except FileNotFoundError:
        return False


def square_or_die(shared: int, item: int) -> int:
    if item < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return shared * item * item


def test_a_process_that_dies_is_one_result_of_many():
    assert dict(workers.apart(square_or_die, 2, [1, -1, 3], 2)) == {0: 2, 1: None, 2: 18}


def threads_once(there: Path, item: int) -> str:
    _wait(there.exists)
    return os.environ["OMP_NUM_THREADS"]


def test_processes_at_once_claim_their_cores_and_share_out_threads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(5)))
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)

    def spare() -> int:
        with workers._spare_cores(9, 1.0) as cores:
            return cores

    with ThreadPoolExecutor(1) as pool:
        results = pool.submit(dict, workers.apart(threads_once, tmp_path / "go", [0, 1], 2))
        _wait(lambda: spare() == 3)
        (tmp_path / "go").touch()
        assert results.result() == {0: "2", 1: "2"}
    assert spare() == 4 and "OMP_NUM_THREADS" not in os.environ
