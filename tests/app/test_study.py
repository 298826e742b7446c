"""Studies: plans, draws, ensembles that are the same to the bit, and what comes of them."""

import json
import math
import multiprocessing
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from program import refused, run

from app.simulation import Spread, preset_named, read_preset
from app.study.correlation import Correlation, copula_factor
from app.study.distribution import Choices, distribution_of
from app.study.ensemble import run_study
from app.study.plan import read_plan
from app.study.report import TearCurve
from app.study.sampling import drawn_columns, draws
from app.study.sensitivity import sobol_indices
from physics import Beam, Cubic, Exact, ExactPull, Exponential, break_of

PLAN = """\
samples = {samples}
sampling = "{sampling}"
indices = {indices}
seed = 4

[duct]
preset = "thesis-bile-duct"
theory = "{theory}"
force_N = 1.0

[inputs.modulus_MPa]
distribution = "lognormal"
median = 0.3
factor = 1.4

[inputs.break_stress_MPa]
distribution = "uniform"
low = 0.1
high = 0.3
"""


def written(
    folder: Path,
    *,
    samples: int = 8,
    sampling: str = "sobol",
    indices: bool = False,
    theory: str = "exact",
    more: str = "",
) -> Path:
    path = folder / "plan.toml"
    text = PLAN.format(
        samples=samples, sampling=sampling, indices=str(indices).lower(), theory=theory
    )
    path.write_text(text + more)
    return path


@pytest.mark.parametrize(
    ("shape", "given", "mean", "sd"),
    [
        ("uniform", {"low": 1.0, "high": 3.0}, 2.0, 1.0 / np.sqrt(3.0)),
        ("loguniform", {"low": 1.0, "high": np.e}, np.e - 1.0, 0.492039),
        ("triangular", {"low": 0.0, "mode": 1.0, "high": 2.0}, 1.0, 1.0 / np.sqrt(6.0)),
        ("normal", {"mean": 5.0, "sd": 0.5}, 5.0, 0.5),
        ("lognormal", {"mean": 5.0, "sd": 2.0}, 5.0, 2.0),
        ("lognormal", {"median": 1.0, "factor": np.e}, np.exp(0.5), np.sqrt((np.e - 1) * np.e)),
        # A normal distribution cut off at its middle: half a bell.
        ("normal", {"mean": 0.0, "sd": 1.0, "low": 0.0}, np.sqrt(2 / np.pi), 0.602810),
    ],
)
def test_distributions_have_their_moments(
    shape: str, given: dict[str, float], mean: float, sd: float
) -> None:
    even = (np.arange(400_000) + 0.5) / 400_000
    values = distribution_of(shape, given).at(even)
    assert values.mean() == pytest.approx(mean, rel=1e-4)
    assert values.std() == pytest.approx(sd, rel=5e-3)
    assert np.all(np.diff(values) >= 0.0)


def test_choices_come_by_their_weights() -> None:
    at = Choices(("a", "b", "c"), (1.0, 2.0, 1.0)).at(np.linspace(0.0, 1.0, 4001))
    assert np.bincount(at) / 4001 == pytest.approx([0.25, 0.5, 0.25], abs=1e-3)


@pytest.mark.parametrize("indices", [False, True])
@pytest.mark.parametrize("sampling", ["sobol", "latin-hypercube"])
def test_draws_are_even_and_the_same_block_by_block(sampling: str, indices: bool) -> None:
    def some(first: int, count: int) -> np.ndarray:
        return draws(3, first, count, sampling=sampling, seed=9, indices=indices)

    first = some(0, 64)
    assert np.array_equal(first, some(0, 64))
    assert not np.array_equal(first, draws(3, 0, 64, sampling=sampling, seed=8, indices=indices))
    if sampling == "sobol":  # a sequence: any block of it is the same as in the whole
        assert np.array_equal(np.concatenate([some(0, 16), some(16, 48)]), first)
    # One in each 64th of each input, in both points of a sample.
    for points in (first[::5], first[4::5]) if indices else (first,):
        assert all(sorted(np.floor(64 * row)) == list(range(64)) for row in points.T)
    if indices:  # A, A with one input of B each, B
        for a, *mixed, b in first.reshape(64, 5, 3):
            for k, row in enumerate(mixed):
                assert np.flatnonzero(row != a).tolist() == [k]
                assert row[k] == b[k]


