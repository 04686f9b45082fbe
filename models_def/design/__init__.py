"""Joint design: a lens and the network that undoes its blur, trained in one loop.

    free numbers of the lens -> kernels -> captures of sharp patches -> network -> loss
              ^                                                           |
              +---------------------- gradients -------------------------+

- `design_recipe`: a joint design as TOML
- `starts`: where a design begins: the best of many starts
- `lens`: what a loop asks of its lens
- `lens_module`: the lens as a torch module: free numbers, kernels over fields and depths
- `states_module`: the lens with several configurations, each looked at like one more depth
- `front`: what stands between sensor and network
- `sensor`: sharp patches blurred and recorded
- `loss`: eq. (6.15) and (6.16) of the thesis, and the loss of a recovered picture
- `loop`: the training loop: parameter groups, decay, hold and freeze, the best lens kept, resume
- `assembly`: a recipe turned into the parts of a loop
- `tolerance`: what fabrication costs after recovery
- `fabrication`: copies as a factory makes them, focused at assembly
- `run`, `run_files`: a loop with its files: checkpoint, log, the lens
- `plate/`: the relief of a plate, without a network
"""
