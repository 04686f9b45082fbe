"""`camkit doctor`: what this machine has, for a bug report or a first look."""

import json
import os
import platform
import sys
from importlib import metadata, util
from typing import Annotated, Any

import typer

PACKAGES = (
    "numpy scipy onnxruntime onnx rawpy opencv-contrib-python-headless OpenEXR tifffile "
    "scikit-image safetensors pydantic typer rich torch onnxscript"
).split()


def doctor(
    json_: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Print versions, threads, providers and bundles, and try what `process` needs."""
    report = examine()
    if json_:
        typer.echo(json.dumps(report, indent=2))
        return
    for name, value in report.items():
        if isinstance(value, dict):
            typer.echo(f"{name}:")
            for key, item in value.items():
                typer.echo(f"  {key}: {item}")
        else:
            typer.echo(f"{name}: {value}")


def examine() -> dict[str, Any]:
    """Collect the facts that `doctor` prints."""
    from camkit import __version__
    from camkit.bundle.reader import built_in_bundles
    from camkit.runtime.engine import available_threads, providers

    return {
        "camkit": __version__,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "processor": _processor(),
        "threads": available_threads(None),
        "memory_mb": _memory_mb(),
        "providers": ", ".join(providers()),
        "onnxruntime_telemetry": (
            "off" if os.environ.get("ORT_DISABLE_TELEMETRY") == "1" else "not switched off"
        ),
        "design_time": (
            "ready" if util.find_spec("torch") else "not installed: pip install camkit[train]"
        ),
        "bundles": {name: str(path) for name, path in sorted(built_in_bundles().items())},
        "packages": {name: _version(name) for name in PACKAGES},
    }


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            names = [line.split(":", 1)[1].strip() for line in lines if "model name" in line]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()


def _memory_mb() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 10**6