@pytest.mark.parametrize("sampling", ["sobol", "latin-hypercube"])
def test_indices_of_ishigami_s_function(sampling: str) -> None:
    inputs = dict.fromkeys("xyz", distribution_of("uniform", {"low": -np.pi, "high": np.pi}))
    blocks = [draws(3, 2048 * k, 2048, sampling=sampling, seed=1, indices=True) for k in range(4)]
    x, y, z = drawn_columns(inputs, np.concatenate(blocks)).values()
    values = np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)
    found = sobol_indices(list(inputs), np.asarray(values, dtype=np.float64))
    # Closed forms of Ishigami and Homma, 1990.
    assert [each.first for each in found] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.02)
    assert [each.total for each in found] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.02)
    for each, (first, total) in zip(
        found, [(0.3139, 0.5576), (0.4424, 0.4424), (0.0, 0.2437)], strict=True
    ):
        assert abs(each.first - first) < 1.5 * each.first_half
        assert abs(each.total - total) < 1.5 * each.total_half


def test_a_linear_case_has_its_variance_and_bands(tmp_path: Path) -> None:
    # At small strains the cubic's force at break is in proportion to the strength.
    plan = tmp_path / "plan.toml"
    plan.write_text(
        'samples = 4096\nindices = true\n[duct]\ntheory = "cubic"\n'
        '[inputs.break_stress_MPa]\ndistribution = "normal"\nmean = 1e-5\nsd = 1e-6\nlow = 2e-6\n'
        '[inputs.poisson_ratio]\ndistribution = "uniform"\nlow = 0.1\nhigh = 0.4\n'
    )
    assert run("study", plan, "-o", tmp_path / "r").returncode == 0
    own = tmp_path / "own.toml"
    done = run("study", "report", tmp_path / "r", "--json", "--preset", own)
    reported = json.loads(done.stdout)
    preset = read_preset(own.read_bytes(), own.name)
    assert preset.break_stress_MPa == pytest.approx(1e-5, rel=1e-3)
    spread = Spread.of(preset)
    assert spread.modulus_factor == 1.0
    assert spread.strength_factor == pytest.approx(np.exp(0.1), rel=6e-3)
    duct = preset_named("thesis-bile-duct").round_beam()
    event = break_of(Cubic().pull(duct, 0.5 * duct.span), 1e-5)
    assert event is not None
    cell = reported["cells"][0]
    for fraction, away in ((0.05, -1.644854), (0.25, -0.674490), (0.5, 0.0), (0.95, 1.644854)):
        known = event.force * (1.0 + 0.1 * away)
        at = cell["break_force_N"]["torn_at"][f"{fraction:g}"]
        assert at["load"] == pytest.approx(known, rel=1e-3)
        assert at["band_95"][0] < known < at["band_95"][1]
    index = cell["indices"]["break_force_N"]
    assert index["break_stress_MPa"]["first"] == pytest.approx(1.0, abs=0.01)
    assert index["poisson_ratio"]["total"] == pytest.approx(0.0, abs=0.01)
    assert any("break stress would repay being measured" in line for line in reported["summary"])
    assert any("hangs on poisson ratio" in line for line in reported["summary"])
    page = (tmp_path / "r" / "report.html").read_text()
    assert page.count("<img alt=") == 3
    assert not re.search(r'(src|href)="http', page)


def test_the_band_of_a_probability_holds_it_as_often_as_it_says() -> None:
    generator = np.random.default_rng(5)
    held = total = 0
    for _ in range(200):
        curve = TearCurve(generator.random(60))
        at = int(np.searchsorted(curve.loads, 0.3)) - 1
        low, high = curve.low[at], curve.high[at]
        held += int(low <= 0.3 <= high)
        load = curve.load_at(0.5)
        total += int(load[1] <= 0.5 <= load[2])
    # Of 200 with 95 %: 190 +- 4.4 (3 sd = 9).
    assert 176 <= held <= 200
    assert 176 <= total <= 200


