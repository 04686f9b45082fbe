"""Table 3.1: what a loss is worth where it was trained, and elsewhere.

twins        two recipes of one: the camera before a display, and outside
domain       samples of a recipe, to judge restorations on
classical    classical methods on those samples
loss_table   rows by their loss and without training, the table
overfitting  does a supervised network overfit to where it was trained
"""
