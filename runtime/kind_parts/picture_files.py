"""A photograph as files: a picture, and a preview beside it, written band by band as it is made."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE
from camkit.runtime.capture import Capture
from camkit.runtime.capture_result import Result
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.kind_parts.outputs import FileSet, Outputs
from camkit.runtime.options import Options
from camkit.runtime.output.band_queue import BandQueue
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.preview_file import PREVIEW_BYTES, PREVIEW_SUFFIX, preview_path
from camkit.runtime.output.writer import held_bytes, open_writer
from camkit.runtime.write_options import WriteOptions


def _names(source: Path, _options: Options, write: WriteOptions) -> tuple[str, ...]:
    name = f"{source.stem}{write.suffix}"
    return (name, preview_path(Path(name)).name) if write.preview else (name,)


def _files(work: Reconstruction, write: WriteOptions) -> FileSet:
    def written(parts: Sequence[Path]) -> float:
        return _write_picture(parts[0], work, write, *parts[1:])

    extra = (PREVIEW_SUFFIX,) if write.preview else ()
    return FileSet(suffixes=(write.suffix, *extra), write=written, result=lambda: _summary(work))


def _summary(work: Reconstruction) -> Result:
    return result_of(work, {})


def result_of(work: Reconstruction, arrays: Mapping[str, FloatArray]) -> Result:
    """Return what became of a photograph whose rows are all out."""
    return Result(
        arrays=arrays,
        shape=work.shape if IMAGE in work.products else (),
        orientation=work.capture.orientation,
        record=work.record,
        seconds=work.seconds,
        warnings=work.warnings,
        sections=work.sections,
    )


def _finish(work: Reconstruction, products: Sequence[str] | None, out: FloatArray | None) -> Result:
    names = (IMAGE,) if products is None else products
    return result_of(
        work, {name: work.fill(out if name == names[0] else None, name) for name in names}
    )


def _reserved_bytes(capture: Capture, write: WriteOptions) -> int:
    pixels, turned = capture.height * capture.width, capture.orientation
    picture_bytes = held_bytes(write.picture, pixels=pixels, orientation=turned)
    return picture_bytes + PREVIEW_BYTES * write.preview


def _facts(work: Reconstruction, write: WriteOptions) -> Mapping[str, Any]:
    capture = work.capture
    return {
        "orientation": capture.orientation,
        "camera": capture.camera,
        "iso": capture.iso,
        "exposure_time_s": capture.exposure_time_s,
        "metadata": {} if write.strip_metadata else work.origin.metadata.to_json(),
    }


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
        # a DNG of one channel holds three that are equal
        is_grey=len(work.white_balance) == 1 and write.format != "dng",
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


PICTURES: Final = Outputs(
    names=_names,
    files=_files,
    finish=_finish,
    format=lambda write: write.picture,
    reserved_bytes=_reserved_bytes,
    facts=_facts,
    summary=_summary,
)
"""What photographs become."""
