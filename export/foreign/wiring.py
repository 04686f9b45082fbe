"""The stages of a camera with a network of somebody else in it, by its contract.

the stages of a camera     front  |  restoration  |  tail
rgb                        front  |  network  |  tail
rgb+restored               front  |  wiener, network  |  tail
mosaic                     front before the demosaic  |  network  |  tail
packed                     front before the demosaic  |  pack, network, unpack  |  tail
a mosaic comes out         ... network, unpack  |  demosaic and what follows it
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from camkit.bundle.facts import Port
from camkit.bundle.manifest import Manifest
from camkit.bundle.stages import Demosaic, Network, Pack, Stage, Unpack, Wiener
from camkit.bundle.stages.foreign.coding import Coding
from camkit.errors import ContractError
from camkit.export.foreign.contract import SPACES, Contract

ROLE: Final = "restore"
CLEAN: Final = "clean"
WHOLE: Final = "whole"
PACKED: Final = "packed"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Parts:
    """The stages of a camera around its restoration.

    Attributes:
        front: Up to the planes that are restored.
        bank: None for a camera without.
        tail: Behind the restoration.
        plane: What is restored.
        restored: What the tail takes.
    """

    front: tuple[Stage, ...]
    bank: Wiener | None
    tail: tuple[Stage, ...]
    plane: str
    restored: str


def stages_of(contract: Contract, manifest: Manifest, output_channels: int) -> tuple[Stage, ...]:
    """Return the stages of a camera with the network.

    Args:
        contract: Of the network.
        manifest: Of the camera that it is added to; its own networks are left out.
        output_channels: Of the network.

    Raises:
        ContractError: If the camera lacks what the contract asks for.
    """
    parts = _parts(manifest)
    if contract.planes == "rgb":
        takes: tuple[str, ...] = (parts.plane,)
        return (*parts.front, _network(contract, takes), *_renamed(parts, CLEAN))
    if contract.planes == "rgb+restored":
        if parts.bank is None:
            raise ContractError(
                f'planes = "rgb+restored" needs a camera with a filter; {manifest.name} has none'
            )
        takes = (parts.plane, parts.bank.gives[0])
        return (*parts.front, parts.bank, _network(contract, takes), *_renamed(parts, CLEAN))
    return _on_mosaic(contract, manifest, parts, output_channels)


def _on_mosaic(
    contract: Contract, manifest: Manifest, parts: _Parts, output_channels: int
) -> tuple[Stage, ...]:
    place = next((i for i, s in enumerate(parts.front) if isinstance(s, Demosaic)), None)
    if place is None:
        raise ContractError(
            f'planes = "{contract.planes}" needs a camera with a mosaic; {manifest.name} has none'
        )
    before, after = parts.front[:place], parts.front[place:]
    mosaic = after[0].takes[0]
    packed = contract.planes == "packed"
    middle: list[Stage] = []
    if packed:
        middle.append(Pack(takes=(mosaic,), gives=(PACKED,), order=contract.order))
    middle.append(_network(contract, (PACKED if packed else mosaic,)))
    if packed:
        middle.append(Unpack(takes=(CLEAN,), gives=(WHOLE,)))
    last = WHOLE if packed else CLEAN
    if output_channels == 3:
        return (*before, *middle, *_renamed(parts, last))
    demosaic = after[0].model_copy(update={"takes": (last,)})
    rest = (demosaic, *after[1:], *(() if parts.bank is None else (parts.bank,)))
    result = parts.plane if parts.bank is None else parts.bank.gives[0]
    return (*before, *middle, *rest, *_renamed(parts, result))


def _parts(manifest: Manifest) -> _Parts:
    stages = manifest.stages
    places = [i for i, s in enumerate(stages) if isinstance(s, Wiener | Network)]
    if not places:
        # a camera that only develops: the restoration would lie behind its demosaic
        first = next((i for i, s in enumerate(stages) if s.type in _TAIL), None)
        if first is None:
            raise ContractError(f"{manifest.name} has no place for a network among its stages")
        plane = stages[first].takes[0]
        return _Parts(
            front=stages[:first], bank=None, tail=stages[first:], plane=plane, restored=plane
        )
    first, last = places[0], places[-1]
    strangers = [s for s in stages[first : last + 1] if not isinstance(s, Wiener | Network)]
    if strangers or manifest.kind != "bayer":
        raise ContractError(
            f"{manifest.name} is a camera of the kind {manifest.kind} with stages of its own "
            f"({', '.join(s.type for s in stages)}); networks are added to those of the kind bayer"
        )
    bank = next((s for s in stages if isinstance(s, Wiener)), None)
    return _Parts(
        front=stages[:first],
        bank=bank,
        tail=stages[last + 1 :],
        plane=stages[first].takes[0],
        restored=stages[last].gives[0],
    )


_TAIL: Final = ("raise_clipped", "illumination", "undistort", "color")


def _renamed(parts: _Parts, plane: str) -> list[Stage]:
    """Return the tail, taking another plane in place of what was restored."""
    return [
        stage.model_copy(
            update={"takes": tuple(plane if n == parts.restored else n for n in stage.takes)}
        )
        for stage in parts.tail
    ]


def _network(contract: Contract, takes: tuple[str, ...]) -> Network:
    space, output = SPACES[contract.space], SPACES[contract.output_space]
    if space is None or output is None:
        return Network(role=ROLE, takes=takes, gives=(CLEAN,), scale=contract.stabilised_scale)
    coding = Coding(
        output=output,
        exposure=contract.exposure,
        gain=contract.numbers.gain,
        offset=contract.numbers.offset,
        output_gain=contract.output_numbers.gain,
        output_offset=contract.output_numbers.offset,
        noise=contract.noise,
    )
    return Network(role=ROLE, takes=takes, gives=(CLEAN,), transform=space, coding=coding)


def ports_of(
    contract: Contract, output_channels: int, scale: int
) -> tuple[tuple[Port, ...], tuple[Port, ...]]:
    """Return what the channels of the network are, in and out."""
    names: Sequence[str] = {
        "rgb": ("rgb",),
        "rgb+restored": ("rgb", "restored"),
        "mosaic": ("mosaic",),
        "packed": ("packed",),
    }[contract.planes]
    inputs = [
        Port(name=name, channels=count)
        for name, count in zip(names, contract.plane_channels, strict=True)
    ]
    if contract.noise:
        inputs.append(Port(name="noise", channels=1))
    return tuple(inputs), (Port(name=CLEAN, channels=output_channels, scale=scale),)
