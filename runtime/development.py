"""One capture file developed: decode, reconstruct, write, and say what was done in a sidecar."""

import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal, Self

from camkit.caller import option_text
from camkit.errors import ContractError, one_line
from camkit.field_types import check_fields
from camkit.runtime.cancel import Cancel
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.machine.memory import peak_rss_mb
from camkit.runtime.network.tiling import Progress
from camkit.runtime.output.band_queue import BandQueue
from camkit.runtime.output.part_file import atomic_outputs
from camkit.runtime.output.picture_writer import DEFAULT_JPEG_QUALITY, PictureFormat
from camkit.runtime.output.preview_file import PREVIEW_BYTES, PREVIEW_SUFFIX, preview_path
from camkit.runtime.output.sidecar import read_sidecar, sidecar_path, sidecar_text
from camkit.runtime.output.writer import SUFFIXES, FileFormat, held_bytes, open_writer
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.raw import file_sha256

OTHER_NAMES: Final[dict[str, FileFormat]] = {"jpg": "jpeg", "tif": "tiff"}
LINEAR_FORMATS: Final = frozenset({"exr", "dng"})
Status = Literal["ok", "failed", "skipped"]


@dataclass(frozen=True, slots=True, kw_only=True)
class WriteOptions:
    """The place and the format of pictures.

    Attributes:
        out_dir: Folder of pictures and sidecars, made if needed.
        keep_folders: Below it, the folders of the captures from what they have in common on.
        format: exr, tiff (or tif), png, jpeg (or jpg) or dng; None for exr, and for no picture
            beside products.
        preview: A small tone-mapped JPEG beside the picture, see `tone_mapping`.
        linear: TIFF and PNG without the sRGB curve.
        jpeg_quality: Of JPEG, 1..100; None for 92.
        strip_metadata: Leave out what the capture says of camera, lens, date, exposure and place.
        resume: Skip what a sidecar proves done.
        overwrite: Replace pictures that exist.
        jobs: Captures at once; threads and memory are shared among them.
    """

    out_dir: Path = Path()
    keep_folders: bool = False
    format: FileFormat | None = None
    preview: bool = False
    linear: bool = False
    jpeg_quality: int | None = None
    strip_metadata: bool = False
    resume: bool = False
    overwrite: bool = False
    jobs: int = 1

    def __post_init__(self) -> None:
        named = OTHER_NAMES.get(str(self.format), self.format)
        object.__setattr__(self, "format", named)  # one name from here on
        check_fields(self)
        if self.linear and self.picture in LINEAR_FORMATS:
            raise ContractError(
                f"{self.picture} is always linear; leave {option_text('linear')} out"
            )
        if self.format == "jpeg" and self.linear:
            raise ContractError(
                f"8 bits hold no linear light; add {option_text('format')} png or tiff"
            )
        if self.jpeg_quality is not None and self.format != "jpeg":
            raise ContractError(f"a quality is for JPEG; leave it out for {self.picture}")
        if not 1 <= self.quality <= 100:
            raise ContractError(f"JPEG quality must be 1..100; got {self.jpeg_quality}")
        if self.jobs < 1:
            raise ContractError(f"jobs must be >= 1; got {self.jobs}")
        if self.resume and self.overwrite:
            raise ContractError("resume keeps what is done, overwrite redoes it: choose one")

    @property
    def picture(self) -> FileFormat:
        """Return the format of pictures."""
        return "exr" if self.format is None else self.format

    @property
    def quality(self) -> int:
        """Return the quality of a JPEG."""
        return DEFAULT_JPEG_QUALITY if self.jpeg_quality is None else self.jpeg_quality

    @property
    def suffix(self) -> str:
        """Return the suffix of the pictures, with its dot."""
        return "." + SUFFIXES[self.picture].lstrip(".")


