"""All rows of a bundle of single photons: pictures, times of flight, seconds."""

from collections.abc import Sequence
from typing import Final

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.bench.part import OwnRows, OwnSettings, Tell
from camkit.report.bench.trial import Skip
from camkit.report.kinds.spad.pictures import LEVELS, QUICK_LEVELS, picture_rows
from camkit.report.kinds.spad.scenes import drawn_pictures, read_pictures
from camkit.report.kinds.spad.seconds import seconds_rows
from camkit.report.kinds.spad.timing import timing_rows
from camkit.report.kinds.spad.ways import Baselines, read_baselines, ways_of
from camkit.runtime.kinds.spad.finer.camera import FineCamera

QUICK_IMAGES: Final = 2


def measure(bundle: Bundle, settings: OwnSettings, tell: Tell) -> OwnRows:
    """Measure a bundle.

    Raises:
        ContractError: If there are no pictures in the folder, none of the sizes asked for, or the
            bundle is one of baselines.
        DecodeError: If a picture is damaged.
        BundleError: If the bundle makes no picture of photons finer.
    """
    name = bundle.manifest.name
    camera = FineCamera.of(bundle)
    if camera.stage.sampling != "plate":
        raise ContractError(
            f"bundle {name} sees through no plate: its networks stand beside those of a camera "
            "that does; bench that one"
        )
    sizes, skips = _sizes(camera, settings.sizes)
    images = settings.images
    if images is None and settings.quick:
        images = QUICK_IMAGES
    pictures = (
        drawn_pictures(camera, images)
        if settings.data is None
        else read_pictures(settings.data, images, camera.scale)
    )
    baselines = _baselines(camera, quick=settings.quick)
    skips += baselines.skips
    ways = ways_of(bundle, sizes, baselines.cameras)
    levels = QUICK_LEVELS if settings.quick else LEVELS

    def report(text: str) -> None:
        tell(f"{name}: {text}")

    rows = list(picture_rows(pictures, ways, camera.grid, levels, report))
    if camera.sensor.time_bins:
        rows += timing_rows(settings.repeat, report, quick=settings.quick)
    else:
        skips.append(Skip(what="times of flight", reason="the array has no time bins"))
    for row in seconds_rows(bundle, sizes, settings.repeat, report):
        if isinstance(row, Skip):
            skips.append(row)
        else:
            rows.append(row)
    other_bundles = {id(other.bundle): other.bundle for other in baselines.cameras.values()}
    return OwnRows(rows=rows, skips=skips, other_bundles=tuple(other_bundles.values()))


def _sizes(
    camera: FineCamera, requested: Sequence[str] | None
) -> tuple[tuple[str, ...], list[Skip]]:
    """Return the sizes to measure, and those that are not there.

    Raises:
        ContractError: If none of those asked for is there.
    """
    bundle_sizes, name = tuple(camera.sizes), camera.bundle.manifest.name
    candidates = bundle_sizes if requested is None else tuple(requested)
    have = ", ".join(bundle_sizes) or "none"
    sizes = tuple(size for size in bundle_sizes if size in candidates)
    if requested is not None and not sizes:
        raise ContractError(f"bundle {name} holds size(s) {have}; got {', '.join(requested)}")
    missing = [size for size in candidates if size not in bundle_sizes]
    return sizes, [Skip(what=f"{name} {m}", reason=f"the bundle holds {have}") for m in missing]


def _baselines(camera: FineCamera, *, quick: bool) -> Baselines:
    if quick:
        left_out = Skip(what="networks of the baselines", reason="left out by --quick")
        return Baselines(skips=(left_out,))
    return read_baselines(camera)