@pytest.mark.parametrize("count", [64, 128, 256])
@pytest.mark.parametrize("fraction", [0.01, 0.05, 0.5, 0.95, 0.99])
def test_bands_of_rare_breaks_hold_them_or_are_open(count: int, fraction: float) -> None:
    generator = np.random.default_rng(7)
    held = np.zeros(400, dtype=bool)
    for k in range(400):
        _, low, high = TearCurve(generator.random(count)).load_at(fraction)
        held[k] = not low > fraction and not high < fraction  # nan, an open end, bounds nothing
        # As many ducts are needed as let fewer than 1 in 40 lie all on one side.
        assert math.isnan(low) == (1.0 - (1.0 - fraction) ** count < 0.975)
        assert math.isnan(high) == (1.0 - fraction**count < 0.975)
    assert held.mean() >= 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / 400)


def test_rows_are_what_each_duct_bears_and_carry_their_units(tmp_path: Path) -> None:
    plan = written(
        tmp_path,
        theory="cubic",
        more="\n[inputs.span_mm]\ngrid = [45, 50.8]\n"
        '\n[inputs.preset]\nchoices = ["thesis-bile-duct", "thesis-rubber"]\n',
    )
    plan.write_text(plan.read_text().replace('preset = "thesis-bile-duct"\n', "", 1))
    done = run("study", plan, "-o", tmp_path / "r", "--csv", "--json")
    assert json.loads(done.stdout)["rows"] == 16
    table = pq.read_table(tmp_path / "r" / "results.parquet")
    units = {field.name: (field.metadata or {}).get(b"unit") for field in table.schema}
    assert units["modulus_MPa"] == b"MPa"
    assert units["break_deflection_mm"] == b"mm"
    assert units["distance_to_break"] == b"1"
    about = json.loads(table.schema.metadata[b"bluntdissect"])
    assert about["plan"] == plan.read_text()
    assert about["seed"] == 4
    assert {"bluntdissect", "numpy", "scipy", "pyarrow"} <= set(about["versions"])
    for row in table.to_pylist():
        base = preset_named(row["preset"]).round_beam()
        beam = type(base).round(
            span=row["span_mm"], diameter=2 * base.fibre_distance, modulus=row["modulus_MPa"]
        )
        pull = Cubic().pull(beam, 0.5 * beam.span)
        event = break_of(pull, row["break_stress_MPa"])
        assert event is not None
        assert row["break_force_N"] == pytest.approx(event.force, rel=1e-9)
        assert row["deflection_mm"] == pytest.approx(pull.to_force(1.0).deflection, rel=1e-9)
        assert row["fault"] is None
    lines = (tmp_path / "r" / "results.csv").read_text().splitlines()
    assert lines[0].split(",") == table.column_names
    assert len(lines) == 17


@pytest.mark.long  # processes are killed
def test_results_are_the_same_to_the_bit_whatever_dies(tmp_path: Path) -> None:
    plan = read_plan(written(tmp_path, samples=6 * 341, indices=False, more=""))
    alone = run_study(plan, tmp_path / "alone", workers=1)
    assert (alone.rows, alone.solved, alone.faults) == (2046, 2046, 0)
    killed: list[int] = []

    def kill_one(_done: int, _total: int) -> None:
        children = multiprocessing.active_children()
        if children and not killed:
            killed.append(children[0].pid or 0)
            os.kill(killed[0], signal.SIGKILL)

    run_study(plan, tmp_path / "two", workers=2, progress=kill_one)
    assert killed
    wanted = (tmp_path / "alone" / "results.parquet").read_bytes()
    assert (tmp_path / "two" / "results.parquet").read_bytes() == wanted
    assert run_study(plan, tmp_path / "two").solved == 0


KILLED = """
import os, signal, sys
from pathlib import Path
from app.study.ensemble import run_study
from app.study.plan import read_plan

def kill(done, total):
    if done > 2048:
        os.kill(os.getpid(), signal.SIGKILL)

run_study(read_plan(Path(sys.argv[1])), Path(sys.argv[2]), workers=1, progress=kill)
"""


def test_a_killed_program_goes_on_where_it_was(tmp_path: Path) -> None:
    plan = written(tmp_path, samples=4096)
    place = tmp_path / "killed"
    ended = subprocess.run([sys.executable, "-c", KILLED, plan, place], check=False)
    assert ended.returncode == -signal.SIGKILL
    assert len(list(place.glob("parts/*.parquet"))) == 3
    assert not (place / "results.parquet").exists()
    done = json.loads(run("study", plan, "-o", place, "--workers", 1, "--json").stdout)
    assert (done["rows"], done["solved_now"]) == (4096, 1024)
    run_study(read_plan(plan), tmp_path / "alone", workers=1)
    wanted = (tmp_path / "alone" / "results.parquet").read_bytes()
    assert (place / "results.parquet").read_bytes() == wanted
    output = refused(["study", written(tmp_path, samples=65), "-o", place])
    assert "holds results of another plan" in output


