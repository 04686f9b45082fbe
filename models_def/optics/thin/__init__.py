"""A thin plate for a large field: Fresnel profiles that keep a sharp peak everywhere (ch. 3).

In the order in which data flows:

- `thin_recipe`: what is wanted, from a TOML file
- `ideal`: the phase that one direction would want of the whole aperture (eq. 3.1-3.3)
- `partition`: one profile for all directions, each in its virtual aperture (eq. 3.4), meridional
- `skew`: the same as spots of skew rays through both faces of the plate
- `solver`: profiles, distance of the sensor and virtual apertures that make these spots small
- `plate_lens`: the plate as a lens file
- `peak`: how much light lies near the peak of a field, and how far the haze reaches
- `middle`: what the light of a field is gathered about: its peak, or its chief ray
- `waves`: the same peak as a sum of waves
- `report`: both of a lens, for people and programs
- `hazy_freezing`: both of a lens over the field, as core kernels and a haze in cells
- `distances`: the same at other distances than that of its focus
- `sag_table`: a profile for the workshop
- `lens_sag`: the profiles of all surfaces of a lens in one table
"""
