"""A bundle beside classical methods, in the order of the work.

- `peers`: the classical methods that camkit is compared with
- `photograph`: a capture, developed for them and finished
- `tuning`: their parameters, chosen on validation pictures
- `measurement`: the journal of single measurements, which may be resumed
- `names`: of the rows, and what tables call them
- `copies`: how far a copy's transfer lies off the frozen one
- `rows`: the rows of the comparison
- `paired`: gains on the same captures, with their error
- `real_lens`, `real_lens_pages`: a real lens, its blur against photographs and photographs restored
- `lens_files`: lens files of others, what is read of them, and optiland's numbers beside
- `quality_table`: means, gains and the page
"""
