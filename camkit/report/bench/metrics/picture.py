"""PSNR and SSIM on sRGB values, by the protocol of `camkit.report.quality`."""

from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.report.bench.metric import Column, Metric
from camkit.report.quality import judge


def measure(restored: FloatArray, sharp: FloatArray) -> dict[str, float]:
    """Compare a linear Rec.709 picture with sRGB values of the truth."""
    score = judge(restored, sharp)
    return {"psnr_db": score.psnr_db, "ssim": score.ssim}


def applies(bundle: Bundle) -> bool:
    """Tell whether a bundle makes pictures."""
    return bundle.manifest.input_contract in ("raw_bayer_v1", "linear_rgb_v1")


METRIC = Metric(
    columns=(
        Column(name="psnr_db", spread="psnr_std_db", of_input="input_psnr_db"),
        Column(name="ssim", spread="ssim_std", of_input="input_ssim"),
    ),
    measure=measure,
    applies=applies,
)
