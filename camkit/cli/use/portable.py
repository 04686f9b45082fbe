"""`camkit portable`: a camera as ONNX graphs for programs without camkit."""

import json
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, DepthM, Json
from camkit.cli.say import say


def portable(
    bundle: Annotated[str, typer.Argument(help="Bundle (NAME or PATH).", metavar="BUNDLE")],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder to write, new or empty, or a new .zip.")
    ],
    size: Annotated[
        list[str] | None,
        typer.Option(help="Size of the network, repeatable; default: all of the bundle."),
    ] = None,
    depth_m: DepthM = None,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write a camera as ONNX graphs that other programs run without camkit."""
    from camkit.runtime.face.portable_writing import portable as write

    files = write(bundle, out, sizes=size, depth_m=depth_m)
    if json_:
        say(json.dumps({"folder": str(out), "bytes": dict(files)}))
        return
    for name, count in files.items():
        say(f"{count:9d}  {out / name}")
    say(f"{sum(files.values()) / 1e6:.1f} MB")
