"""Maps of lifetimes of fluorescence, of histograms."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.capture_result import Result
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture
from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.float_pictures import write_exr, write_tiff
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
    decays = stream.facts
    assert isinstance(decays, Decays)
    pulse, fitter = decays.pulse, decays.fitter
    assert pulse is not None  # its rows were read
    assert fitter is not None
    arrays = _arrays(decays)
    lifetime_ps = np.where(arrays["valid"], arrays["lifetime_ps"], np.nan)
    is_guessed = capture.timing.pulse() is None
    notes = []
    if is_guessed and isinstance(pulse, GaussianPulse):
        notes.append(
            f"no pulse is stated: a Gaussian of {FWHM_PER_SIGMA * pulse.sigma_ps:.3g} ps full "
            "width before one decay is estimated; state [laser] fwhm_ps or [irf] if you know it"
        )
    if not arrays["valid"].any():
        notes.append("no pixel has enough photons for a reliable lifetime")
    return Result(
        arrays=arrays,
        writers={
            ".npz": lambda path: write_archive(path, arrays),
            ".png": lambda path: write_preview(path, depth_picture(-lifetime_ps)),
        },
        pictures={
            "exr": (".exr", lambda path: write_exr(path, lifetime_ps[None], "Y")),
            "tiff": (".tif", lambda path: write_tiff(path, lifetime_ps[None])),
        },
        record={
            "product": "lifetime",
            **told_axis(decays.window.axis),
            **told_pulse(pulse, is_guessed=is_guessed),
            "period_ps": capture.timing.lifetime.period_ps,
            "limits_ps": [round(limit, 2) for limit in fitter.limits_ps],
        },
        seconds=work.seconds,
        warnings=(*notes, *work.warnings, *capture.late_notes()),
        sections={"spad": {"pixels": int(lifetime_ps.size), "valid": [int(arrays["valid"].sum())]}},
    )


def _arrays(decays: Decays) -> dict[str, NDArray[Any]]:
    """Return the arrays of the archive."""
    arrays, pixels, fitter = decays.arrays, decays.pixels, decays.fitter
    assert fitter is not None
    is_proved = arrays["evidence"] > fitter.threshold()
    valid = is_proved & arrays["is_determined"] & ~pixels.hot & ~pixels.blind
    return {
        "lifetime_ps": np.where(valid, arrays["lifetime_ps"], np.nan),
        "time_of_flight_ps": arrays["time_of_flight_ps"],
        "amplitude": arrays["amplitude"].astype(np.float32),
        "background": np.maximum(arrays["background"] - pixels.dark, 0.0).astype(np.float32),
        "sigma_ps": arrays["sigma_ps"].astype(np.float32),
        "evidence": arrays["evidence"].astype(np.float32),
        "intensity": arrays["intensity"].astype(np.float32),
        "valid": valid,
    }
