"""Reports of runs, sweeps, evaluations, benchmarks, studies and validation reports: what they say, and what they refuse."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.view.report import read, results
from s2a.view.report.document import Document, Line, images, lines, table, text

RESULTS = Path(__file__).parents[2] / "experiments/results"
VOID = ("meta", "link", "img", "path", "rect", "circle", "br", "polygon")
OPTIONAL = ("tr", "td", "th")
"""Tags whose end HTML adds by itself."""
RATE = {"rate": 0.75, "low": 0.5, "high": 0.9}


class _Balance(HTMLParser):
    """Every tag is closed in its order, and nothing is loaded."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag != "script"
        for name, value in attrs:
            assert name not in ("src", "href") or str(value).startswith("data:"), value
            assert not name.startswith("on")
        if tag not in VOID + OPTIONAL:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert tag in OPTIONAL or self.open.pop() == tag


def whole(document: Document) -> str:
    page = document.html()
    parser = _Balance()
    parser.feed(page)
    assert parser.open == []
    return page


def write(path: Path, values: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(values))
    return path


def settings(**changes: Any) -> dict[str, Any]:
    reward = {"distance": 1.5, "rotation": 1.5, "opening": 10.0, "finger": 2.0}
    values: dict[str, Any] = {"num_envs": 10, "seed": 0, "stage": "room.usd", "out": "x", "reward": reward}
    return values | {"ppo": {"num_steps_per_env": 5}} | changes


def metrics(**changes: Any) -> dict[str, Any]:
    curve = [{"iteration": 0, "reward": 1.0}, {"iteration": 3, "reward": 2.0, "success": 0.5}]
    values: dict[str, Any] = {"curve": curve, "env_steps": 200, "seconds": 3.0, "seed": 0, "num_envs": 10}
    return values | {"recent": {"episodes": 8.0, "success": RATE}, "metrics_version": 3, "commit": "abc1234"} | changes


def run_folder(folder: Path, **changes: Any) -> Path:
    write(folder / "settings.json", settings(**changes))
    write(folder / "metrics.json", metrics(seed=changes.get("seed", 0)))
    return folder


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("many_parts_cpu", ["94.1 % [85.8, 97.7]", "opened, grasped", "3165b1c"]),
        ("bench_pretrained", ["505 parts, 64 episodes each", "95.5 % [93.9, 97.0]", "By handle"]),
        ("many_parts_training", ["3421", "opened, grasped"]),
        ("insertion_rules", ["91.0 % [83.8, 95.2]", "All 100 rows"]),
        ("number_of_parts", ["All 15 rows", "81920000"]),
        ("wishes_rules", ["relation", "back edge"]),
        ("home_reach", ["Table"]),
    ],
)
def test_published_results_become_pages_that_stand_alone(name: str, words: list[str]) -> None:
    page = whole(read(RESULTS / f"{name}.json"))
    assert [word for word in words if word not in page] == []


def test_a_table_of_runs_has_a_value_a_seed_beside_the_papers(tmp_path: Path) -> None:
    def run(row: str, seed: int, rate: float) -> dict[str, Any]:
        evaluation = {"episodes": 8, "success": RATE | {"rate": rate}, "grasp_success": RATE}
        values = {"row": row, "about": f"scan, {row}", "seed": seed, "stage": "handle.usd", "settings": settings()}
        return values | {"env_steps": 98304000, "curve": {}, "evaluation": evaluation}

    runs = [run("paper", 0, 0.994), run("paper", 1, 1.0), run("handle", 0, 0.5)]
    page = whole(read(write(tmp_path / "table.json", {"scan": "virtual", "runs": runs})))
    assert "3 runs" in page and "99.4 / 100 %" in page and "98.3 / 98.3" in page
    assert "87 to 88 %, handle not used" in page and "The paper&#x27;s table" in page


def test_a_run_shows_its_curve_over_environment_steps_its_rates_its_settings_and_the_papers_figure(
    tmp_path: Path,
) -> None:
    page = whole(read(run_folder(tmp_path / "drawer")))
    assert "Training drawer" in page and "not finished" not in page
    assert "75.0 % [50.0, 90.0]" in page and "ppo.num_steps_per_env" in page and "87 to 88 %" in page
    assert page.count("<svg viewBox='0 0 640") == 2


