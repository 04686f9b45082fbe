"""The steps of a design: Adam on the numbers of a map, colour by colour.

Every step computes the PSF of each colour and carries its loss back to the heights before the next
one begins, so that memory is that of one colour. What is drawn (etch errors, and with a reader its
patches) follows from seed and step: a resumed run ends in the same bits.

With a reader the PSFs are computed twice: once for the network, which takes its steps and gives the
slope of the picture's loss to them, and once to carry that slope and the goal's to the heights.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from camkit.models_def.design.plate.goal import GoalShares, goal_loss, goal_shares, masks_of
from camkit.models_def.design.plate.plate_recipe import PlateRecipe
from camkit.models_def.design.plate.reader import Picture, PlateReader
from camkit.models_def.optics.diffraction.map_numbers import HeightMap
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index

State = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """One logged moment.

    Attributes:
        step: Steps done.
        seconds: Since the loop was made or resumed.
        loss: Mean over colours, of the plate as it is made; with a reader its weighted loss on
            fixed patches is added.
        best_loss: The least so far.
        shares: What the colours have of the goal.
        picture: How the reader does; None without one.
    """

    step: int
    seconds: float
    loss: float
    best_loss: float
    shares: GoalShares
    picture: Picture | None = None


class PlateLoop:
    """Runs a design."""

    def __init__(
        self, recipe: PlateRecipe, height_map: HeightMap, reader: PlateReader | None = None
    ) -> None:
        """Prepare the loop.

        Args:
            recipe: What is wanted.
            height_map: The map to begin at; its numbers move.
            reader: The network of a joint design.

        Raises:
            ContractError: If the window does not hold the streaks, or the cells are too wide.
        """
        self.recipe, self.height_map, self.reader = recipe, height_map.float(), reader
        self.step, self.best_loss = 0, math.inf
        self.best: State = {}
        self.best_network: State = {}
        pixels = recipe.pixels
        self._grid = PixelGrid(
            side_px=pixels.side_px, pitch_um=pixels.pitch_um, samples=pixels.samples or None
        )
        waves = torch.tensor(pixels.wavelengths_um, dtype=torch.float64)
        self._index = refractive_index(find_glass(recipe.glass), waves).tolist()
        self._masks = masks_of(recipe.goal, pixels.side_px)
        self._bare = self._lights(torch.zeros(recipe.cells, recipe.cells))
        self._optimizer = torch.optim.Adam(self.height_map.parameters(), lr=recipe.schedule.rate)

    def run(self, last_step: int | None = None, seconds: float = math.inf) -> Iterator[Moment]:
        """Run up to a step (the last by default) or for a time, yielding every logged moment.

        The step that is under way when the time ends is finished, and logged.
        """
        schedule, begin = self.recipe.schedule, time.monotonic()
        end = schedule.steps if last_step is None else min(last_step, schedule.steps)
        while self.step < end:
            self._one_step()
            elapsed_s = time.monotonic() - begin
            if self.step % schedule.log_steps == 0 or self.step == end or elapsed_s >= seconds:
                yield self.judge(elapsed_s)
            if elapsed_s >= seconds:
                return

    def _one_step(self) -> None:
        heights = self.height_map()
        leaf = heights.detach().requires_grad_()
        fabricated = self._etched(leaf, self._errors())
        slopes = self._read(fabricated.detach())
        if self.reader is None or self.step >= self.reader.recipe.hold_steps:
            self._move(heights, self._pushed(leaf, fabricated, slopes))
        self.step += 1

    def _read(self, fabricated: Tensor) -> Tensor | None:
        """Train the network for its steps; return the slopes (colour, side, side) of its loss."""
        if self.reader is None:
            return None
        progress = self.step / self.recipe.schedule.steps
        slopes, _ = self.reader.follow(self._lights(fabricated), self.step, progress)
        return self.reader.recipe.weight * slopes

    def _pushed(self, leaf: Tensor, fabricated: Tensor, slopes: Tensor | None) -> Tensor:
        """Return the slope of all losses to the heights."""
        etched, count = self.recipe.schedule.etched, len(self._bare)
        pushed = torch.zeros_like(leaf)
        for colour in range(count):
            light = self._light(fabricated, colour)
            loss = goal_loss(light, self._bare[colour], self._masks, self.recipe.goal) / count
            if slopes is not None:
                loss = loss + (light * slopes[colour]).sum()
            (slope,) = torch.autograd.grad(loss, leaf, retain_graph=etched)
            pushed += slope
        return pushed

    def _move(self, heights: Tensor, pushed: Tensor) -> None:
        schedule = self.recipe.schedule
        for group in self._optimizer.param_groups:
            group["lr"] = schedule.rate * (1 - self.step / schedule.steps)
        self._optimizer.zero_grad(set_to_none=True)
        heights.backward(pushed)  # type: ignore[no-untyped-call]
        self._optimizer.step()

    def judge(self, seconds: float = 0.0) -> Moment:
        """Evaluate the present map, made without errors; the best are kept."""
        with torch.no_grad():
            fabricated = self._etched(self.height_map(), ())
            light = self._lights(fabricated)
            losses = [
                float(goal_loss(one, bare, self._masks, self.recipe.goal))
                for one, bare in zip(light, self._bare, strict=True)
            ]
        loss, picture = sum(losses) / len(losses), None
        if self.reader is not None:
            picture = self.reader.judge(light)
            loss += self.reader.recipe.weight * picture.loss
        if loss < self.best_loss:
            self.best_loss = loss
            self.best = {
                name: value.clone() for name, value in self.height_map.state_dict().items()
            }
            self.best_network = {} if self.reader is None else self.reader.average()
        return Moment(
            step=self.step,
            seconds=seconds,
            loss=loss,
            best_loss=self.best_loss,
            shares=goal_shares(light, self._bare, self._masks),
            picture=picture,
        )

    def _lights(self, height_um: Tensor) -> Tensor:
        """Return the PSFs (colour, side, side), without gradients."""
        with torch.no_grad():
            return torch.stack([self._light(height_um, c) for c in range(len(self._index))])

    def _light(self, height_um: Tensor, colour: int) -> Tensor:
        bench = self.recipe.bench
        return plate_psf(
            height_um,
            self._index[colour],
            self.recipe.pixels.wavelengths_um[colour],
            bench=bench,
            grid=self._grid,
            depth_mm=bench.focus_mm,
        )

    def _etched(self, height_um: Tensor, errors: tuple[float, ...]) -> Tensor:
        etching = self.recipe.etching
        if etching is None or not self.recipe.schedule.etched:
            return height_um
        return etching.etched(height_um, errors)

    def _errors(self) -> tuple[float, ...]:
        """Return the errors of the masks in this step."""
        schedule, etching = self.recipe.schedule, self.recipe.etching
        if not schedule.depth_error or etching is None:
            return ()
        generator = torch.Generator().manual_seed(schedule.seed * 1_000_003 + self.step)
        normal = torch.randn(etching.masks, generator=generator, dtype=torch.float64)
        return tuple((schedule.depth_error * normal).tolist())

    def take_best(self) -> None:
        """Restore the best map, and the network that read it then."""
        self.height_map.load_state_dict(self.best)
        if self.reader is not None:
            self.reader.take_average(self.best_network)

    def state(self) -> State:
        """Return all that a resumed run needs; `weights` is where others look for a network."""
        state = {
            "step": self.step,
            "best_loss": self.best_loss,
            "best": self.best,
            "map": self.height_map.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }
        if self.reader is not None:
            state |= {"weights": {"network": self.best_network}, "reader": self.reader.state()}
        return state

    def load(self, state: State) -> None:
        """Restore a saved state."""
        self.step, self.best_loss = state["step"], state["best_loss"]
        self.best = state["best"]
        self.height_map.load_state_dict(state["map"])
        self._optimizer.load_state_dict(state["optimizer"])
        if self.reader is not None:
            self.best_network = state["weights"]["network"]
            self.reader.load(state["reader"])
