"""Campaigns of many processes: what is lost, what is kept, and on which engines they run."""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import antiosc as ao
from mpi import ENVIRONMENT, run_ranks

INPUTS = {"x": ao.uniform(0.0, 1.0)}
#: A campaign in a program; a worker that finds no file "killed" makes it and dies.
PROGRAM = """
import os, signal, sys
from pathlib import Path
import antiosc as ao

def square(x):
    mark = Path("killed")
    if 0.4 < x < 0.6 and not mark.exists() and "dask" in sys.argv:
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"square": x * x, "worker": os.getpid()}

def main(executor):
    many = ao.monte_carlo(
        square, {"x": ao.uniform(0.0, 1.0)}, 400, executor=executor, store="campaign.csv"
    )
    print(len(many.failed), len(set(many.values["worker"])), sum(many.values["square"]))

if __name__ == "__main__":
    if "dask" in sys.argv:
        from distributed import Client, LocalCluster
        with LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster:
            with Client(cluster) as client:
                main(client.get_executor())
    else:
        from mpi4py.futures import MPIPoolExecutor
        with MPIPoolExecutor() as pool:
            main(pool)
"""


def square(x: float) -> dict[str, float]:
    return {"square": x * x}


def square_or_die(x: float) -> dict[str, float]:
    if x > 0.99:
        os.kill(os.getpid(), signal.SIGKILL)
    return square(x)


def test_parts_are_stored_as_they_come(tmp_path):
    """The first run ends when the store has others, or after a minute, which is too late."""
    path = tmp_path / "campaign.csv"
    first = []

    def run(x):
        if not first:
            first.append(x)
            until = time.monotonic() + 60.0
            while len(path.read_text().splitlines()) < 100:
                if time.monotonic() > until:
                    raise ao.AntioscError("nothing was stored meanwhile")
                time.sleep(0.01)
        return square(x)

    with ThreadPoolExecutor(2) as executor:
        many = ao.monte_carlo(run, INPUTS, 300, executor=executor, store=path)
    assert not many.failed
    assert np.array_equal(many.values["square"], many.inputs["x"] ** 2)


def test_what_a_dead_process_took_with_it_is_made_again(tmp_path):
    path = tmp_path / "campaign.csv"
    fork = multiprocessing.get_context("fork")
    lost = pytest.warns(ao.AccuracyWarning, match="the executor returned no result")
    with ProcessPoolExecutor(1, fork) as executor, lost:
        broken = ao.monte_carlo(square_or_die, INPUTS, 500, executor=executor, store=path)
    assert 0 < len(broken.failed) < 500
    whole = ao.monte_carlo(square, INPUTS, 500, store=path)
    assert not whole.failed
    again = ao.monte_carlo(lambda x: "no number", INPUTS, 500, store=path)  # none is made
    assert np.array_equal(again.values["square"], again.inputs["x"] ** 2)


def ran(command: list[str], folder: Path) -> list[float]:
    """Failures, workers and sum of squares that the program prints."""
    (folder / "program.py").write_text(PROGRAM)
    given = {**os.environ, **ENVIRONMENT}
    found = subprocess.run(
        command, cwd=folder, env=given, capture_output=True, text=True, timeout=120, check=False
    )
    assert found.returncode == 0, found.stderr
    return [float(word) for word in found.stdout.split()]


def total() -> float:
    return float(np.sum(ao.monte_carlo(square, INPUTS, 400).values["square"]))


@pytest.mark.slow
@pytest.mark.skipif(not importlib.util.find_spec("distributed"), reason="needs dask.distributed")
def test_dask_goes_on_without_a_worker_that_was_killed(tmp_path):
    failed, _, squares = ran([sys.executable, "program.py", "dask"], tmp_path)
    assert (tmp_path / "killed").exists()
    assert failed == 0
    assert squares == pytest.approx(total())


@pytest.mark.mpi
@pytest.mark.skipif(not importlib.util.find_spec("mpi4py"), reason="needs mpi4py")
def test_ranks_are_workers(tmp_path):
    command = ["mpiexec", "-n", "3", sys.executable, "-m", "mpi4py.futures", "program.py"]
    failed, workers, squares = ran(command, tmp_path)
    assert failed == 0
    assert workers == 2
    assert squares == pytest.approx(total())


@pytest.mark.mpi
def test_several_ranks_do_not_write_one_store(tmp_path: Path) -> None:
    script = """
    import sys
    import antiosc as ao
    from mpi4py import MPI

    try:
        ao.monte_carlo(lambda x: x, {"x": ao.uniform(0.0, 1.0)}, 3, store=sys.argv[1])
    except ao.InputError as error:
        print("2 MPI ranks" in str(error))
    """
    path = tmp_path / "campaign.csv"
    assert run_ranks(2, script, str(path)) == ["True\n", "True\n"]
    assert not path.exists()


def test_a_line_that_was_cut_is_made_again(tmp_path):
    path = tmp_path / "campaign.csv"
    whole = ao.monte_carlo(square, INPUTS, 100, store=path)
    path.write_text(path.read_text()[:-5])
    made = []
    again = ao.monte_carlo(lambda x: made.append(x) or square(x), INPUTS, 100, store=path)
    assert made == [whole.inputs["x"][99]]
    assert np.array_equal(again.values["square"], whole.values["square"])


def test_runs_that_all_fail_alike_end_the_study_at_once():
    begun = []

    def run(x):
        begun.append(x)
        raise ao.AntioscError("no law is known")

    with pytest.raises(ao.AntioscError, match=r"first 10 of 500 runs failed alike.*no law"):
        ao.monte_carlo(run, INPUTS, 500)
    assert len(begun) == 10


def test_runs_that_fail_apart_do_not_end_the_study(tmp_path):
    """Runs that failed before are made again, and fail alike."""
    path = tmp_path / "campaign.csv"

    def run(x):
        if x < 0.9:
            raise ao.AntioscError("too small" if path.read_text().count("small") else f"{x} fails")
        return square(x)

    for _ in range(2):
        with pytest.warns(ao.AccuracyWarning, match="runs failed"):
            many = ao.monte_carlo(run, INPUTS, 500, store=path)
        assert set(many.failed) == set(np.flatnonzero(many.inputs["x"] < 0.9))
