"""What the sharpening of single photons is measured with.

limits      where sharpening breaks, one condition after the other
accuracy    errors against the bound, sigma, false alarms and CPU seconds of every method
depth       the fine grid of a bundle against maps that are enlarged
plate_check a plate simulated again: aperture, pixels, focus, etching
misetched   a plate etched too deep or too shallow: what measuring and training win back; `misetch`
edge_mtf    MTF of the array and of the pictures made of it, figure 4.9
high_speed  a fan before the array, with its plate and without; `fan`, `strip`
transient   a pulse that sweeps over an object and its mirror image; `mirror`, `strip`
tables      tables 4.1 and 4.2: networks of every sampling trained and judged; `table`
baselines   those networks as the bundle that `camkit bench` reads; `edge_export`
linear      the runtime's linear estimate, for misetched and tables
real_data   captures of real cameras against what is known of them
"""
