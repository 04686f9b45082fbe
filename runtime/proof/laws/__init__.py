"""Laws that a picture keeps, whatever it shows: `camkit check BUNDLE --level laws`.

law       a law and its worst number
darkroom  scenes photographed by the twin, made pictures by networks and by their front end
photographs  the laws of photographs: white, flat, double, better, range, borders
proof     laws measured, compared with what a bundle states
"""