@pytest.mark.long  # a cluster starts
def test_a_dask_cluster_gives_the_same(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    plan = read_plan(written(tmp_path, samples=2100))
    run_study(plan, tmp_path / "alone", workers=1)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1"
    ) as cluster:
        run_study(plan, tmp_path / "cluster", scheduler=cluster.scheduler_address)
    wanted = (tmp_path / "alone" / "results.parquet").read_bytes()
    assert (tmp_path / "cluster" / "results.parquet").read_bytes() == wanted


def test_beds_and_organs_are_varied_too(tmp_path: Path) -> None:
    from assets import BILE_DUCT

    (tmp_path / "own.organ").write_bytes(BILE_DUCT.read_bytes())
    plan = tmp_path / "plan.toml"
    plan.write_text(
        'samples = 2\n[duct]\npreset = "assumed-duct"\ntheory = "exact"\norgan = "own.organ"\n'
        '[inputs.modulus_MPa]\ndistribution = "uniform"\nlow = 0.2\nhigh = 0.4\n'
        "[inputs.wall_mm]\ngrid = [1.0, 1.5]\n"
    )
    assert run("study", plan, "-o", tmp_path / "organ").returncode == 0
    table = pq.read_table(tmp_path / "organ" / "results.parquet").to_pydict()
    assert min(table["break_force_N"]) > 0.0
    thin, thick = table["break_force_N"][::2], table["break_force_N"][1::2]
    assert all(a < b for a, b in zip(thin, thick, strict=True))
    plan.write_text(
        "samples = 1\n[bed]\nlift_mm = 3\nsteps = 6\nelements = 16\nstrands = 60\n"
        "[inputs.bed.strength_kPa]\ngrid = [2.0, 8.0]\n"
        '[inputs.bed.scatter]\ndistribution = "uniform"\nlow = 0.1\nhigh = 0.3\n'
    )
    assert run("study", plan, "-o", tmp_path / "bed", "--workers", 1).returncode == 0
    table = pq.read_table(tmp_path / "bed" / "results.parquet").to_pydict()
    weak, strong = table["largest_force_N"]
    assert 0.0 < weak < strong
    assert table["fault"] == [None, None]
    printed = run("study", "report", tmp_path / "bed").stdout
    assert printed.count("0.0 % of ducts break before the pull ends.") == 2


@pytest.mark.parametrize("bed", [False, True])
def test_an_exponential_wall_breaks_as_solve_says_and_stiffens_in_its_bed(
    bed: bool, tmp_path: Path
) -> None:
    plan = tmp_path / "plan.toml"
    where = "[bed]\nlift_mm = 3\nsteps = 6\nelements = 16\nstrands = 60\n" if bed else ""
    text = (
        f'samples = 1\n[duct]\npreset = "thesis-bile-duct"\nlaw = "exponential"\n{where}'
        "[inputs.stiffening]\ngrid = [0, 2.5]\n"
        "[inputs.break_stress_MPa]\ngrid = [0.1, 0.3]\n"
    )
    plan.write_text(text)
    assert run("study", plan, "-o", tmp_path / "r", "--workers", 1).returncode == 0
    table = pq.read_table(tmp_path / "r" / "results.parquet").to_pylist()
    assert len(table) == 4
    for row in table:
        assert row["fault"] is None
    if bed:
        force = {
            (row["stiffening"], row["break_stress_MPa"]): row["largest_force_N"] for row in table
        }
        assert force[2.5, 0.3] > force[0.0, 0.3] > 0.0
    else:
        for row in table:
            pull = Exact(Exponential(row["stiffening"])).pull(
                preset_named("thesis-bile-duct").round_beam(), 25.4
            )
            event = break_of(pull, row["break_stress_MPa"])
            assert event is not None
            assert row["break_force_N"] == pytest.approx(event.force, rel=1e-6)
    plan.write_text(text.replace("[inputs.stiffening]\ngrid = [0, 2.5]\n", ""))
    message = refused(["study", plan, "-o", tmp_path / "none"])
    assert "duct.law exponential needs stiffening" in message


