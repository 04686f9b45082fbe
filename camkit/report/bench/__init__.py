"""Speed against accuracy, in the order in which a bench works.

settings        what a caller may ask for
trial           one way to do the work, and the axes along which trials vary
discovery       modules of a folder that register themselves
row_maker       what makes the rows of one sort
rows/           which trials a bundle gives; a new sort of row is one new file
timed_capture   the capture that is timed
process_run     a fresh process watched: seconds, memory of its tree, load of others
worker          that process, as any user's program
timing          order of the rounds; median, quantiles and noise of the seconds
machine, gemm   what the machine is, and the fastest it multiplies
known_captures  captures with a known truth
metric          the type of a metric
metrics/        what is measured on a result; a new metric is one new file
accuracy        every method on every known capture
crops           the same patch of every method
row             all that is known about a trial as one flat record
run             the whole bench
pareto, chart   who is beaten by nobody; time against PSNR
page, output    one page for people; all files written
"""
