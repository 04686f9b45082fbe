"""A bundle beside classical methods, in the order of the work.

- `peers`: the classical methods that camkit is compared with
- `photograph`: a capture, developed for them and finished
- `tuning`: their parameters, chosen on validation pictures
- `measurement`: the journal of single measurements, which may be resumed
- `names`: of the rows, and what tables call them
- `copies`: how far a copy's transfer lies off the frozen one
- `rows`: the rows of the comparison
- `paired`: gains on the same captures, with their error
- `quality_table`: means, gains and the page
- `blind`: old and new beside each other in an order that nobody knows (a command)
- `bank_gain`: what a bank that restores colours together is worth by itself (a command)
- `classical`: classical methods on training samples
- `loss_table`: what a loss is worth where it was trained, and elsewhere (a command)
- `random_generator`: a camera with the generator of chapter 3, not trained (a command)
- `compact_json`: results as they are kept, those of `lens_table` too
"""
