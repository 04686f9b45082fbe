"""The arithmetic of `trace`: rays through surfaces, and back.

In the order in which data flows:

- `profile`: height and slope of a conic and an even asphere; `series`: other polynomial parts
- `sag`: both, of a surface of a prescription
- `phase_polynomial`: a phase that a surface adds, and its slopes
- `frame`: surfaces that are turned and shifted
- `meeting`: where rays meet a surface, `groove`: one that is cut into grooves
- `kernel`: rays through the surfaces of a lens, each with its fate
- `gradient_parts`: what a gradient is asked for and gives
- `adjoint`: the gradients, from where rays met the surfaces
- `gradient`: both as one node of the autograd graph, in blocks, with bounded memory
- `compilation`: a whole lens fused into one loop
"""
