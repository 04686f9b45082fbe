"""The stages that a bundle may list: one file each, and one line in `register`.

A stage names the planes that it takes and gives, and says by `join` what it makes of them. What it
does stands in the module of the same name in `camkit.runtime.stages`, or in the one that it names.

linearise, repair, white_balance, demosaic    the front
foreign                                       what networks of somebody else need
haze, wiener, highlights, deglare, network    the restoration
raise_clipped, illumination, undistort, color  what every picture needs behind it
correct, super_resolve, sharpen, lifetime     single photons
register                                      all of them by type, and those of packages
"""

from camkit.bundle.stages.color import Color
from camkit.bundle.stages.correct import Correct
from camkit.bundle.stages.deglare import Deglare
from camkit.bundle.stages.demosaic import Demosaic
from camkit.bundle.stages.entry import JoinError, PackageStage, Parts, StageEntry
from camkit.bundle.stages.foreign.pack import Pack
from camkit.bundle.stages.foreign.unpack import Unpack
from camkit.bundle.stages.haze import Dehaze
from camkit.bundle.stages.highlights import Highlights
from camkit.bundle.stages.illumination import Illumination
from camkit.bundle.stages.lifetime import Lifetime
from camkit.bundle.stages.linearise import Linearise
from camkit.bundle.stages.network import Network
from camkit.bundle.stages.raise_clipped import RaiseClipped
from camkit.bundle.stages.register import Stage, all_stages, find_stage, type_of
from camkit.bundle.stages.repair import Repair
from camkit.bundle.stages.sharpen import Sharpen
from camkit.bundle.stages.super_resolve import SuperResolve
from camkit.bundle.stages.together import Mosaic, Together
from camkit.bundle.stages.undistort import Undistort
from camkit.bundle.stages.white_balance import WhiteBalance
from camkit.bundle.stages.wiener import Wiener

__all__ = [
    "Color",
    "Correct",
    "Deglare",
    "Dehaze",
    "Demosaic",
    "Highlights",
    "Illumination",
    "JoinError",
    "Lifetime",
    "Linearise",
    "Mosaic",
    "Network",
    "Pack",
    "PackageStage",
    "Parts",
    "RaiseClipped",
    "Repair",
    "Sharpen",
    "Stage",
    "StageEntry",
    "SuperResolve",
    "Together",
    "Undistort",
    "Unpack",
    "WhiteBalance",
    "Wiener",
    "all_stages",
    "find_stage",
    "type_of",
]
