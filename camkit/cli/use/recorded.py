"""`camkit simulate` for cameras whose captures are no photographs."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.cli.say import say
from camkit.errors import ContractError

if TYPE_CHECKING:
    from camkit.bundle.reader import Bundle
    from camkit.contracts import FloatArray
    from camkit.runtime.kind_parts.recording import Recording, RecordingOptions

DEFAULT_PHOTONS: Final = 1e4


def simulate_recorded(
    scene: str,
    bundle: "Bundle",
    out: Path,
    options: "RecordingOptions",
    flags: Mapping[str, Any],
    *,
    overwrite: bool,
    json_: bool,
) -> None:
    """Record a scene and write the capture.

    Args:
        scene: A picture, the name of a scene of a seed, or the file of a scene of this kind.
        bundle: The camera, whose kind has a recording.
        out: The capture to write.
        options: How much light there is.
        flags: Flag -> value of the options of photographs alone; those that are not None or False
            were given.
        overwrite: Whether files that exist are replaced.
        json_: Whether to print JSON.

    Raises:
        ContractError: If an option means nothing here, or the name is of no such file.
    """
    recording = _recording(bundle)
    if set_flags := [flag for flag, value in flags.items() if value not in (None, False)]:
        raise ContractError(
            f"{', '.join(set_flags)} does not apply to bundle {bundle.manifest.name}, which counts "
            "photons: use --photons, --sbr and --seed"
        )
    if out.suffix.lower() not in recording.suffixes:
        raise ContractError(
            f"a simulated capture of this camera is a file in {', '.join(recording.suffixes)}; "
            f"got {out}"
        )
    files = recording.files(out)
    if not overwrite and (there := [str(file) for file in files if file.exists()]):
        raise ContractError(f"{', '.join(there)} exists; add --overwrite or choose another name")
    recorded = recording.record(_scene(scene), bundle, options)
    out.parent.mkdir(parents=True, exist_ok=True)
    recording.write(out, recorded)
    shape = list(recorded.values.shape)
    counts = int(recorded.values.sum(dtype="int64"))
    if json_:
        facts = {"path": str(out), "files": [str(file) for file in files], "array": recorded.name}
        said_too = {"photons": options.photons, "seed": options.seed, "counts": counts}
        say(json.dumps(facts | {"shape": shape} | said_too, allow_nan=False))
    else:
        more_files = "".join(f", {file}" for file in files[1:])
        say(f"{out}{more_files}: {recorded.name} {'x'.join(map(str, shape))}, {counts} counts")


def light_of(
    photons: float | None, sbr: float | None, seed: int, bundle: "Bundle"
) -> "RecordingOptions | None":
    """Return the amount of light, for cameras whose captures are no photographs; else None.

    Raises:
        ContractError: If photons are stated of a camera that counts none.
    """
    from camkit.runtime.kind import part_of
    from camkit.runtime.kind_parts.recording import RecordingOptions

    if part_of(bundle.manifest).recording is None:
        _check_light_alone(photons, sbr, bundle)
        return None
    return RecordingOptions(
        photons=DEFAULT_PHOTONS if photons is None else photons,
        sbr=math.inf if sbr is None else sbr,
        seed=seed,
    )


def _check_light_alone(photons: float | None, sbr: float | None, bundle: "Bundle") -> None:
    """Refuse options of cameras that count photons, for one that does not.

    Raises:
        ContractError: Names them.
    """
    options = (("--photons", photons), ("--sbr", sbr))
    if set_flags := [flag for flag, value in options if value is not None]:
        raise ContractError(
            f"{', '.join(set_flags)} does not apply to bundle {bundle.manifest.name}: its camera "
            "counts no photons; use --exposure and --iso"
        )


def _recording(bundle: "Bundle") -> "Recording":
    from camkit.runtime.kind import part_of

    recording = part_of(bundle.manifest).recording
    assert recording is not None
    return recording


def _scene(scene: str) -> "FloatArray | Path":
    from camkit.runtime.files.picture import read_light
    from camkit.scenes import is_scene_name, named_scene

    if is_scene_name(scene):
        return named_scene(scene, SEED_SCENE_PX[1], SEED_SCENE_PX[0])
    path = Path(scene)
    return path if path.suffix.lower() == ".npz" else read_light(path)


SEED_SCENE_PX: Final = (1024, 512)
"""Scenes of a seed are drawn in this size and fitted to the array."""
