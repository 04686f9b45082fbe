"""The loop of a joint design: lens and network under one loss.

A step draws sharp patches and fields, photographs them through the present lens at every depth,
recovers them, and moves the free numbers of the lens and the weights of the network, each with a
rate of its own. All draws follow from the seed and the number of the step, so that a resumed run
ends in the same bits. The lens that was best on fixed patches is kept, with its network.

Several machines share a step when the process group of torch.distributed is up (torchrun): each
draws its own patches, gradients are averaged.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.models_def.design.design_schedule import DesignSchedule
from camkit.models_def.design.fabrication import draw_copy
from camkit.models_def.design.front import Front
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.design.loss import DesignLoss, design_loss
from camkit.models_def.design.sensor import Recorder, capture
from camkit.models_def.design.shipped_camera import Camera, Knowledge
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors
from camkit.models_def.sensors.tone import encode_srgb
from camkit.models_def.training.pictures import SceneSource

VALID_SEED: Final = 900_000
SCORE_SEED: Final = 950_000
VALID_COPIES: Final = 8
SPREAD_SEED: Final = 980_000
_CLIP: Final = 1.0

State = dict[str, Any]
Watch = Callable[[int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignParts:
    """The parts that a loop joins.

    Attributes:
        lens: With its free numbers, if it has any.
        network: Takes what `front` gives; None judges what the front gives last (Wiener alone,
            or the capture).
        front: Between sensor and network.
        recorder: The pixels.
        loss: What is minimised.
        source: Of sharp patches.
        fabrication: Errors of the copies that captures are made with; the filter knows the
            nominal lens. None makes them with the lens itself.
        camera: In the place of `recorder` and `front`, where colours are restored together.
        start: Name of the built-in lens that a search of the library chose; empty for another.
    """

    lens: DesignLens
    network: nn.Module | None
    front: Front
    recorder: Recorder
    loss: DesignLoss
    source: SceneSource
    fabrication: FabricationErrors | None = None
    camera: Camera | None = None
    start: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Patches of a step.

    Attributes:
        sharp: (b, 3, s, s) linear.
        fields: (b,).
        normal: (depth, b, 3, c, c).
        iso: (b,) 0..1, places between the ISOs of a camera; empty without one.
    """

    sharp: Tensor
    fields: Tensor
    normal: Tensor
    iso: Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """One validated moment.

    Attributes:
        step: Steps done.
        seconds: Since the loop was made or resumed.
        loss: Of the last step.
        valid_db: Mean PSNR of sRGB values over fixed patches.
        best_db: That of the best lens so far.
        merit: What the best lens has the most of, see `DesignLoop.judge`.
        best_merit: That of the best lens so far.
        best_step: Steps that the best lens had done.
        lost_light: Share outside the window of a kernel, at the worst field, depth and colour.
    """

    step: int
    seconds: float
    loss: float
    valid_db: float
    best_db: float
    merit: float
    best_merit: float
    best_step: int
    lost_light: float


