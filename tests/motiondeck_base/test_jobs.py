"""Tasks on a Dask cluster of two worker processes, and beside it in this process."""

import json
import os
import signal

import numpy as np
import pytest
from joblib import delayed

import synthetic
from benchmarks.centralized import frequencies
from bodies import waving
from cluster_tasks import alone_in_its_process, dies, dies_once, product, refuses
from command_line import invoked
from controller.learning.learn import learn
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.library.motion_library import save_library
from controller.motion.clip import Clip
from controller.motion.formats.writing import bvh_text, write_clip
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.jobs import ALONE, Jobs, _on_cluster, spread
from sim.robots.retarget_files import MANIFEST, retarget_files
from simulated_bodies import bent_pose, human
from small_robots import calibrated, humanoid

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, processes=True, dashboard_address=None, silence_logs=50
    ) as made:
        made.scheduler.allowed_failures = 1
        yield made


@pytest.fixture
def jobs(cluster):
    return Jobs.parse(cluster.scheduler_address.replace("tcp", "dask"))


def test_results_are_those_of_one_process_bit_for_bit(jobs):
    tasks = [delayed(product)(seed) for seed in range(12)]
    here = {seed: values for seed, _, values in spread(tasks, ALONE)}
    there = list(spread(tasks, jobs))
    assert sorted(seed for seed, _, _ in there) == list(range(12))
    assert all(np.array_equal(values, here[seed]) for seed, _, values in there)
    pids = {pid for _, pid, _ in there}
    assert len(pids) == 2
    assert os.getpid() not in pids


def test_results_come_in_order(jobs):
    assert list(spread([], jobs)) == []
    tasks = (delayed(product)(seed, 10 + 40 * (seed % 3 == 0)) for seed in range(12))
    assert [seed for seed, _, _ in spread(tasks, jobs)] == list(range(12))


def test_a_process_runs_one_task_at_a_time_however_many_threads_it_has(jobs, tmp_path):
    assert sorted(spread((delayed(alone_in_its_process)(n, tmp_path) for n in range(12)), jobs)) == list(range(12))


def test_what_a_task_raises_comes_out(jobs):
    with pytest.raises(MotiondeckError, match="task 3 is refused"):
        list(spread((delayed(refuses)(number) for number in range(6)), jobs))


@pytest.mark.thorough
def test_a_lost_worker_costs_only_its_task(jobs, tmp_path):
    tasks = (delayed(dies_once)(number, tmp_path / "died") for number in range(20))
    assert sorted(spread(tasks, jobs)) == list(range(20))
    assert (tmp_path / "died").exists()


@pytest.mark.thorough
def test_a_task_that_kills_its_workers_is_given_up(cluster, jobs, monkeypatch):
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 0)
    with pytest.raises(MotiondeckError, match="gave a task up"):
        list(spread([delayed(dies)(0)], jobs))


def test_recordings_are_read_on_a_cluster_as_here(jobs, tmp_path):
    for number, rate in enumerate((30.0, 120.0)):
        (tmp_path / f"swing{number}.bvh").write_text(bvh_text(waving(rate, 4.0, still=1.0)))
    (tmp_path / "broken.bvh").write_text("HIERARCHY\n")
    network = EchoStateRecipe(neurons=60, washout=60, drives=1)
    told, files = [], []
    for where in (ALONE, jobs):
        steps = []
        learned = learn([tmp_path], "mine", network=network, seeds=[0], progress=steps.append, jobs=where)
        files.append(tmp_path / f"{len(files)}.safetensors")
        save_library(learned.library, files[-1])
        told.append((steps, [(motion.name, motion.remedy) for motion in learned.motions]))
    assert told[0] == told[1]
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.thorough
def test_files_are_carried_on_a_cluster_as_here_though_a_worker_is_killed(cluster, jobs, tmp_path):
    (tmp_path / "small.xml").write_text(humanoid())
    (tmp_path / "small.toml").write_text(calibrated(tmp_path / "small.xml").to_toml(tmp_path))
    (tmp_path / "takes").mkdir()
    for number in range(5):
        poses = [bent_pose(human(), relb=(1.3, 0, 0), rank=(0, 0.02 * number * np.sin(0.1 * k), 0)) for k in range(31)]
        roots, rotations = np.array([p.root_position for p in poses]), np.array([p.rotation for p in poses])
        write_clip(Clip("clip", human(), 60.0, roots, rotations), tmp_path / "takes" / f"{number}.bvh")

    def carry(out, where, done=lambda number: None):
        rows = retarget_files(tmp_path / "small.toml", [tmp_path / "takes"], tmp_path / out, "mjlab", None, where)
        for number, row in enumerate(rows):
            assert row.error is None
            done(number)
        manifest = [json.loads(line) for line in (tmp_path / out / MANIFEST).read_text().splitlines()]
        return sorted(map(str, manifest)), {file.name: file.read_bytes() for file in (tmp_path / out).glob("*.npz")}

    def kill(number):
        if number == 1:
            os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)

    here, there = carry("here", ALONE), carry("there", jobs, kill)
    assert len(here[1]) == 5
    assert here == there


def test_an_index_is_the_same_wherever_recordings_are_read(cluster, tmp_path, capsys):
    takes = tmp_path / "takes"
    takes.mkdir()
    for number in range(4):
        (takes / f"{number}.bvh").write_text(bvh_text(waving(60.0, 2.0 + 0.5 * number)))
    (takes / "broken.bvh").write_text("HIERARCHY\n")
    files = []
    for where in ("1", cluster.scheduler_address.replace("tcp", "dask")):
        files.append(tmp_path / f"{len(files)}.index")
        frequencies.index([str(takes)], files[-1], where)
        said = capsys.readouterr()
        assert "4 motions" in said.out
        assert "left out" in said.err
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_preflight_on_a_cluster_comes_to_the_same_verdicts(cluster, tmp_path, monkeypatch):
    file = tmp_path / "small.safetensors"
    save_library(synthetic.small_library(), file)
    said = []
    for where in ("1", cluster.scheduler_address.replace("tcp", "dask")):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / str(len(said))))  # nothing is kept from the first one
        said.append(invoked("preflight", file, "--robot", "mannequin", "--json", "--motions-only", "--jobs", where))
    assert said[0].stdout.startswith("{")
    assert said[0].stdout == said[1].stdout


def test_few_tasks_are_made_before_they_are_needed(jobs):
    made = []

    def tasks():
        for number in range(1000):
            made.append(number)
            yield delayed(refuses)(10 * number)

    results = _on_cluster(tasks(), jobs.cluster)  # as they come: of `spread` the first may come after many others
    next(results)
    results.close()
    assert len(made) <= 12


@pytest.mark.parametrize("text", ["0", "-2", "two", "dask://here", "tcp://here:1", ""])
def test_other_jobs_are_refused(text):
    with pytest.raises(MotiondeckError, match="give a number of processes, -1 for one per core, or dask://HOST:PORT"):
        Jobs.parse(text)


def test_where_jobs_run():
    assert (Jobs.parse("3"), Jobs.parse("-1")) == (Jobs(3), Jobs(-1))
    assert Jobs.parse("dask://robot-lab.local:8786") == Jobs(cluster="robot-lab.local:8786")
