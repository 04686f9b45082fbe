"""The steps from a lens to a bundle; each returns what is to be remembered of it.

described   lens stopped and focused, sensor found       recipe.toml, lens.toml
frozen      PSF at a fixed grid, without a search        psf.safetensors, freeze.json
            (a measured PSF is taken as it is            measured.safetensors)
filtered    a bundle without a network: usable           filter.camkit
fitted      the bank that restores colours together      recipe.toml
trained     a network behind it                          NAME_SIZE.pt
exported    the bundle with it, proved                   network.camkit
"""

import shutil
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

from camkit.export.packing import bundle as export_bundle
from camkit.models_def.face.network_training import train
from camkit.models_def.face.optics_freezing import freeze
from camkit.models_def.face.recipe_writing import (
    CameraWords,
    DescribedCamera,
    describe_camera,
    is_measured,
    write_camera,
)
from camkit.models_def.kinds.bayer.recipe_draft import recipe_text
from camkit.models_def.training.bank_fitting import BankFitOptions, bank_fitting_kind, with_bank
from camkit.models_def.training.kind import read_recipe
from camkit.progress import note
from camkit.report.making.work_folder import Facts, WorkFolder
from camkit.runtime.output.part_file import atomic_output

RECIPE: Final = "recipe.toml"
LENS: Final = "lens.toml"
MEASURED: Final = "measured.safetensors"
PSF: Final = "psf.safetensors"
REPORT: Final = "freeze.json"
FILTER_BUNDLE: Final = "filter.camkit"
NETWORK_BUNDLE: Final = "network.camkit"
FIT_SAMPLES: Final = 160
FIT_STEPS: Final = 120


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraWish:
    """The camera that is asked for.

    Attributes:
        optics: Lens file, name of a built-in lens, or measured PSF (.safetensors).
        camera: Sensor and use of the lens.
        name: Of the camera.
        size: Of the network.
        start: Bundle or checkpoint with the first weights.
        data: Folder of pictures to train on; None for procedural scenes.
        valid: Folder of pictures to choose and judge by; None likewise.
        workers: Processes that make samples.
        minutes: Of the CPU, for everything.
    """

    optics: Path
    camera: CameraWords
    name: str
    size: str
    start: Path
    data: Path | None
    valid: Path | None
    workers: int
    minutes: float

    @property
    def is_measured(self) -> bool:
        """Return whether the optics are a PSF that was measured."""
        return is_measured(self.optics)

    def to_json(self) -> dict[str, Any]:
        """Return all that decides the result, plain values."""
        words = {**asdict(self.camera), **{f.name: getattr(self, f.name) for f in fields(self)}}
        return {
            name: value if isinstance(value, int | float | None) else str(value)
            for name, value in words.items()
            if name not in ("camera", "workers")
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSteps:
    """The steps of one camera.

    Attributes:
        wish: What is asked for.
        work: Their folder.
    """

    wish: CameraWish
    work: WorkFolder

    @property
    def recipe(self) -> Path:
        """Return the recipe."""
        return self.work.path(RECIPE)

    @property
    def checkpoint(self) -> Path:
        """Return the checkpoint of the training."""
        return self.work.path(f"{self.wish.name}_{self.wish.size}.pt")

    def describe(self) -> Facts:
        """Read lens and sensor; write recipe and lens."""
        described = self._described()
        write_camera(described, self.recipe, self.work.path(self._optics_name))
        return described.facts()

    def _described(self) -> DescribedCamera:
        wish = self.wish
        return describe_camera(wish.optics, wish.camera, wish.name, self._optics_name)

    @property
    def _optics_name(self) -> str:
        return MEASURED if self.wish.is_measured else LENS

    def freeze(self) -> Facts:
        """Freeze the PSF, and write the recipe anew with the kernels and blocks that suit it."""
        described = self._described()
        facts = freeze(
            self.work.path(LENS),
            self.work.path(PSF),
            recipe=self.recipe,
            depths_mm=described.draft.objects_mm,
            report=self.work.path(REPORT),
            quick=True,
            overwrite=True,
        )
        draft = replace(
            described.draft,
            kernel_px=int(facts["side_px"]),
            blocks=(int(facts["block_px"]), int(facts["overlap_px"])),
        )
        self._write_recipe(recipe_text(draft))
        return facts

    def export_filter(self) -> Facts:
        """Write a bundle without a network."""
        return export_bundle(
            self.recipe, self.work.path(FILTER_BUNDLE), network=False, overwrite=True
        )

    def fit_bank(self) -> Facts:
        """Fit the bank that restores colours together, and write the filter's bundle with it."""
        plan, text = read_recipe(self.recipe), self.recipe.read_text(encoding="utf-8")
        options = BankFitOptions(
            pictures=self.wish.data,
            recipe_folder=self.work.folder,
            output_folder=self.work.folder,
            cache_folder=self.work.folder,
            samples=FIT_SAMPLES,
            steps=FIT_STEPS,
        )
        fit = bank_fitting_kind(plan.kind).fit(plan, options, note)
        self._write_recipe(with_bank(text, fit.together))
        return {"gain_db": round(fit.gain_db, 3), **self.export_filter()}

    def train(self, minutes: float) -> Facts:
        """Train the network for so many CPU-minutes; go on where it was interrupted."""
        is_begun = self.checkpoint.is_file()
        result = train(
            self.recipe,
            self.work.folder,
            size=self.wish.size,
            data=self.wish.data,
            valid=self.wish.valid,
            start=None if is_begun else self.wish.start,
            resume=is_begun,
            max_cpu_minutes=minutes,
            workers=self.wish.workers,
        )
        return result.to_json()

    def export_network(self) -> Facts:
        """Write the bundle with the network."""
        return export_bundle(self.checkpoint, self.work.path(NETWORK_BUNDLE), overwrite=True)

    def ship(self, bundle: str, out: Path) -> None:
        """Copy a bundle of the folder to its place."""
        out.parent.mkdir(parents=True, exist_ok=True)
        with atomic_output(out) as part:
            shutil.copyfile(self.work.path(bundle), part)

    def _write_recipe(self, text: str) -> None:
        with atomic_output(self.recipe) as part:
            part.write_text(text, encoding="utf-8")