def test_the_runs_of_a_sweep_are_rows_named_by_what_differs_with_a_value_a_seed(tmp_path: Path) -> None:
    for i, (weight, seed) in enumerate([(1.5, 0), (1.5, 1), (9.0, 0)]):
        reward = settings()["reward"] | {"distance": weight}
        run_folder(tmp_path / f"sweep/{i}/run", seed=seed, reward=reward, out=f"{i}")
    page = whole(read(tmp_path / "sweep"))
    assert "3 runs" in page and "75 / 75 %" in page
    rows = re.findall(r"<td class=''>(reward.distance=\S+?)<td", page)
    assert rows == ["reward.distance=1.5", "reward.distance=9.0"]
    for i, (reward, seed) in enumerate([("paper", 0), ("paper", 1), ("handle", 0)]):
        hydra = tmp_path / f"sweep/{i}/.hydra/overrides.yaml"
        hydra.parent.mkdir()
        hydra.write_text(f"- reward={reward}\n- seed={seed}\n- +experiment=best\n- out=run\n")
    page = whole(read(tmp_path / "sweep"))
    assert re.findall(r"<td class=''>(reward=\w+)<td", page) == ["reward=paper", "reward=handle"]
    assert "sweep: 2 settings, 3 trainings" in page
    (tmp_path / "sweep/1/run/metrics.json").write_text("{}")
    with pytest.raises(InputError, match=r"sweep/1/run: damaged.*'curve'"):
        read(tmp_path / "sweep")


def test_a_run_without_rates_is_named_and_has_no_published_figure_beside_it(tmp_path: Path) -> None:
    for i, recent in enumerate([{"episodes": 8.0, "success": RATE}, {"episodes": 0.0}]):
        weights = (
            settings()["reward"] if i == 0 else {"distance": 50.5, "rotation": 50.5, "opening": 10.0, "finger": 50.0}
        )
        run_folder(tmp_path / f"sweep/{i}/run", reward=weights)
        curve = [] if i else metrics()["curve"]
        write(tmp_path / f"sweep/{i}/run/metrics.json", metrics(recent=recent, curve=curve))
    (table,) = re.findall(r"<h2>All runs</h2>(.*?)</section>", whole(read(tmp_path / "sweep")), re.DOTALL)
    assert "87 to 88 %" in table and "74 %, handle" not in table
    assert "No rates yet: reward.distance=50.5" in table
    assert table.count(">0.0002<") == 2, "steps are those of the run, whether or not an episode has ended"


def test_seeds_of_one_setting_have_a_curve_each_their_mean_and_a_band() -> None:
    one, other = Line("opened", [1.0, 2.0], [0.0, 0.5]), Line("opened", [1.0, 2.0, 3.0], [1.0, 0.5, 0.5])
    chart = lines("title", "steps", [one, other, Line("grasped", [1.0, 3.0], [0.2, 0.2])])
    assert chart.count("<polygon") == 1 and len(re.findall("<path[^>]*fill='none'", chart)) == 2 + 1 + 1
    (points,) = re.findall("<polygon points='([^']+)'", chart)
    corners = [tuple(map(float, point.split(","))) for point in points.split()]
    up, down = corners[:3], corners[3:][::-1]
    assert up[0][1] < down[0][1] and up[1:] == down[1:], "the band is 0 to 1, then a line"
    (mean,) = [path for path in re.findall("<path d='(M[^']+)'[^>]*stroke-width='1.8'", chart) if path.count("L") == 2]
    assert float(mean[1:].split("L")[0].split()[1]) == pytest.approx((up[0][1] + down[0][1]) / 2, abs=0.11)


def test_a_validation_report_shows_numbers_against_bounds(tmp_path: Path) -> None:
    check = {"name": "finger_gap", "status": "fail", "value": 0.03, "bound": 0.01, "unit": "", "prim": "/scene"}
    check |= {"message": "3 % <filled>", "remedy": "make room"}
    relief = check | {"name": "handle_relief", "status": "pass", "value": 0.015, "message": "", "remedy": ""}
    report = {
        "target": "drawer_7",
        "stage": "a/room.usd",
        "passed": False,
        "graspable": None,
        "checks": [check, relief],
    }
    write(tmp_path / "v/report.json", {"passed": False, "reports": [report]})
    page = whole(read(tmp_path / "v"))
    assert "room.usd: 0 of 1 parts passed" in page and "3 % &lt;filled&gt;" in page and "make room" in page
    assert "width='240.0' height='8' fill='#b3261e'" in page, "three times the bound is drawn as twice the bound"
    assert "width='180.0' height='8' fill='#2a8a3c'" in page, "what passes is green, also above a bound from below"


def test_images_beside_an_evaluation_are_in_its_page(tmp_path: Path) -> None:
    file = tmp_path / "planner.json"
    file.write_bytes((RESULTS / "many_parts_cpu.json").read_bytes())
    (tmp_path / "after.png").write_bytes(b"\x89PNG\r\n\x1a\n rest")
    assert "data:image/png;base64," in whole(read(file))


