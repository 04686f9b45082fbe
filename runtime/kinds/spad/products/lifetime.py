"""Maps of lifetimes of fluorescence, of histograms."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.capture_result import Result
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture
from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.picture import write_exr, write_tiff
from camkit.runtime.kinds.spad.products.preview import depth_picture, write_preview
from camkit.runtime.kinds.spad.products.record import told_axis, told_pulse
from camkit.runtime.kinds.spad.pulse import FWHM_PER_SIGMA, GaussianPulse
from camkit.runtime.kinds.spad.stages.lifetime import Decays


def make_lifetime(work: Reconstruction, capture: PhotonCapture, product: str) -> Result:
    """Return the lifetime of every pixel; arguments as of `make_depth`.

    Raises:
        DecodeError: If the file is damaged, or holds no counts.
        ContractError: If what is stated of it cannot be true of it.
        UnsupportedError: If it is a scan with a gate.
        Cancelled: If the caller wished so.
    """
    stream = work.stream_of(product)
    for _ in work.metered(stream.bands()):
        pass
    decays = stream.beside
    assert isinstance(decays, Decays)
    pulse, fitter = decays.pulse, decays.fitter
    assert pulse is not None  # its rows were read
    assert fitter is not None
    arrays = _arrays(decays)
    shown = np.where(arrays["valid"], arrays["lifetime_ps"], np.nan)
    is_guessed = capture.timing.pulse() is None
    told = []
    if is_guessed and isinstance(pulse, GaussianPulse):
        told.append(
            f"no pulse is stated: a Gaussian of {FWHM_PER_SIGMA * pulse.sigma_ps:.3g} ps full "
            "width before one decay is estimated; state [laser] fwhm_ps or [irf] if you know it"
        )
    if not arrays["valid"].any():
        told.append("no pixel has enough photons for a reliable lifetime")
    return Result(
        arrays=arrays,
        writers={
            ".npz": lambda path: write_archive(path, arrays),
            ".png": lambda path: write_preview(path, depth_picture(-shown)),
        },
        pictures={
            "exr": (".exr", lambda path: write_exr(path, shown[None], "Y")),
            "tiff": (".tif", lambda path: write_tiff(path, shown[None])),
        },
        record={
            "product": "lifetime",
            **told_axis(decays.window.axis),
            **told_pulse(pulse, is_guessed=is_guessed),
            "period_ps": capture.timing.lifetime.period_ps,
            "limits_ps": [round(limit, 2) for limit in fitter.limits_ps],
        },
        seconds=work.seconds,
        warnings=(*told, *work.warnings, *capture.late_notes()),
        sections={"spad": {"pixels": int(shown.size), "valid": [int(arrays["valid"].sum())]}},
    )


def _arrays(decays: Decays) -> dict[str, NDArray[Any]]:
    """Return the arrays of the archive."""
    found, pixels, fitter = decays.arrays, decays.pixels, decays.fitter
    assert fitter is not None
    believed = found["evidence"] > fitter.threshold()
    valid = believed & found["known"] & ~pixels.hot & ~pixels.blind
    return {
        "lifetime_ps": np.where(valid, found["lifetime_ps"], np.nan),
        "time_of_flight_ps": found["time_of_flight_ps"],
        "amplitude": found["amplitude"].astype(np.float32),
        "background": np.maximum(found["background"] - pixels.dark, 0.0).astype(np.float32),
        "sigma_ps": found["sigma_ps"].astype(np.float32),
        "evidence": found["evidence"].astype(np.float32),
        "intensity": found["intensity"].astype(np.float32),
        "valid": valid,
    }
