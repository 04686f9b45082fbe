"""Trials, runs, scores and facts of a bench, made by hand."""

from pathlib import Path
from typing import Any

from camkit.report.bench.accuracy import INPUT, Scores
from camkit.report.bench.metrics.picture import METRIC
from camkit.report.bench.row import Facts
from camkit.report.bench.timed.process_run import Run
from camkit.report.bench.trial import Trial


def make_trial(**changes: Any) -> Trial:
    fields: dict[str, Any] = {
        "camera": "duet",
        "bundle": "duet",
        "path": Path("duet.camkit"),
        "maker": "network",
        "method": "net",
        "size": "M",
        "mode": "exact",
        "dtype": "fp32",
        "provider": "cpu",
        "threads": 2,
        "base_threads": 2,
    }
    return Trial(**(fields | changes))


def make_scores(values: dict[str, float], psf: str = "fresh") -> Scores:
    by_picture = {name: {"psnr_db": [v, v], "ssim": [0.5, 0.7]} for name, v in values.items()}
    return Scores(by_picture=by_picture, psf={psf})


def make_run(seconds: float) -> Run:
    return Run(
        seconds=seconds,
        cpu_s=2 * seconds,
        stages={"network": seconds / 2, "write": 1.0},
        steady_s=(seconds - 1,),
        steady_cpu_s=(seconds,),
        peak_rss_mb=100 * seconds,
        load_of_others=0.0,
    )


def make_facts(**changes: Any) -> Facts:
    fields: dict[str, Any] = {
        "size_px": (4000, 3000),
        "mac_per_px": 10_000.0,
        "gemm_gmac_per_s": 100.0,
        "scores": {
            INPUT: make_scores({"a": 20.0, "b": 22.0}),
            make_trial().accuracy_key: make_scores({"a": 25.0, "b": 29.0}),
        },
        "metrics": (METRIC,),
        "base": [make_run(4.0), make_run(6.0)],
        "base_label": "M",
        "base_key": make_trial().accuracy_key,
    }
    return Facts(**(fields | changes))
