"""Workers that do not fit are named before work, by what they lack; the others do it."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import camkit
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.batch.cluster import connection, crew, remote
from camkit.runtime.batch.cluster.connection import NoAnswer, answer_within
from tests.capture_factory import write_tiny_captures
from tests.runtime.batch.cluster.farm import Farm

OTHER_VERSION = """
import camkit
camkit.__version__ = "0.0.9"
"""
OLD_METADATA = """
import importlib.metadata
importlib.metadata.version = lambda name: "0.0.9"
"""
NO_CAMKIT = """
import sys

class Lack:
    def find_spec(self, name, *_):
        if name == "camkit":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Lack())
"""
OTHER_MACHINE = """
import platform
platform.machine = lambda: "riscv64"
"""
OTHER_FOLDERS = """
import pathlib

def hide(is_file):
    pathlib.Path.is_file = lambda path: ".camkit-run" not in path.name and is_file(path)

hide(pathlib.Path.is_file)
"""
FULL_DISK = """
import pathlib

def fill(write_bytes):
    def fail(path, data):
        if ".part" in path.name and "camkit-bundles" in str(path):
            raise OSError(28, "No space left on device")
        return write_bytes(path, data)

    pathlib.Path.write_bytes = fail

fill(pathlib.Path.write_bytes)
"""
UNFIT = {
    "version": (OTHER_VERSION, "has camkit 0.0.9, not "),
    "none": (NO_CAMKIT, "lacks camkit"),
    "machine": (OTHER_MACHINE, "is riscv64, this machine "),
    "folders": (OTHER_FOLDERS, "where the pictures go"),
    "disk": (FULL_DISK, "No space left on device"),
    "memory": (
        OLD_METADATA,
        "MB for files, one may take 930 MB: give it more or lower max_mem_bytes",
    ),
}


@pytest.fixture(scope="module")
def farm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    with Farm(tmp_path_factory.mktemp("farm")) as farm:
        for name, (preload, _) in UNFIT.items():
            memory = "900MB" if name == "memory" else "2GB"
            farm.add_worker(name, preload=preload, memory=memory)
        farm.wait(len(UNFIT))
        yield farm


def test_every_worker_that_does_not_fit_is_named_by_what_it_lacks(
    farm: Farm, tmp_path: Path
) -> None:
    bundle = write_tiny_captures(tmp_path, ["a", "b"])
    notices: list[str] = []
    with farm.client() as client:

        def run(out: str, **choices: Any) -> list[camkit.FileResult]:
            return camkit.process(
                tmp_path,
                bundle=bundle,
                out_dir=tmp_path / out,
                client=client,
                on_notice=notices.append,
                **choices,
            )

        with pytest.raises(ContractError, match="no worker of"):
            run("none")
        workers = client.scheduler_info(n_workers=-1)["workers"]
        names = {address: worker["name"] for address, worker in workers.items()}
        told = {names[notice.split()[1]]: notice for notice in notices}
        assert told.keys() == UNFIT.keys()
        for name, (_, reason) in UNFIT.items():
            assert reason in told[name], told[name]

        notices.clear()
        results = run("small", max_mem_bytes=500_000_000)
        assert [r.status for r in results] == ["ok", "ok"], "the one with little memory fits now"
        assert len(notices) == len(UNFIT) - 1


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make certificates with")
def test_certificates_are_those_of_dasks_configuration(tmp_path: Path) -> None:
    bundle = write_tiny_captures(tmp_path, ["a"])
    key, cert = tmp_path / "key.pem", tmp_path / "cert.pem"
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2"),
            *("-subj", "/CN=127.0.0.1", "-keyout", str(key), "-out", str(cert)),
        ],
        check=True,
        capture_output=True,
    )
    env = {"DASK_DISTRIBUTED__COMM__TLS__CA_FILE": str(cert)}
    for role in ("SCHEDULER", "WORKER", "CLIENT"):
        env[f"DASK_DISTRIBUTED__COMM__TLS__{role}__KEY"] = str(key)
        env[f"DASK_DISTRIBUTED__COMM__TLS__{role}__CERT"] = str(cert)
    with Farm(tmp_path / "farm", scheme="tls", env=env) as farm:
        farm.add_worker("one")
        command = [
            *(sys.executable, "-m", "camkit", "process", str(tmp_path / "a.dng")),
            *("--bundle", str(bundle), "--out-dir", str(tmp_path / "out")),
            *("--scheduler", farm.address),
        ]
        for _ in range(60):
            done = subprocess.run(
                command, env={**os.environ, **env}, capture_output=True, text=True, check=False
            )
            if "no workers" not in done.stderr and "no dask scheduler" not in done.stderr:
                break
        stranger = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, (tmp_path / "out" / "a.exr").is_file()) == (0, True), done.stderr
    assert stranger.returncode == 2
    assert "distributed.comm.tls" in stranger.stderr
    assert len(stranger.stderr.splitlines()) == 1


class _Silent:
    """A client whose workers do not answer."""

    def __init__(self) -> None:
        self.scheduler = self

    def sync(self, ask: Callable[..., Any], **choices: Any) -> Any:
        return ask(**choices)

    def identity(self, *, n_workers: int) -> dict[str, Any]:
        return {"workers": {"tcp://silent:1": {}}}

    def run(self, *_: object, **__: object) -> dict[str, Any]:
        raise NoAnswer


def test_a_worker_that_does_not_answer_is_left_out(tmp_path: Path) -> None:
    needs = remote.Needs(
        run="x", bundles=(), file_bytes=1, token=tmp_path / "token", sources=(tmp_path,)
    )
    notices: list[str] = []
    workers = crew.Crew(needs, {}, notices.append)
    assert workers.look(_Silent())  # type: ignore[arg-type]
    assert not workers.look(_Silent()), "not twice within a second"  # type: ignore[arg-type]
    assert notices == ["worker tcp://silent:1 is left out: does not answer within 8 s"]
    assert workers.room() == 0


class _Slow(_Silent):
    """The client of a scheduler with so many workers that to list them takes time."""

    def identity(self, *, n_workers: int) -> dict[str, Any]:
        time.sleep(0.1)
        return {"workers": {}}

    def processing(self) -> dict[str, Any]:
        time.sleep(0.1)
        return {}


def test_looking_takes_a_small_share_of_the_time(tmp_path: Path) -> None:
    needs = remote.Needs(
        run="x", bundles=(), file_bytes=1, token=tmp_path / "token", sources=(tmp_path,)
    )
    workers, slow = crew.Crew(needs, {}, print), _Slow()
    assert workers.look(slow)  # type: ignore[arg-type]
    workers.tasks_by_worker(slow)  # type: ignore[arg-type]
    time.sleep(1.1)
    assert not workers.look(slow), "a second is not enough"  # type: ignore[arg-type]
    assert workers.look(slow, now=True)  # type: ignore[arg-type]


def test_who_takes_too_long_is_left_alone() -> None:
    import threading

    ended = threading.Event()
    with pytest.raises(NoAnswer):
        answer_within(0.05, lambda: ended.wait(10))
    ended.set()
    assert answer_within(5, lambda: "here") == "here"
    with pytest.raises(ZeroDivisionError):
        answer_within(5, lambda: 1 / 0)


@pytest.mark.slow
def test_one_silent_worker_does_not_keep_the_answers_of_others(
    farm: Farm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(crew, "SILENT_S", 1.0)  # asked again, not told again
    bundle = write_tiny_captures(tmp_path, [f"shot{n}" for n in range(3)])
    farm.add_worker("frozen")
    farm.add_worker("awake")
    farm.wait(len(UNFIT) + 2)
    notices: list[str] = []
    with farm.client() as client:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        (address,) = [a for a, worker in workers.items() if worker["name"] == "frozen"]
        pid = client.run(os.getpid, workers=[address])[address]
        os.kill(pid, signal.SIGSTOP)
        try:
            results = camkit.process(
                tmp_path,
                bundle=bundle,
                out_dir=tmp_path / "out",
                client=client,
                on_notice=notices.append,
            )
        finally:
            os.kill(pid, signal.SIGCONT)
    assert [r.status for r in results] == ["ok"] * 3
    assert sum("does not answer" in notice for notice in notices) == 1


def test_runs_do_not_share_the_flag_of_workers_that_fit(tmp_path: Path) -> None:
    """One of them may not see its captures where the other does."""
    flags = {
        remote.Needs(
            run=run, bundles=("x",), file_bytes=1, token=tmp_path / "token", sources=(tmp_path,)
        ).flag
        for run in ("one", "two")
    }
    assert len(flags) == 2


def test_a_bundle_that_did_not_arrive_whole_is_not_kept(tmp_path: Path) -> None:
    class Worker:
        local_directory = str(tmp_path)

    with pytest.raises(ValueError, match="did not arrive whole"):
        remote.take_bundle("0" * 64, b"half", Worker())  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


def test_without_dask_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UnsupportedError, match=r"pip install 'camkit\[batch\]'"):
        connection.open_client("tcp://127.0.0.1:1")
