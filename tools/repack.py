"""Write bundles anew in the newest format: `python -m tools.repack OLD.camkit -o NEW.camkit`.

The manifest is brought up to date, golden pictures are packed as they are today, every other member
keeps its bytes. With `--clip-reach-px N` the Wiener bank explains clipped lights in their
surroundings alone: then golden outputs and activations are made anew, and the version is raised.
With `--floor SHARE` pictures of photons have no black where light was counted; with
`--light-spread SHARE` the light that networks behind a bank move is bounded by so much of the
contrast between cells, and none darkens what is nearly white; with `--limited` undistortion leaves
no rings around lamps; with `--streaks-from-samples` streaks are taken from the mosaic, and no
network darkens a lamp; with `--portable` clipped lights are explained in whole blocks and places of
undistortion are in fixed point, as readers in other languages do; with `--psf FILE` the same lens
has a PSF of other depths (`camkit freeze --depths-mm`). The laws of its pictures are measured and
stated. The result proves itself before it gets its name.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.golden import golden_from_bytes, golden_to_bytes
from camkit.bundle.light_bound import LightBound
from camkit.bundle.manifest import LIGHT_VERSION, Manifest, format_of
from camkit.bundle.optics import PSF
from camkit.bundle.psf_file import psf_to_bytes, read_psf
from camkit.bundle.reader import CARD, GOLDEN, open_bundle
from camkit.bundle.stages import (
    Demosaic,
    Highlights,
    Network,
    SuperResolve,
    Undistort,
    Wiener,
)
from camkit.bundle.stages import StageEntry as Stage
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.export.card import with_laws_text
from camkit.export.golden_cases import add_outputs
from camkit.export.proving import with_activations, write_proved
from camkit.psf import FrozenPsf
from camkit.runtime.plan.bounded_networks import ENFORCE, bounded_stages
from camkit.runtime.proof.laws.proof import measure_laws, with_laws

Change = tuple[type[Stage], dict[str, Any]]
PORTABLE: Final = ((Wiener, {"whole_blocks": True}), (Undistort, {"places": "fixed"}))
"""The rules that readers in other languages follow too."""


def repack(
    old: Path,
    new: Path,
    *,
    changes: Sequence[Change] = (),
    light_spread: float | None = None,
    from_samples: bool = False,
    psf: Path | None = None,
) -> int:
    """Write one bundle anew; give its bytes.

    Args:
        old: The bundle.
        new: The file to write.
        changes: Numbers of stages, of each by its type.
        light_spread: Of the bound on networks behind a bank; None leaves it as it is.
        from_samples: Whether streaks of lights are taken from the samples of the mosaic.
        psf: PSF that the same lens was frozen into anew; None leaves the old one.

    Raises:
        BundleError: If the old one is damaged.
        ContractError: If the PSF is of another lens.
        ParityError: If the new one fails its check; nothing is written then.
    """
    bundle = open_bundle(old)
    members = {name: bundle.member(name) for name in bundle.names}
    if GOLDEN in members:
        members[GOLDEN] = golden_to_bytes(golden_from_bytes(members[GOLDEN]))
    newest = max(bundle.manifest.version_pair, LIGHT_VERSION)
    manifest = bundle.manifest.model_copy(update={"format_version": ".".join(map(str, newest))})
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / "trial.camkit"
        changes = list(changes)
        if light_spread is not None:  # with the mask that a bound needs
            manifest = manifest.model_copy(update={"stages": bounded_stages(manifest, ENFORCE)})
            changes.append((Network, {"light": LightBound(spread=light_spread, keeps_bright=True)}))
        if from_samples:
            changes += _lights_from_samples(manifest)
        if psf is not None:
            members[PSF] = psf_to_bytes(_psf_of_same_lens(psf, bundle.psf))
        if changes or psf is not None:
            if GOLDEN not in members:
                raise ContractError(f"{old} has no golden cases, which a change is proved by")
            manifest = _changed(manifest, changes)
            version = format_of(None, [manifest], least=newest)
            manifest = manifest.model_copy(update={"format_version": version})
            changed = write_bundle(trial, manifest, members)
            golden = golden_from_bytes(members[GOLDEN])
            cases = {case.name: (case, golden[case.name]) for case in manifest.golden}
            members[GOLDEN] = golden_to_bytes(add_outputs(changed, cases))
            manifest = manifest.model_copy(update={"networks": with_activations(changed, cases)})
        laws = measure_laws(write_bundle(trial, manifest, members))
        manifest = with_laws(manifest, laws)
        if CARD in members and manifest.laws is not None:
            members[CARD] = with_laws_text(members[CARD].decode(), manifest, laws).encode()
    write_proved(new, manifest, members)
    return new.stat().st_size


def _simple_changes(arguments: argparse.Namespace) -> list[Change]:
    """Return the changes that set one number of one stage."""
    changes: list[Change] = []
    if arguments.clip_reach_px is not None:
        changes.append((Wiener, {"clip_reach_px": arguments.clip_reach_px}))
    if arguments.floor is not None:
        changes.append((SuperResolve, {"floor": arguments.floor}))
    if arguments.limited:
        changes.append((Undistort, {"overshoot": "limited"}))
    if arguments.portable:
        changes += PORTABLE
    return changes


def _lights_from_samples(manifest: Manifest) -> list[Change]:
    """Return the changes by which lights are given the mosaic of their colours, and stay white.

    Raises:
        ContractError: If the bundle seeks no lights in a mosaic.
    """
    lights, colours = manifest.stage(Highlights), manifest.stage(Demosaic)
    if lights is None or colours is None or lights.takes[0] not in colours.gives:
        raise ContractError(f"{manifest.name} seeks no lights in the colours of a mosaic")
    # what lights are put into and what they are held against are made alike
    return [
        (Demosaic, {"method": lights.method}),
        (Highlights, {"takes": (lights.takes[0], colours.takes[0])}),
        (Network, {"keeps_white": True}),
    ]


def _psf_of_same_lens(path: Path, old: FrozenPsf) -> FrozenPsf:
    """Return the PSF of a file.

    Raises:
        ContractError: If its distortion, which no two lenses share, is not that of the old one.
    """
    new = read_psf(path)
    bent, old_coefficients = new.distortion.coefficients, old.distortion.coefficients
    if bent.shape != old_coefficients.shape or not np.allclose(bent, old_coefficients, rtol=1e-9):
        raise ContractError(f"{path} was frozen from another lens than the bundle's: train anew")
    return new


def _changed(manifest: Manifest, changes: Sequence[Change]) -> Manifest:
    """Return the manifest with changed stages, as the next minor version of the bundle.

    Raises:
        ContractError: If it has none of the stages that change.
    """
    if changes and not any(manifest.stage(kind) for kind, _ in changes):
        names = ", ".join(sorted({kind.__name__.lower() for kind, _ in changes}))
        raise ContractError(f"{manifest.name} has no stage to change: {names}")
    stages = tuple(
        stage.model_copy(
            update={k: v for kind, c in changes if isinstance(stage, kind) for k, v in c.items()}
        )
        for stage in manifest.stages
    )
    major, minor, *_ = manifest.version.split(".")
    return manifest.model_copy(update={"stages": stages, "version": f"{major}.{int(minor) + 1}.0"})


def main() -> None:
    """Write anew what the command line names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("old", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--clip-reach-px", type=int)
    parser.add_argument("--floor", type=float)
    parser.add_argument("--light-spread", type=float)
    parser.add_argument("--limited", action="store_true")
    parser.add_argument("--streaks-from-samples", action="store_true")
    parser.add_argument("--portable", action="store_true")
    parser.add_argument("--psf", type=Path)
    arguments = parser.parse_args()
    before = arguments.old.stat().st_size
    after = repack(
        arguments.old,
        arguments.out,
        changes=_simple_changes(arguments),
        light_spread=arguments.light_spread,
        from_samples=arguments.streaks_from_samples,
        psf=arguments.psf,
    )
    print(f"{arguments.out}: {after} bytes, before {before}")


if __name__ == "__main__":
    main()
