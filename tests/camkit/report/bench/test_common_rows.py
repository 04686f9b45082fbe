"""Which trials a bundle gives to the row makers that serve every camera."""

from dataclasses import replace

import pytest

from camkit.bundle.facts import HaloError
from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.bench.common_rows import COMMON
from camkit.report.bench.line_up import make_trials
from camkit.report.bench.metric import registered_metrics
from camkit.report.bench.metrics import picture
from camkit.report.bench.trial import Axes, Entrant, Ground
from camkit.runtime.network import openvino_session
from tests.wide_bundle import write_wide_bundle

GROUND = Ground(threads=2, providers=("cpu",), free_bytes=10**10)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


def labels(bundle: Bundle, axes: Axes, ground: Ground = GROUND) -> tuple[list[str], list[str]]:
    trials, skips = make_trials([Entrant(label="tiny", bundle=bundle, camera="tiny")], axes, ground)
    return [trial.label for trial in trials], [f"{s.what}: {s.reason}" for s in skips]


def test_the_row_makers_and_metrics_that_serve_every_camera_are_there() -> None:
    assert [maker.name for maker in COMMON] == ["classical", "develop", "network", "physics"]
    assert [metric.name for metric in registered_metrics()] == ["hdr", "picture"]
    assert [column.name for column in picture.METRIC.columns] == ["psnr_db", "ssim"]


def test_the_default_varies_one_thing_at_a_time(bundle: Bundle) -> None:
    made, skips = labels(bundle, Axes())
    assert made == ["wiener", "rl", "admm-tv", "develop", "M", "M whole", "M 1 thread"]
    assert skips == ["tiny M fast: the bundle holds no measured halo"]


def test_fp16_providers_and_sizes_that_are_not_there_are_said_not_made(bundle: Bundle) -> None:
    axes = Axes(
        methods=("net",), sizes=("M", "L"), dtypes=("fp32", "fp16"), providers=("cpu", "cuda")
    )
    made, skips = labels(bundle, axes)
    assert made == ["M", "M whole", "M 1 thread"]
    assert "tiny L: the bundle holds M" in skips
    assert "tiny M fp16: the bundle holds no fp16 graph of this size" in skips
    assert "tiny M cuda: networks here are computed on cpu" in skips


def test_bfloat16_without_openvino_makes_no_row_and_says_what_is_missing(
    bundle: Bundle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(openvino_session, "has_openvino", lambda: False)
    axes = Axes(
        methods=("net",),
        modes=("exact",),
        dtypes=("fp32", "bf16"),
        providers=("cpu", "openvino"),
        vary=False,
    )
    made, skips = labels(bundle, axes, replace(GROUND, providers=("cpu", "openvino")))
    assert made == ["M", "M openvino"]
    assert skips == [
        "tiny M bf16: bf16 is computed by openvino alone",
        "tiny M bf16 openvino: bf16 needs the package openvino (pip install 'camkit[openvino]')",
    ]


def test_more_threads_than_there_are_make_no_row(bundle: Bundle) -> None:
    made, skips = labels(bundle, Axes(methods=("net", "rl"), modes=("exact",), threads=(4, 2)))
    assert made == ["rl", "M"]
    assert skips == ["tiny M 4 threads: this process may use 2 threads"]


def test_a_measured_halo_and_a_second_provider_make_their_rows(bundle: Bundle) -> None:
    facts = bundle.network_facts("restore", "M").model_copy(
        update={"halo_error": (HaloError(halo_px=2, max_abs=0.0, psnr_db=None),)}
    )
    manifest = bundle.manifest.model_copy(update={"networks": {"restore": {"M": facts}}})
    ground = replace(GROUND, providers=("cpu", "cuda"), threads=1)
    made, skips = labels(replace(bundle, manifest=manifest), Axes(methods=("net",)), ground)
    assert made == ["M", "M fast", "M whole", "M cuda"]
    assert not skips


def test_one_window_may_take_most_of_the_free_memory_and_only_that(bundle: Bundle) -> None:
    entrant = Entrant(label="tiny", bundle=bundle, camera="tiny")
    trials, _ = make_trials([entrant], Axes(modes=("exact", "whole"), methods=("net",)), GROUND)
    caps = {trial.mode: trial.max_mem_bytes for trial in trials}
    assert caps == {"exact": None, "whole": 7 * 10**9}


def test_a_reference_gives_its_networks_only(bundle: Bundle) -> None:
    entrant = Entrant(label="rival", bundle=bundle, camera="tiny")
    trials, skips = make_trials([entrant], Axes(sizes=("S",)), GROUND)
    assert [trial.label for trial in trials] == ["rival M"]
    assert not skips


def test_an_unknown_method_is_refused_with_the_known_ones(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match="wiener, rl, admm-tv, develop, net, physics; got"):
        labels(bundle, Axes(methods=("magic",)))