def test_ducts_are_lifted_to_a_distance_to_break_and_held_while_they_relax(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    text = (
        "[bed]\nlift_mm = 20\nuntil = 0.5\nsteps = 40\nelements = 16\nstrands = 60\nstep_s = 0.2\n"
        "[inputs.bed.hold_s]\ngrid = [0.2, 10.0]\n"
    )
    plan.write_text(text)
    assert run("study", plan, "-o", tmp_path / "bed", "--workers", 1).returncode == 0
    table = pq.read_table(tmp_path / "bed" / "results.parquet").to_pydict()
    assert table["fault"] == [None, None]
    assert table["least_distance_to_break"] == pytest.approx([0.5, 0.5], abs=1e-3)
    (short, long), (soon, late) = table["last_force_N"], table["last_distance_to_break"]
    assert long < 0.96 * short
    assert late > soon + 0.01
    assert table["last_lift_mm"][0] == table["last_lift_mm"][1] < 20.0
    plan.write_text(text.replace("step_s = 0.2\n", ""))
    assert "bed.hold_s goes with bed.step_s" in refused(["study", plan, "-o", tmp_path / "none"])


def test_an_organ_is_set_up_once_for_all_that_are_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from assets import BILE_DUCT

    (tmp_path / "plan.toml").write_text(
        f'samples = 6\n[duct]\norgan = "{BILE_DUCT}"\n'
        '[inputs.modulus_MPa]\ndistribution = "uniform"\nlow = 0.2\nhigh = 0.4\n'
        "[inputs.grasp_fraction]\ngrid = [0.4, 0.7]\n"
    )
    grasps: list[float] = []
    pull = Exact.pull

    def counted(self: Exact, beam: Beam, grasp: float) -> ExactPull:
        grasps.append(grasp / beam.span)
        return pull(self, beam, grasp)

    monkeypatch.setattr(Exact, "pull", counted)
    assert run_study(read_plan(tmp_path / "plan.toml"), tmp_path / "results").faults == 0
    assert sorted(grasps) == pytest.approx([0.4, 0.7])


def rank_of(rows: np.ndarray) -> float:
    """Spearman's rank correlation of two rows."""
    order = rows.argsort(axis=1).argsort(axis=1)
    return float(np.corrcoef(order[0], order[1]).ravel()[1])


TOGETHER = '[[correlation]]\nof = ["modulus_MPa", "break_stress_MPa"]\n'


@pytest.mark.parametrize("rank", [0.8, -0.5])
@pytest.mark.parametrize("sampling", ["sobol", "latin-hypercube"])
def test_inputs_go_together_by_rank_and_keep_their_distributions(
    rank: float, sampling: str, tmp_path: Path
) -> None:
    path = written(tmp_path, samples=4096, sampling=sampling, theory="cubic")
    text = path.read_text()
    alone = read_plan(path)
    path.write_text(text.replace("[duct]", f"{TOGETHER}rank = {rank}\n[duct]"))
    together = read_plan(path)
    run_study(alone, tmp_path / "alone")
    run_study(together, tmp_path / "together")
    names = ["modulus_MPa", "break_stress_MPa"]
    rows = [
        np.stack([pq.read_table(tmp_path / name / "results.parquet")[each] for each in names])
        for name in ("alone", "together")
    ]
    assert rank_of(rows[0]) == pytest.approx(0.0, abs=0.05)
    assert rank_of(rows[1]) == pytest.approx(rank, abs=0.01)
    assert np.array_equal(rows[0][0], rows[1][0])
    low, mid, high = np.quantile(rows[1][1], [0.05, 0.5, 0.95])  # even from 0.1 to 0.3
    assert (low, mid, high) == pytest.approx((0.11, 0.2, 0.29), abs=0.004)


def test_correlations_that_no_inputs_can_have_are_named() -> None:
    pairs = [("a", "b", 0.9), ("b", "c", 0.9), ("a", "c", -0.9)]
    with pytest.raises(ValueError, match="no inputs can have these correlations"):
        copula_factor("abc", [Correlation(*each) for each in pairs])


@pytest.mark.parametrize(
    ("change", "output"),
    [
        (("samples = 8", "samples = 0"), "line 1: samples must be a whole number from 1"),
        (("samples = 8\n", ""), "samples is missing"),
        (('"sobol"', '"random"'), "line 2: sampling must be one of sobol, latin-hypercube"),
        (("seed = 4", "sead = 4"), "line 4: sead is not known"),
        (('"exact"', '"exakt"'), "line 8: duct.theory must be one of cubic"),
        (("force_N = 1.0", "force = 1.0"), "line 9: duct.force is not known"),
        (("median = 0.3", "median = -1"), "line 11: inputs.modulus_MPa is no distribution"),
        (("factor = 1.4", "factor = 0.4"), "factor, the geometric standard deviation"),
        (("factor = 1.4", "sigma = 0.4"), "has no 'sigma'"),
        (("lognormal", "gauss"), "distribution must be one of uniform"),
        (("low = 0.1", "low = 0.5"), "low must be below high"),
        (("low = 0.1", "low = -0.1"), "line 16: inputs.break_stress_MPa reaches from -0.1"),
        (("[inputs.modulus_MPa]", "[inputs.modulus]"), "line 11: inputs.modulus is no input"),
        (("force_N = 1.0", "modulus_MPa = 1.0"), "inputs.modulus_MPa is fixed as well"),
        (("force_N = 1.0", "break_force_N = 1.0"), "a strength is given by one of them"),
        (("force_N = 1.0", 'organ = "no.organ"'), "no.organ: no such file"),
        (("[duct]", "[duct"), "is no TOML file"),
        (("[duct]", TOGETHER + "rank = 1.5\n[duct]"), "line 8: correlation.rank must lie between"),
        (("[duct]", TOGETHER + "[duct]"), "line 6: correlation must have of, two inputs, and rank"),
        (
            ("[duct]", TOGETHER.replace("modulus_MPa", "wall_mm") + "rank = 0.5\n[duct]"),
            "line 7: correlation.of 'wall_mm' is no input with a distribution",
        ),
        (
            ("indices = false\nseed = 4\n", f"indices = true\nseed = 4\n{TOGETHER}rank = 0.5\n"),
            "indices goes not with correlation",
        ),
        (("[duct]", "[bed]\nname = 'firm'\n[duct]"), "duct.theory goes not with a bed"),
    ],
)
def test_what_is_wrong_in_a_plan_is_named(
    change: tuple[str, str], output: str, tmp_path: Path
) -> None:
    plan = written(tmp_path)
    text = plan.read_text()
    assert change[0] in text
    plan.write_text(text.replace(*change))
    message = refused(["study", plan, "-o", tmp_path / "r"])
    assert "plan.toml" in message
    assert output in message
    assert not (tmp_path / "r").exists()


def test_folders_that_hold_something_else_are_left_alone(tmp_path: Path) -> None:
    plan = written(tmp_path)
    other = tmp_path / "other"
    other.mkdir()
    (other / "thesis.txt").write_text("mine")
    assert "holds files that are of no study" in refused(["study", plan, "-o", other])
    assert [each.name for each in other.iterdir()] == ["thesis.txt"]
    assert "holds no results" in refused(["study", "report", tmp_path])


def test_a_duct_that_cannot_be_is_a_fault_and_not_the_end(tmp_path: Path) -> None:
    plan = written(tmp_path, more="\n[inputs.grasp_mm]\ngrid = [25, 60]\n")
    done = json.loads(run("study", plan, "-o", tmp_path / "r", "--json").stdout)
    assert (done["rows"], done["faults"]) == (16, 8)
    faults = pq.read_table(tmp_path / "r" / "results.parquet")["fault"].to_pylist()
    assert faults[1] == "a grasp at 60 mm is not between clamps 50.8 mm apart"


CASES = """
samples = 3
seed = {seed}

[anatomy]
{given}

[inputs.anatomy.artery_strength_MPa]
{strength}
"""
PULL = 'tube = "gallbladder"\nat_mm = 8.0\npull_mm = 12.0\nazimuth_deg = 75.0\nelevation_deg = 40.0'
FEEBLE = "grid = [0.1, 100.0]"


def cases(folder: Path, given: str = PULL, strength: str = FEEBLE, seed: int = 11) -> Path:
    path = folder / "cases.toml"
    path.write_text(CASES.format(given=given, strength=strength, seed=seed))
    return path


def test_a_study_of_anatomies_says_what_tears_first_and_goes_on_where_it_was(
    tmp_path: Path,
) -> None:
    """Feeble arteries tear first and at once, and strong ones never; each case by its own seed."""
    plan = read_plan(cases(tmp_path))
    run_study(plan, tmp_path / "whole", workers=1)
    run("study", "report", tmp_path / "whole")
    table = pq.read_table(tmp_path / "whole" / "results.parquet")
    rows = table.to_pylist()
    assert [row["case"] for row in rows] == [11, 11, 12, 12, 13, 13]
    assert not any(row["fault"] for row in rows)
    for feeble, strong in zip(rows[::2], rows[1::2], strict=True):
        assert feeble["first_torn"] in ("artery", "artery2", "rha")
        assert feeble["lost_blood_ml"] > 0.0
        assert feeble["critical_view"] == 0
        assert strong["first_torn"] not in ("artery", "artery2", "rha")
        assert not strong["lost_blood_ml"]
        if strong["first_torn"] is not None:
            assert 0.0 < feeble["break_deflection_mm"] < strong["break_deflection_mm"] <= 12.0
    found = json.loads((tmp_path / "whole" / "report.json").read_text())
    for cell, some in zip(found["cells"], (rows[::2], rows[1::2]), strict=True):
        named = [row["first_torn"] or "nothing" for row in some]
        first = cell["first_torn"]
        assert {tube: each["count"] for tube, each in first.items()} == {
            tube: named.count(tube) for tube in named
        }
        for each in first.values():
            low, high = each["band_95"]
            assert 0.0 <= low < each["count"] / 3 < high or each["count"] == 3
    assert "tears first" in (tmp_path / "whole" / "report.html").read_text()
    # What one draw gives is written, the rest is solved when it is started again.
    half = tmp_path / "half"

    def end(done: int, _: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(plan, half, workers=1, progress=end)
    assert run_study(plan, half, workers=1).solved == 4
    assert (half / "results.parquet").read_bytes() == (
        tmp_path / "whole" / "results.parquet"
    ).read_bytes()


def test_an_older_key_of_a_pull_is_read(tmp_path: Path) -> None:
    plan = read_plan(cases(tmp_path, PULL + "\nspeed_mm_s = 5.0"))
    assert list(plan.values_of("anatomy.speed_mm_per_s")) == [5.0]


def test_a_script_is_put_to_an_anatomy_whose_strands_each_seed_scatters(tmp_path: Path) -> None:
    (tmp_path / "pull.toml").write_text(
        'step = [{ do = "take", instrument = "grasper" }, { do = "grab", tube = "cystic", at_mm = '
        '12.0 }, { do = "lead", by_mm = [0, 0, 8] }]'
    )
    given = 'name = "short-cystic"\nscript = "pull.toml"'
    plan = cases(tmp_path, given.replace("short-cystic", "normal"), 'distribution = "uniform"\n'
                 "low = 1.0\nhigh = 2.0")  # fmt: skip
    run_study(read_plan(plan), tmp_path / "out", workers=1)
    rows = pq.read_table(tmp_path / "out" / "results.parquet").to_pylist()
    assert len({row["break_force_N"] for row in rows}) == 3
    assert all(row["fault"] is None and "break_deflection_mm" not in row for row in rows)


@pytest.mark.parametrize(
    ("given", "strength", "says"),
    [
        ("", FEEBLE, "anatomy needs either script, or all of tube, at_mm, pull_mm"),
        ('tube = "cystic"', FEEBLE, "needs either script, or all of tube, at_mm, pull_mm"),
        (PULL + '\nscript = "x.toml"', FEEBLE, "anatomy.script cannot be read: "),
        (
            PULL.replace("gallbladder", "ureter"),
            FEEBLE,
            "no tube 'ureter' in the first case:",
        ),
        (PULL + '\nname = "usual"', FEEBLE, "must be one of normal, accessory-artery"),
        (PULL + "\nforce_N = 1.0", FEEBLE, "anatomy.force_N is not known; there are name, script"),
        (PULL, "grid = [0.0]", "artery_strength_MPa.grid must be from 0.001 to 1000 MPa, got 0"),
        (PULL + "\n[duct]\nforce_N = 1.0", FEEBLE, "duct.force_N goes not with [anatomy]"),
    ],
)
def test_refuses_studies_of_anatomies_that_cannot_be(
    tmp_path: Path, given: str, strength: str, says: str
) -> None:
    assert says in refused(["study", cases(tmp_path, given, strength), "-o", tmp_path / "out"])
