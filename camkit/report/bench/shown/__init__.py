"""A bench as people see it.

looks          which colour a camera has, which marker a method; the legend
labels         texts beside markers where they cover nothing
front_panel    time against PSNR, all cameras on common axes
bench_chart    the chart: all of that, and below PSNR over the field, a panel for every ISO
bench_page     the page
"""