@dataclass(frozen=True, slots=True, kw_only=True)
class FileResult:
    """The result of one input.

    Attributes:
        input: The capture.
        output: The picture, or the main file of products; None when it failed.
        status: ok, failed or skipped.
        error: Why it failed.
        bundle: Name of the bundle in use; None when only developed.
        size: Size of the network in use.
        seconds: Seconds per stage.
        peak_rss_mb: Peak memory of this process so far, its decoding child included.
        warnings: What the user should know.
        beside: Further files that were written, the sidecar left out.
    """

    input: Path
    output: Path | None
    status: Status
    error: str | None = None
    bundle: str | None = None
    size: str | None = None
    seconds: dict[str, float]
    peak_rss_mb: float
    warnings: tuple[str, ...] = ()
    beside: tuple[Path, ...] = ()

    @classmethod
    def failure(cls, source: Path, bundle: str | None, error: str) -> Self:
        """Return the result of an input that failed."""
        return cls(
            input=source,
            output=None,
            status="failed",
            error=one_line(error),
            bundle=bundle,
            seconds={},
            peak_rss_mb=peak_rss_mb(),
        )

    @classmethod
    def skip(cls, source: Path, target: Path, pipeline: Pipeline, *warnings: str) -> Self:
        """Return the result of an input that was done before, or is done by another process."""
        return cls(
            input=source,
            output=target,
            status="skipped",
            bundle=bundle_name(pipeline),
            size=pipeline.size,
            seconds={},
            peak_rss_mb=peak_rss_mb(),
            warnings=warnings,
        )

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain JSON values."""
        return {
            **asdict(self),
            "input": str(self.input),
            "output": None if self.output is None else str(self.output),
            "seconds": {name: round(value, 4) for name, value in self.seconds.items()},
            "peak_rss_mb": round(self.peak_rss_mb, 1),
            "warnings": list(self.warnings),
            "beside": [str(path) for path in self.beside],
        }


def begin(
    pipeline: Pipeline,
    capture: Capture,
    write: WriteOptions,
    *,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Reconstruction:
    """Plan a picture, the memory that its file takes while it is written counted.

    Raises:
        ContractError: If capture and bundle do not fit each other, or the cap does not do.
    """
    pixels, turned = capture.height * capture.width, capture.orientation
    reserved_bytes = held_bytes(write.picture, pixels=pixels, orientation=turned)
    reserved_bytes += PREVIEW_BYTES * write.preview
    return pipeline.start(capture, progress=progress, cancel=cancel, reserved_bytes=reserved_bytes)


def develop_file(
    source: Path,
    target: Path,
    pipeline: Pipeline,
    write: WriteOptions,
    *,
    mosaic: MosaicOptions | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> FileResult:
    """Process one capture to a picture and a sidecar; either both appear or neither changes.

    Raises:
        DecodeError: If the capture cannot be read.
        ContractError: If capture and bundle do not fit each other.
        Cancelled: If `cancel` said so.
    """
    began = time.perf_counter()
    capture = pipeline.read(source, mosaic, cancel=cancel)
    decode_s = time.perf_counter() - began
    # What both held while the child decoded; later this process grows, but the child is gone.
    decoded_mb = peak_rss_mb() + capture.decoder_peak_mb
    work = begin(pipeline, capture, write, progress=progress, cancel=cancel)
    # who asks for a time has had the machine timed; nobody else waits for it
    estimate = None if pipeline.options.max_seconds is None else work.explain()
    beside = (preview_path(target),) if write.preview else ()
    with atomic_outputs(sidecar_path(target), target, *beside) as (proof, part, *parts):
        write_s = _write_picture(part, work, write, *parts)
        output_sha256 = file_sha256(part)
        seconds = {"decode": decode_s, **work.seconds, "write": write_s}
        result = FileResult(
            input=source,
            output=target,
            status="ok",
            bundle=bundle_name(pipeline),
            size=work.size,
            seconds=seconds,
            peak_rss_mb=max(peak_rss_mb(), decoded_mb),
            warnings=work.warnings,
            beside=beside,
        )
        if estimate is not None:
            total_s = sum(seconds.values())
            work.record["estimate"] = estimate.compare(total_s, result.peak_rss_mb)
        record = {
            **result.to_json(),
            **identity_of(source, capture.sha256, pipeline, write, mosaic),
            "output_sha256": output_sha256,
            "beside_sha256": dict(zip([PREVIEW_SUFFIX], map(file_sha256, parts), strict=False)),
            "plan": work.record,
            "clipped_fraction": work.clipped_fraction,
            "orientation": capture.orientation,
            "camera": capture.camera,
            "iso": capture.iso,
            "exposure_time_s": capture.exposure_time_s,
            "metadata": {} if write.strip_metadata else work.origin.metadata.stated(),
        }
        proof.write_text(sidecar_text(record, work.sections), encoding="utf-8")
    return result


def proved_done(
    source: Path,
    target: Path,
    pipeline: Pipeline,
    write: WriteOptions,
    mosaic: MosaicOptions | None,
) -> bool:
    """Return whether a sidecar proves that exactly this work was done and its picture is whole."""
    if not (source.is_file() and target.is_file() and sidecar_path(target).is_file()):
        return False
    record = read_sidecar(target)
    wanted = identity_of(source, file_sha256(source), pipeline, write, mosaic)
    if record is None or any(record.get(key) != value for key, value in wanted.items()):
        return False
    if record.get("output_sha256") != file_sha256(target):
        return False
    return _are_whole(target, record.get("beside_sha256", {}))


def _are_whole(target: Path, hashes: Any) -> bool:
    """Return whether the files beside a main one are those of its sidecar."""
    if not isinstance(hashes, dict):
        return False
    beside = {target.with_suffix(str(suffix)): sha256 for suffix, sha256 in hashes.items()}
    return all(path.is_file() and file_sha256(path) == sha for path, sha in beside.items())


def identity_of(
    source: Path,
    input_sha256: str | None,
    pipeline: Pipeline,
    write: WriteOptions,
    mosaic: MosaicOptions | None,
) -> dict[str, Any]:
    """Return the values that decide the bytes of a picture or of products, as JSON values."""
    from camkit import __version__

    free = ("threads", "max_mem_bytes", "tile_px")
    chosen = {k: v for k, v in asdict(pipeline.options).items() if k not in free}
    if chosen["depth_m"] == math.inf:
        chosen["depth_m"] = "inf"  # JSON knows no infinity
    chosen["unit"] = None if pipeline.options.unit is None else asdict(pipeline.options.unit)
    chosen["format"] = write.picture if pipeline.maker is None else write.format
    chosen["linear"] = write.linear
    chosen |= {"jpeg_quality": write.quality if write.format == "jpeg" else None}
    chosen |= {"strip_metadata": write.strip_metadata}
    chosen |= {"preview": True} if write.preview else {}
    chosen["mosaic"] = None if mosaic is None else asdict(mosaic)
    chosen["of_kind"] = dict(pipeline.options.of_kind)
    if pipeline.maker is not None:
        chosen["of_kind"] |= pipeline.maker.identity(pipeline.options, source)
    identity = {
        "camkit": __version__,
        "input_sha256": input_sha256,
        "bundle_sha256": None if pipeline.bundle is None else pipeline.bundle.sha256,
        "options": chosen,
    }
    return dict(json.loads(json.dumps(identity)))


def _write_picture(
    path: Path, work: Reconstruction, write: WriteOptions, preview_file: Path | None = None
) -> float:
    """Stream the bands into the files; return the seconds for which the writer was waited for."""
    _, height, width = work.shape
    picture = PictureFormat(
        width=width,
        height=height,
        color=work.color,
        orientation=1 if write.format == "dng" else work.capture.orientation,
        tone="linear" if write.linear else "srgb",
        jpeg_quality=write.quality,
        origin=work.origin.stripped() if write.strip_metadata else work.origin,
    )
    seconds, preview = 0.0, None
    if preview_file is not None:
        from camkit.runtime.output.tone_mapping import ToneMappedPreview

        preview = ToneMappedPreview(height, width)
    with open_writer(path, write.picture, picture) as writer, BandQueue(writer) as queue:
        for band in work.bands():
            began = time.perf_counter()
            if preview is not None:
                preview.add(band)
            queue.write(band)
            seconds += time.perf_counter() - began
        began = time.perf_counter()
    if preview is not None and preview_file is not None:
        preview.write(preview_file, work.color, work.capture.orientation)
    return seconds + time.perf_counter() - began


def bundle_name(pipeline: Pipeline) -> str | None:
    """Return the name of the bundle in use; None without one."""
    return None if pipeline.bundle is None else pipeline.bundle.manifest.name