class DesignLoop:
    """Runs a joint design."""

    def __init__(self, parts: DesignParts, schedule: DesignSchedule) -> None:
        self.parts, self.schedule = parts, schedule
        self.step = 0
        self.best_db = -math.inf
        self.best_merit = -math.inf
        self.best_step = 0
        self.best: State = {}
        self._spread: Tensor | None = None
        groups = [{"params": [parts.lens.moves], "lr": schedule.lens_rate}]
        if parts.network is not None:
            groups.append({"params": [*parts.network.parameters()], "lr": schedule.network_rate})
        self._rates = [float(group["lr"]) for group in groups]  # type: ignore[arg-type]
        self._optimizer = torch.optim.Adam(groups)
        self._valid = [self._draw(VALID_SEED + i, 1) for i in range(schedule.valid_patches)]

    def run(self, last_step: int | None = None, on_step: Watch | None = None) -> Iterator[Progress]:
        """Run up to a step (the last by default), yielding every validated moment.

        Args:
            last_step: To run up to.
            on_step: Is called with the number of finished steps after each one.
        """
        schedule, begin = self.schedule, time.monotonic()
        end = schedule.steps if last_step is None else min(last_step, schedule.steps)
        while self.step < end:
            loss = self._one_step()
            if on_step is not None:
                on_step(self.step)
            if self.step % schedule.valid_steps == 0 or self.step == end:
                yield self.judge(loss, time.monotonic() - begin)

    def _one_step(self) -> float:
        schedule, parts = self.schedule, self.parts
        moving = schedule.moves_lens(self.step, has_network=parts.network is not None)
        decay = schedule.decay ** (self.step // schedule.epoch_steps)
        for group, rate in zip(self._optimizer.param_groups, self._rates, strict=True):
            group["lr"] = rate * decay
        self._optimizer.param_groups[0]["lr"] *= moving
        batch = self._draw(_step_seed(schedule.seed, self.step), schedule.batch)
        with torch.set_grad_enabled(True):
            parts.lens.moves.requires_grad_(moving)
            kernels, penalty = self._kernels(moving=moving)
            capture_kernels = self._capture_kernels(
                kernels, _step_seed(schedule.seed, self.step), moving=moving
            )
            if self.step % self._spread_steps == 0:
                self._spread = self._measured_spread(kernels)
            knowledge = Knowledge(kernels=kernels, spread=self._spread)
            pictures, sharp = self._pictures(batch, knowledge, capture_kernels)
            loss = design_loss(parts.loss, pictures, sharp)
            total = loss + schedule.penalty_weight * penalty
        self._optimizer.zero_grad(set_to_none=True)
        if total.requires_grad:
            total.backward()  # type: ignore[no-untyped-call]
        self._share_gradients()
        if parts.network is not None:
            nn.utils.clip_grad_norm_(parts.network.parameters(), _CLIP)
        self._optimizer.step()
        self.step += 1
        return float(loss.detach())

    def _kernels(self, *, moving: bool) -> tuple[Tensor, Tensor]:
        with torch.set_grad_enabled(moving):
            kernels, penalty = self.parts.lens()
        return kernels.float(), penalty

    def _capture_kernels(self, kernels: Tensor, number: int, *, moving: bool) -> Tensor:
        """Return the kernels of the captures: those of copy `number`, if there are any.

        Args:
            kernels: Of the nominal lens.
            number: Of the copy.
            moving: Whether gradients flow.
        """
        lens, errors = self.parts.lens, self.parts.fabrication
        if errors is None:
            return kernels
        with torch.set_grad_enabled(moving):
            return lens.made_kernels(draw_copy(lens.problem.free.lens, errors, number)).float()

    @property
    def _spread_steps(self) -> int:
        camera = self.parts.camera
        return self.schedule.steps if camera is None else camera.choice.spread_steps

    def _measured_spread(self, kernels: Tensor) -> Tensor | None:
        """Return V of the present lens (depth, field, 3, n), if the filter asks for it."""
        camera, problem = self.parts.camera, self.parts.lens.problem
        if camera is None:
            return None
        if not camera.choice.copies or self.parts.fabrication is None:
            heights_mm = problem.slopes * paraxial_data(problem.free.lens).efl_mm
            return camera.stated_spread(heights_mm).expand(len(kernels), -1, -1, -1)
        numbers = range(SPREAD_SEED, SPREAD_SEED + camera.choice.copies)
        copies = [self._capture_kernels(kernels, number, moving=False) for number in numbers]
        frozen = kernels if self.parts.front.depth_known else kernels.mean(0, keepdim=True)
        return camera.measured_spread(frozen.detach(), copies)

    def _knowledge(self) -> tuple[Knowledge, Tensor]:
        """Return what the filter knows of the present lens, without gradients, and the penalty."""
        kernels, penalty = self._kernels(moving=False)
        return Knowledge(kernels=kernels, spread=self._measured_spread(kernels)), penalty

    def _pictures(
        self, batch: Batch, knowledge: Knowledge, capture_kernels: Tensor | None = None
    ) -> tuple[Tensor, Tensor]:
        """Return recovered pictures (depth, b, 3, p, p) and the sharp ones in sRGB tone.

        Args:
            batch: Patches.
            knowledge: What the filter knows.
            capture_kernels: That captures are made with; None for the nominal ones.
        """
        copy_kernels, schedule = (
            knowledge.kernels if capture_kernels is None else capture_kernels,
            self.schedule,
        )
        recovered = [
            self._recovered(batch, knowledge, depth, of_depth[batch.fields])
            for depth, of_depth in enumerate(copy_kernels)
        ]
        edge = (batch.sharp.shape[-1] - schedule.patch_px) // 2
        sharp = batch.sharp[..., edge : edge + schedule.patch_px, edge : edge + schedule.patch_px]
        return torch.stack(recovered), encode_srgb(sharp)

    def _recovered(
        self, batch: Batch, knowledge: Knowledge, depth: int, patch_kernels: Tensor
    ) -> Tensor:
        """Return recovered pictures (b, 3, p, p) of a depth through kernels (b, 3, k, k)."""
        parts = self.parts
        kernels = knowledge.kernels[depth] if parts.front.depth_known else knowledge.kernels.mean(0)
        filter_kernels, normal = kernels[batch.fields], batch.normal[depth]
        if parts.camera is None or knowledge.spread is None:
            recorded = capture(batch.sharp, patch_kernels, parts.recorder, normal)
            planes = parts.front.planes(recorded, filter_kernels)
            output: Tensor = planes[:, -3:] if parts.network is None else parts.network(planes)
            return output
        noise = parts.camera.noise_at(batch.iso)
        developed = parts.camera.capture(batch.sharp, patch_kernels, noise, normal)
        spread = knowledge.spread[depth][batch.fields]
        restored = parts.camera.restored(developed, filter_kernels, spread, noise)
        return parts.camera.pictures(developed, restored, noise, parts.network)

    def _draw(self, seed: int, count: int) -> Batch:
        parts, schedule = self.parts, self.schedule
        rng = np.random.default_rng(seed)
        kernel_px, fields = parts.lens.pixels.kernel_px, len(parts.lens.problem.slopes)
        inner = schedule.patch_px + 2 * parts.front.margin_px
        side = inner + kernel_px - 1
        crops = np.stack([parts.source.draw_crop(rng, side) for _ in range(count)])
        normal = rng.standard_normal(
            (parts.lens.depth_count, count, 3, inner, inner), dtype=np.float32
        )
        numbers = rng.permutation(np.arange(count) + rng.integers(fields)) % fields
        iso = rng.random(count if parts.camera is not None else 0)
        return Batch(
            sharp=torch.from_numpy(crops.clip(0, 1)),
            fields=torch.from_numpy(numbers),
            normal=torch.from_numpy(normal),
            iso=torch.from_numpy(iso),
        )

    def judge(self, loss: float = math.nan, seconds: float = 0.0) -> Progress:
        """Recover fixed patches with the present lens and network; the best are kept.

        The best have the largest PSNR; where captures are judged (`edof`) or depths have weights,
        the least loss. What a lens outside its limits pays in the loss counts against it.
        """
        with torch.no_grad():
            knowledge, penalty = self._knowledge()
            copies = self._valid_copies(knowledge.kernels)
            scores = [
                self._judged(batch, knowledge, copies[i % len(copies)])
                for i, batch in enumerate(self._valid)
            ]
        valid_db, valid_loss = (float(np.mean(column)) for column in zip(*scores, strict=True))
        merit = valid_db if self.parts.loss.is_psnr else -valid_loss
        merit -= self.schedule.penalty_weight * float(penalty)
        if merit > self.best_merit:
            self.best_db, self.best_merit, self.best = valid_db, merit, self._weights()
            self.best_step = self.step
        return Progress(
            step=self.step,
            seconds=seconds,
            loss=loss,
            valid_db=valid_db,
            best_db=self.best_db,
            merit=merit,
            best_merit=self.best_merit,
            best_step=self.best_step,
            lost_light=1 - float(knowledge.kernels.sum((-2, -1)).amin()),
        )

    def _valid_copies(self, kernels: Tensor) -> list[Tensor]:
        """Return kernels of the copies that lenses are judged by, drawn apart from all others."""
        count = 1 if self.parts.fabrication is None else VALID_COPIES
        return [self._capture_kernels(kernels, VALID_SEED + i, moving=False) for i in range(count)]

    def _judged(
        self, batch: Batch, knowledge: Knowledge, capture_kernels: Tensor
    ) -> tuple[float, float]:
        """Return mean PSNR and loss of a batch."""
        pictures, sharp = self._pictures(batch, knowledge, capture_kernels)
        loss = float(design_loss(self.parts.loss, pictures, sharp))
        return _psnr_db(pictures, sharp), loss

    def field_pictures(self, patches: int) -> Iterator[tuple[int, Tensor, Tensor]]:
        """Yield so many fixed patches at every field, drawn apart from all others.

        Yields:
            Field, recovered (depth, 1, 3, p, p) and sharp (1, 3, p, p), in sRGB tone.
        """
        with torch.no_grad():
            knowledge, _ = self._knowledge()
            copies = self._valid_copies(knowledge.kernels)
            for field in range(len(self.parts.lens.problem.slopes)):
                at = torch.tensor([field])
                for number in range(field * patches, (field + 1) * patches):
                    batch = replace(self._draw(SCORE_SEED + number, 1), fields=at)
                    capture_kernels = copies[number % len(copies)]
                    yield field, *self._pictures(batch, knowledge, capture_kernels)

    def look(self, count: int = 4) -> tuple[Tensor, tuple[Tensor, Tensor, Tensor]]:
        """Return kernels and, of fixed patches, (count, 3, h, w) captures, recovered, sharp."""
        with torch.no_grad():
            knowledge, _ = self._knowledge()
            rows = []
            for batch in self._valid[:count]:
                pictures, sharp = self._pictures(batch, knowledge)
                rows.append((self._capture_pictures(batch, knowledge)[0], pictures[0, 0], sharp[0]))
        captures, recovered, sharp_ones = (
            torch.stack(column) for column in zip(*rows, strict=True)
        )
        return knowledge.kernels, (captures, recovered, sharp_ones)

    def _capture_pictures(self, batch: Batch, knowledge: Knowledge) -> Tensor:
        """Return captures of the first depth through the nominal lens, (b, 3, p, p) in sRGB."""
        parts, patch_kernels = self.parts, knowledge.kernels[0][batch.fields]
        if parts.camera is not None:
            noise = parts.camera.noise_at(batch.iso)
            developed = parts.camera.capture(batch.sharp, patch_kernels, noise, batch.normal[0])
            return parts.camera.pictures(developed, developed, noise, None)
        recorded = capture(batch.sharp, patch_kernels, parts.recorder, batch.normal[0])
        edge = parts.front.margin_px
        inner = slice(edge, recorded.shape[-1] - edge)
        return encode_srgb(recorded[..., inner, inner])

    def _share_gradients(self) -> None:
        if not (torch.distributed.is_available() and torch.distributed.is_initialized()):
            return
        workers = torch.distributed.get_world_size()
        for group in self._optimizer.param_groups:
            for parameter in group["params"]:
                if parameter.grad is not None:
                    torch.distributed.all_reduce(parameter.grad)
                    parameter.grad /= workers

    def _weights(self) -> State:
        network = self.parts.network
        return {
            "moves": self.parts.lens.moves.detach().clone(),
            "network": {}
            if network is None
            else {name: value.detach().clone() for name, value in network.state_dict().items()},
        }

    def state(self) -> State:
        """Return all that a resumed run needs: tensors and plain numbers."""
        spread = {} if self._spread is None else {"spread": self._spread}
        return {
            **spread,
            "step": self.step,
            "best_db": self.best_db,
            "best_merit": self.best_merit,
            "best_step": self.best_step,
            "best": self.best,
            "weights": self._weights(),
            "optimizer": self._optimizer.state_dict(),
        }

    def load(self, state: State) -> None:
        """Restore a saved state."""
        self.step, self.best = state["step"], state["best"]
        self.best_db, self.best_merit = state["best_db"], state["best_merit"]
        self.best_step = state.get("best_step", 0)
        self._spread = state.get("spread")
        self._set(state["weights"])
        self._optimizer.load_state_dict(state["optimizer"])

    def take_best(self) -> None:
        """Restore the best lens and its network."""
        if self.best:
            self._set(self.best)

    def _set(self, weights: State) -> None:
        with torch.no_grad():
            self.parts.lens.moves.copy_(weights["moves"])
        if self.parts.network is not None:
            self.parts.network.load_state_dict(weights["network"])


def _psnr_db(pictures: Tensor, sharp: Tensor) -> float:
    error = (pictures.clamp(0, 1) - sharp).square().mean((2, 3, 4)).clamp_min(1e-10)
    return float((-10 * torch.log10(error)).mean())


def _step_seed(seed: int, step: int) -> int:
    rank = 0
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        rank = torch.distributed.get_rank()
    return (seed * 1_000_003 + step) * 64 + rank