@pytest.mark.parametrize(
    "values",
    [
        "{",
        "[]",
        "null",
        '{"runs": []}',
        '{"runs": [{"row": 3}]}',
        '{"reports": [7]}',
        '{"reports": [{"passed": true}]}',
        '{"episodes": 3, "success": {"rate": "many", "low": 0, "high": 1}}',
        '{"episodes": 3, "limit_use": [1]}',
        '{"episodes_a_part": 3, "over_parts": {}}',
        '{"curve": [3], "env_steps": 5}',
        '{"curve": [{"iteration": "x"}], "env_steps": 5}',
        '{"rows": [{}], "table": [{"n": 0, "success": 0}]}',
        "[" * 100_000,
    ],
)
def test_damaged_files_are_one_line(values: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x.json").write_text(values)
    earlier = tmp_path / "out.html"
    earlier.write_text("earlier")
    assert cli.main(["report", f"path={tmp_path / 'x.json'}", f"out={earlier}"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "x.json" in error and "bug" not in error
    assert earlier.read_text() == "earlier"


def test_what_cannot_be_reported_is_refused_with_what_can(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    binary = tmp_path / "room.usd"
    binary.write_bytes(b"PXR-USDC\x00\xff\xfe")
    for path, words in ((empty, "cannot be reported"), (binary, "not JSON"), (tmp_path / "no", "does not exist")):
        with pytest.raises(InputError, match=words):
            read(path)
    planner = RESULTS / "many_parts_cpu.json"
    for wrong in (
        ["out=x.txt"],
        [f"out={tmp_path}/x.html", "images=[nowhere.png]"],
        [f"out={tmp_path}/x.html", f"images=[{binary}]"],
    ):
        assert cli.main(["report", f"path={planner}", *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_what_a_file_says_cannot_add_markup() -> None:
    nasty = "<script>x</script>'\"\x00\x1b"
    page = whole(Document(nasty, nasty, ((nasty, table((nasty,), [(nasty,)])),)))
    assert "<script>" not in page and "\x00" not in page and text(nasty) in page


def test_a_table_sets_numbers_right_and_leaves_none_empty() -> None:
    assert "<td class='n'>0.5<td class=''><td class=''>yes" in table(("a", "b", "c"), [(0.5, None, True)])
    assert table(("a",), []) == "<p>none</p>"
    assert "<tr><th" not in table(("", ""), [("x", 1)])


def test_an_image_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.png").write_text("<svg onload=alert(1)>")
    with pytest.raises(InputError, match="not an image"):
        images([tmp_path / "x.png"])


def test_only_the_papers_weights_have_the_papers_figure() -> None:
    weights = settings()["reward"]
    assert results.reported(weights, "twin.usd") == results.TABLE[0]
    assert results.reported(weights, "room.usd") == results.TABLE[1]
    assert results.reported(weights | {"finger": 3.0}, "room.usd") is None
    for further in ("pinch", "grasped_path"):
        assert results.reported(weights | {further: 4.0}, "room.usd") is None


def test_a_column_that_another_repeats_is_left_out(tmp_path: Path) -> None:
    rows = [
        {"fell": "it tilts", "problem": "it tilts by 8", "kind": "a", "ok": False, "calls": 3},
        {"fell": "", "problem": "far", "kind": "b", "calls": 3},
    ]
    page = whole(read(write(tmp_path / "x.json", {"rows": rows})))
    assert "<th>problem<th>kind<th>ok" in page and "<th>fell" not in page
    assert "<span class='fail'>no</span>" in page and "The same in all rows: calls 3." in page


def test_a_run_that_was_cut_is_read_from_its_log(tmp_path: Path) -> None:
    log = pytest.importorskip("torch.utils.tensorboard", reason="torch is not installed")
    folder = run_folder(tmp_path / "drawer")
    (folder / "metrics.json").unlink()
    with log.SummaryWriter(str(folder)) as writer:
        for step in (0, 3):
            writer.add_scalar("Episode/success", 0.25 * step, step)
    page = whole(read(folder))
    assert "Training drawer (not finished)" in page and ">200<" not in page
    assert "<td class=''>environment steps [millions]<td class='n'>0.0002" in page, (
        "4 iterations of 10 worlds and 5 steps"
    )


def test_rates_that_a_plan_cannot_reach_are_left_out_and_numbers_have_their_meaning(tmp_path: Path) -> None:
    values = {"episodes": 8, "success": RATE, "open_95pct": RATE | {"rate": 0.0}, "beyond_plan": ["open_95pct"]}
    values |= {"force": {"mean": 1.0, "min": 0.0, "max": 2.0}, "meanings": {"force": "The maximum force [N]."}}
    page = whole(read(write(tmp_path / "e.json", values)))
    assert "<td class=''>opened<" in page and "<td class=''>open_95pct" not in page
    assert "Not reachable by the plan, which ends at planner.opening: open_95pct." in page
    assert "The maximum force [N]<" in page
