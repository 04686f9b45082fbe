"""A batch on a cluster gives what one process gives: bits, sidecars, results, exit codes."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import Client

import camkit
from camkit.errors import BundleError, ContractError
from camkit.runtime.batch.cluster import crew
from camkit.runtime.batch.cluster import run as run_module
from camkit.runtime.batch.cluster.connection import NoAnswer
from camkit.runtime.output.claim import claimed
from camkit.runtime.output.sidecar import sidecar_path
from tests.capture_factory import write_tiny_captures
from tests.runtime.batch.cluster.farm import Farm

NAMES = ["a", "b", "c", "d"]


@pytest.fixture(scope="module")
def farm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Farm]:
    with Farm(tmp_path_factory.mktemp("farm")) as farm:
        farm.add_worker("one")
        farm.add_worker("two", threads=2)
        farm.wait(2)
        yield farm


@pytest.fixture(scope="module")
def client(farm: Farm) -> Iterator[Client]:
    with farm.client() as client:
        yield client


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("captures")
    write_tiny_captures(folder, NAMES)
    return folder


def _bytes(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.exr"))}


def _record(picture: Path) -> dict[str, Any]:
    record = json.loads(sidecar_path(picture).read_text())
    for name in ("seconds", "peak_rss_mb", "input", "output"):
        record.pop(name)
    return dict(record)


def test_a_cluster_gives_the_bits_and_sidecars_of_one_process(
    captures: Path, client: Client, tmp_path: Path
) -> None:
    ticks: list[tuple[str, int, int]] = []
    one = camkit.process(captures, bundle=captures / "tiny.camkit", out_dir=tmp_path / "one")
    many = camkit.process(
        captures,
        bundle=captures / "tiny.camkit",
        out_dir=tmp_path / "many",
        client=client,
        progress=lambda path, done, total: ticks.append((path.name, done, total)),
    )
    assert [r.status for r in many] == ["ok"] * len(NAMES)
    assert [r.input for r in many] == [r.input for r in one]
    assert [r.output for r in many] == [tmp_path / "many" / f"{n}.exr" for n in NAMES]
    assert [(r.bundle, r.size) for r in many] == [(r.bundle, r.size) for r in one]
    assert _bytes(tmp_path / "one") == _bytes(tmp_path / "many")
    for name in NAMES:
        pair = [_record(tmp_path / folder / f"{name}.exr") for folder in ("one", "many")]
        assert pair[0] == pair[1]
    assert sorted(p.name for p in (tmp_path / "many").iterdir()) == sorted(
        p.name for p in (tmp_path / "one").iterdir()
    ), "nothing else is left"
    assert {name for name, _, _ in ticks} <= {f"{n}.dng" for n in NAMES}
    assert ticks
    assert all(0 < done <= total for _, done, total in ticks)


def test_relative_names_are_told_as_they_were_given(
    captures: Path, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(captures)
    (result,) = camkit.process(
        "a.dng", bundle="tiny.camkit", out_dir="relative", client=client, overwrite=True
    )
    assert (str(result.input), str(result.output)) == ("a.dng", "relative/a.exr")
    assert (captures / "relative" / "a.exr").is_file()


def test_files_that_name_a_bundle_that_is_not_here_fail_one_by_one(
    captures: Path, client: Client, tmp_path: Path
) -> None:
    results = camkit.process(captures, out_dir=tmp_path, client=client)
    assert [r.status for r in results] == ["failed"] * len(NAMES)
    assert all("tiny" in (r.error or "") for r in results)


def test_developing_needs_no_bundle(captures: Path, client: Client, tmp_path: Path) -> None:
    results = camkit.process(captures / "a.dng", bundle="none", out_dir=tmp_path, client=client)
    assert [(r.status, r.bundle) for r in results] == [("ok", None)]


def test_what_cannot_be_is_refused_before_any_work(
    captures: Path, client: Client, tmp_path: Path
) -> None:
    bundle = captures / "tiny.camkit"
    with pytest.raises(ContractError, match="jobs are those of one process"):
        camkit.process(captures, bundle=bundle, out_dir=tmp_path, client=client, jobs=2)
    with pytest.raises(BundleError):
        camkit.process(captures, bundle="nowhere", out_dir=tmp_path, client=client)
    notices: list[str] = []
    with pytest.raises(ContractError, match=r"no worker of .* can make these files"):
        camkit.process(
            captures,
            bundle=bundle,
            out_dir=tmp_path,
            client=client,
            max_mem_bytes=2_500_000_000,
            on_notice=notices.append,
        )
    assert len(notices) == 2
    assert all("MB for files, one may take 2500 MB" in notice for notice in notices)
    assert not list(tmp_path.iterdir())


def test_what_somebody_else_is_making_is_waited_for(
    captures: Path, client: Client, tmp_path: Path
) -> None:
    """He may be a worker that was lost and has not noticed; what he leaves is made."""
    seen: list[str] = []
    with claimed(tmp_path / "a.exr") as ours:
        assert ours
        hold = claimed(tmp_path / "b.exr")
        hold.__enter__()

        def on_result(result: camkit.FileResult) -> None:
            seen.append(result.input.stem)
            if len(seen) == 2:
                hold.__exit__(None, None, None)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(run_module, "CLAIMED_S", 6.0)
            results = camkit.process(
                captures,
                bundle=captures / "tiny.camkit",
                out_dir=tmp_path,
                client=client,
                on_result=on_result,
            )
    assert {r.input.stem: r.status for r in results} == {
        **dict.fromkeys(NAMES, "ok"),
        "a": "skipped",
    }
    assert results[0].warnings == ("another process makes this picture",)
    assert (results[0].bundle, results[0].size) == (results[1].bundle, results[1].size)
    assert set(seen[:2]) == {"c", "d"}


def test_a_claim_that_a_lost_worker_may_hold_is_no_success(
    captures: Path, client: Client, tmp_path: Path
) -> None:
    with claimed(tmp_path / "a.exr"), pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_module, "CLAIMED_S", 0.0)
        patch.setattr(run_module, "LEASE_S", 3.0)
        has_losses = property(lambda _: True, lambda *_: None)
        patch.setattr(crew.Crew, "has_losses", has_losses, raising=False)
        results = camkit.process(
            captures, bundle=captures / "tiny.camkit", out_dir=tmp_path, client=client
        )
    assert [r.status for r in results] == ["failed", "ok", "ok", "ok"]
    assert "claimed by another process, or by a worker that was lost" in (results[0].error or "")


def test_a_scheduler_that_answers_late_keeps_what_is_under_way(
    captures: Path, client: Client, tmp_path: Path
) -> None:
    notices: list[str] = []
    sent: list[int] = []
    looks: list[bool] = []
    look, send = crew.Crew.look, run_module._Run._send

    def late(self: crew.Crew, client: Client, *, now: bool = False) -> bool:
        looks.append(now)
        if 1 < len(looks) < 5:
            raise NoAnswer
        return look(self, client, now=now)

    def counted(self: run_module._Run, number: int) -> None:
        sent.append(number)
        send(self, number)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(crew.Crew, "look", late)
        patch.setattr(run_module._Run, "_send", counted)
        results = camkit.process(
            captures,
            bundle=captures / "tiny.camkit",
            out_dir=tmp_path,
            client=client,
            on_notice=notices.append,
        )
    assert [r.status for r in results] == ["ok"] * len(NAMES)
    assert sorted(sent) == list(range(len(NAMES))), "nothing is handed out twice"
    assert [notice.split(" at ")[0] for notice in notices] == ["the scheduler"]
    assert "does not answer; waiting for it" in notices[0]


def test_the_wish_to_stop_leaves_nothing_half_done(
    captures: Path, client: Client, tmp_path: Path
) -> None:
    done: list[camkit.FileResult] = []
    with pytest.raises(camkit.Cancelled):
        camkit.process(
            captures,
            bundle=captures / "tiny.camkit",
            out_dir=tmp_path,
            client=client,
            on_result=done.append,
            cancel=lambda: bool(done),
        )
    # a worker that was in the middle of a file hears of it a moment later
    late = time.monotonic() + 10
    while list(tmp_path.glob("*.claim")) and time.monotonic() < late:
        time.sleep(0.05)
    names = sorted(p.name for p in tmp_path.iterdir())
    whole = [name.removesuffix(".exr") for name in names if name.endswith(".exr")]
    assert names == sorted(f"{n}{suffix}" for n in whole for suffix in (".exr", ".camkit.json"))
    assert {result.input.stem for result in done} <= set(whole)
    results = camkit.process(
        captures, bundle=captures / "tiny.camkit", out_dir=tmp_path, client=client, resume=True
    )
    assert {r.status for r in results} <= {"ok", "skipped"}


def test_the_bundle_travels_once_per_worker(captures: Path, client: Client, tmp_path: Path) -> None:
    def kept() -> dict[str, list[tuple[str, int]]]:
        def look(dask_worker: Any) -> list[tuple[str, int]]:
            folder = Path(dask_worker.local_directory) / "camkit-bundles"
            return sorted((p.name, p.stat().st_ino) for p in folder.iterdir())

        return dict(client.run(look))

    for run in ("first", "second"):
        camkit.process(
            captures / "a.dng",
            bundle=captures / "tiny.camkit",
            out_dir=tmp_path / run,
            client=client,
        )
        if run == "first":
            before = kept()
    assert kept() == before
    assert all(len(files) == 1 for files in before.values())
