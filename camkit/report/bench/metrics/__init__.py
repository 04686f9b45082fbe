"""Metrics: every module here defines `METRIC`, a `camkit.report.bench.metric.Metric`.

hdr        PSNR to 2^8, stops, unclipped, mu-law, PU21, exposures and JOD, on linear light
picture    PSNR and SSIM on sRGB values
"""
