"""`camkit view`: results of `camkit process` on one page, in the order in which data passes.

result_search   files, sidecars and folders become results with their records
record_shape    the types of what is read in a sidecar
picture_light   a result, and what the capture was, as linear light
view_crops      the places that are shown at 100 %
page_data       light, maps and films as data of a page
viewers         the viewer of a picture, of maps and of a film: markup with its data
photon_archive  the archive of arrays of a camera that counts photons, checked
photon_arrays   maps and films of a camera that counts photons
cell_map        where the plan spared work, as rectangles of the picture
record_words    a sidecar in sentences and tables
result_page     results as a page
page_making     `camkit.view`
viewer.js, viewer.css   the script and the style of the viewers
"""
