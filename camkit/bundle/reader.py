"""Opening a bundle: container, manifest, hashes and PSF checked before anything is used.

    find_bundle(name or path) -> open_bundle(path) -> Bundle

Graphs are not looked at here: `camkit.runtime.network.graph.check_graph` does that before a
session is made, since `onnx` belongs to the runtime.
"""

import difflib
import hashlib
import importlib.resources
import importlib.util
import math
import sys
import tomllib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from camkit.bundle.container import (
    MAX_BUNDLE_BYTES,
    Container,
    container_from_bytes,
    read_container,
)
from camkit.bundle.entry import Entry
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.frozen_optics import FrozenOptics, optics_from_bytes
from camkit.bundle.haze_file import haze_from_bytes
from camkit.bundle.manifest import (
    FOCUS_VERSION,
    PROFILE_VERSION,
    Manifest,
    Member,
    read_manifest,
)
from camkit.bundle.optics import (
    HAZE,
    PSF,
    STREAKS,
    FrozenPsfOptics,
    HazyPsfOptics,
    LensProfile,
    StatesEntry,
    StreakEntry,
)
from camkit.bundle.psf_file import psf_from_bytes
from camkit.caller import option_text
from camkit.errors import BundleError, ContractError
from camkit.haze import Haze
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion, RadialIllumination
from camkit.streaks import StreakOptics

SUFFIX: Final = ".camkit"
MANIFEST: Final = "manifest.json"
STRESS_PSF: Final = "stress_psf.safetensors"
STRESS_HAZE: Final = "stress_haze.safetensors"
GOLDEN: Final = "golden.safetensors"
HAZE_GOLDEN: Final = "haze_golden.safetensors"
PRESCRIPTION: Final = "prescription.toml"
PLATE: Final = "plate.toml"
PLATE_HEIGHTS: Final = "plate.safetensors"
CARD: Final = "card.md"
PREVIEW: Final = "preview.png"

BUNDLES: Final = "camkit.bundles"
MORE_BUNDLES: Final = "camkit_bundles"
"""Of the package camkit-bundles; in a checkout all bundles lie in the first."""
CHECKED_AT_ONCE: Final = 2
_MAX_MANIFEST_BYTES: Final = 2**20
_PITCH_RTOL: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bundle:
    """A bundle that passed every check of its container. Immutable; threads may share it.

    Attributes:
        path: Where it was read.
        manifest: What it says about itself.
    """

    path: Path
    manifest: Manifest
    _container: Container = field(repr=False)
    _optics: FrozenOptics | None = field(repr=False)

    @property
    def sha256(self) -> str:
        """Hash of the whole file."""
        return self._container.sha256

    @property
    def psf_sha256(self) -> str | None:
        """Hash of the frozen PSF; None if there is none."""
        member = self.manifest.members.get(PSF)
        return None if member is None else member.sha256

    @property
    def frozen_optics(self) -> FrozenOptics:
        """The optics with all that light does in them.

        Raises:
            BundleError: If this bundle has none (its stages need none).
        """
        if self._optics is None:
            raise BundleError(f"{self.path.name} has no {PSF}")
        return self._optics

    @property
    def psf(self) -> FrozenPsf:
        """The frozen PSF.

        Raises:
            BundleError: If this bundle has none (its stages need none).
        """
        return self.frozen_optics.psf

    @property
    def configurations(self) -> tuple[str, ...]:
        """The names of the states of a zoom or focusing lens; none where it has one state."""
        optics = self.manifest.optics
        return optics.configurations if isinstance(optics, StatesEntry) else ()

    @property
    def configuration(self) -> str:
        """The name of the state whose kernels are in use; empty where the lens has one state."""
        return "" if self._optics is None else self._optics.state

    def freeze_fact(self, name: str) -> int | float | str | None:
        """Return what the report of freezing says, of the state in use; None where nothing."""
        prefix = f"{self.configuration}." if self.configuration else ""
        return self.manifest.freeze.get(prefix + name)

    def with_configuration(self, choice: str | int | None) -> "Bundle":
        """Return the bundle with its lens in one state.

        Args:
            choice: Name, or number from 1; None for the first.

        Raises:
            ContractError: If there is no such state.
        """
        if self.configurations:
            return replace(self, _optics=self.frozen_optics.with_state(choice))
        if choice is not None:
            raise ContractError(
                f"the lens of {self.path.name} has one configuration; leave "
                f"{option_text('configuration')} out"
            )
        return self

    @property
    def distortion(self) -> RadialDistortion:
        """The distortion of the optics.

        Raises:
            BundleError: If they state none.
        """
        optics = self.manifest.optics
        if not isinstance(optics, LensProfile):
            return self.psf.distortion
        if optics.distortion is None:
            raise BundleError(f"{self.path.name} states no distortion")
        return optics.distortion.to_distortion()

    @property
    def illumination(self) -> FrozenPsf | RadialIllumination:
        """The source of the relative illumination.

        Raises:
            BundleError: If they state none.
        """
        optics = self.manifest.optics
        if not isinstance(optics, LensProfile):
            return self.psf
        if optics.illumination is None:
            raise BundleError(f"{self.path.name} states no illumination")
        return optics.illumination.to_illumination()

    @property
    def streaks(self) -> StreakOptics:
        """The streaks that the optics write beside a light.

        Raises:
            BundleError: If they write no streaks.
        """
        if self._optics is None or self._optics.streaks is None:
            raise BundleError(f"{self.path.name} has no {STREAKS}")
        return self._optics.streaks

    @property
    def haze(self) -> Haze:
        """The haze that the optics write far from a light.

        Raises:
            BundleError: If their kernels hold all.
        """
        if self._optics is None or self._optics.haze is None:
            raise BundleError(f"{self.path.name} has no {HAZE}")
        return self._optics.haze

    @property
    def reference_depth_mm(self) -> float:
        """The distance of focus; where the PSF does not reach it, the nearest that it knows."""
        optics = self.manifest.optics
        focus_mm = (optics and optics.object_distance_mm) or math.inf
        if isinstance(optics, LensProfile):
            return focus_mm
        if self.configuration:
            focus_mm = self.frozen_optics.lens_state.object_distance_mm
        depths_mm = self.psf.depths_mm
        return float(min(max(focus_mm, depths_mm[0]), depths_mm[-1]))

    @property
    def stored_bytes(self) -> int:
        """Memory of the file, which is held as it is."""
        return len(self._container.data)

    @property
    def names(self) -> tuple[str, ...]:
        """The members, without the manifest."""
        return tuple(self.manifest.members)

    def member(self, name: str) -> bytes:
        """Return the bytes of one member, whose hash was checked at opening.

        Raises:
            BundleError: If there is no such member.
        """
        return self._container.read(name)

    def network_facts(self, role: str, size: str) -> NetworkFacts:
        """Return the facts about one size of the network of a role.

        Raises:
            BundleError: If the bundle has no such network.
        """
        sizes = self.manifest.networks.get(role, {})
        if size in sizes:
            return sizes[size]
        have = ", ".join(sizes) or "none"
        raise BundleError(
            f"{self.path.name} has no network of size {size!r} for {role}; it has: {have}"
        )

    def network_bytes(self, role: str, size: str, *, fp16: bool = False) -> bytes:
        """Return the ONNX of one size of the network of a role.

        Raises:
            BundleError: If the bundle has no such network, or none in fp16.
        """
        facts = self.network_facts(role, size)
        if not fp16:
            return self.member(facts.member)
        if facts.fp16_member is None:
            raise BundleError(f"{self.path.name}: size {size} has no fp16 network; use fp32")
        return self.member(facts.fp16_member)

    def stress_psf(self) -> FrozenPsf | None:
        """Return the kernels off the design point, None if the bundle has none.

        Raises:
            BundleError: If they are damaged or no PSF.
        """
        if STRESS_PSF not in self.manifest.members:
            return None
        return psf_from_bytes(self.member(STRESS_PSF), what=STRESS_PSF)

    def stress_haze(self) -> Haze | None:
        """Return the haze beside the kernels off the design point, None if the bundle has none.

        Raises:
            BundleError: If it is damaged, no haze, or not of the samples of those kernels.
        """
        if STRESS_HAZE not in self.manifest.members:
            return None
        psf = self.stress_psf()
        assert psf is not None
        haze = haze_from_bytes(self.member(STRESS_HAZE), what=STRESS_HAZE)
        try:
            haze.check_beside(psf)
        except ContractError as error:
            raise BundleError(f"{STRESS_HAZE} is not of {STRESS_PSF}: {error}") from error
        return haze


def open_bundle(path: Path | str, *, max_bytes: int = MAX_BUNDLE_BYTES) -> Bundle:
    """Read a bundle in place and check it; nothing is written to disk.

    Args:
        path: The .camkit file.
        max_bytes: Cap on the file and on what it unpacks to.

    Raises:
        BundleError: For every reason in container.py, manifest.py and psf_file.py; if manifest
            and members disagree in name, size or hash; if a stage lacks its member; if PSF and
            camera disagree in pixel pitch.
    """
    return _check_bundle(read_container(Path(path), max_bytes=max_bytes), Path(path))


def bundle_from_bytes(data: bytes, *, path: Path, max_bytes: int = MAX_BUNDLE_BYTES) -> Bundle:
    """Check a bundle that is in memory; `path` is only its name. See `open_bundle`."""
    return _check_bundle(container_from_bytes(data, what=str(path), max_bytes=max_bytes), path)


def _check_bundle(container: Container, path: Path) -> Bundle:
    manifest = read_container_manifest(container)
    for need in manifest.needs():
        _need_version(manifest, need.version, need.what)
    optics_name: str = getattr(manifest.optics, "member", "")

    def checked(name: str) -> bytes | None:
        data = _checked_member(container, name, manifest.members[name])
        return data if name == optics_name else None  # unpacked once, the others are let go

    # Unpacking and hashing leave Python's lock to others.
    with ThreadPoolExecutor(CHECKED_AT_ONCE) as pool:
        checks = {name: pool.submit(checked, name) for name in manifest.members}
    members = {name: check.result() for name, check in checks.items()}
    optics = _optics_of(container, manifest, members.get(optics_name))
    return Bundle(path=path, manifest=manifest, _container=container, _optics=optics)


def _optics_of(
    container: Container, manifest: Manifest, member: bytes | None
) -> FrozenOptics | None:
    """Read the optics, whose member is unpacked; those of a bundle without any are refused."""
    entry = manifest.optics
    optics_members = {getattr(entry, "member", None), getattr(entry, "haze_member", None)}
    if isinstance(entry, HazyPsfOptics):
        optics_members.add(STRESS_HAZE)
    for name in (PSF, STREAKS, HAZE, STRESS_HAZE):
        if name in manifest.members and name not in optics_members:
            such = "no" if entry is None else "no such"
            raise BundleError(f"the bundle holds {name}, and its manifest states {such} optics")
    if entry is None:
        return None
    channels = len(manifest.sensor.channels)
    if isinstance(entry, LensProfile):
        rows = 0 if entry.distortion is None else len(entry.distortion.coefficients)
        if rows not in (0, channels):
            raise BundleError(
                f"the lens profile has the distortion of {rows} channel(s), the sensor {channels}"
            )
        return None
    data = container.read(entry.member) if member is None else member
    optics = optics_from_bytes(data, what=entry.member, channels=channels)
    if optics.member_name != entry.member:
        raise BundleError(f"{entry.member} holds optics of another type than the manifest states")
    _check_states(optics, entry)
    _check_psf(optics.psf, entry, channels)
    if optics.psf.focus_um is not None:
        what = f"{entry.member} holds kernels of a moved sensor"
        _need_version(manifest, FOCUS_VERSION, what)
    if optics.psf.distortion.even_coefficients is not None:
        what = f"{entry.member} holds even powers of distortion"
        _need_version(manifest, PROFILE_VERSION, what)
    return optics if not isinstance(entry, HazyPsfOptics) else _hazy(container, manifest, optics)


def _check_states(optics: FrozenOptics, entry: Entry) -> None:
    """Refuse other states, or another order, than the manifest states."""
    names = tuple(state.name for state in optics.states)
    listed_names = entry.configurations if isinstance(entry, StatesEntry) else ()
    if names != listed_names:
        ours, theirs = (", ".join(some) or "none" for some in (names, listed_names))
        raise BundleError(
            f"{PSF} holds the configurations {ours}, the manifest says {theirs}; export the bundle "
            "again"
        )


def _hazy(container: Container, manifest: Manifest, optics: FrozenOptics) -> FrozenOptics:
    """Add the haze to optics whose manifest states one."""
    entry = manifest.optics
    assert isinstance(entry, HazyPsfOptics)
    haze = haze_from_bytes(container.read(HAZE), what=HAZE)
    if haze.cell_px != entry.cell_px:
        raise BundleError(
            f"{HAZE} has cells of {haze.cell_px} px, the manifest says {entry.cell_px}"
        )
    try:
        return replace(optics, haze=haze)
    except ContractError as error:
        raise BundleError(f"{HAZE} is refused: {error}") from error


def _need_version(manifest: Manifest, version: tuple[int, int], what: str) -> None:
    """Refuse what the stated format did not know."""
    if manifest.version_pair < version:
        raise BundleError(
            f"{what}, which format {'.'.join(map(str, version))} brought, and the manifest states "
            f"{manifest.format_version}; export the bundle again"
        )


def read_container_manifest(container: Container) -> Manifest:
    """Read the manifest of a container and check it against the names of the members.

    Raises:
        BundleError: If there is no manifest, it is refused, a member is in one of the two only,
            or a stage or network names a member that is not there.
    """
    if MANIFEST not in container.sizes:
        raise BundleError(f"the zip has no {MANIFEST}, so it is not a bundle")
    if container.sizes[MANIFEST] > _MAX_MANIFEST_BYTES:
        raise BundleError(f"{MANIFEST} is larger than {_MAX_MANIFEST_BYTES} bytes; refused")
    manifest = read_manifest(container.read(MANIFEST))
    _check_names(manifest, container.sizes)
    _check_references(manifest)
    return manifest


def _check_names(manifest: Manifest, sizes: Mapping[str, int]) -> None:
    if MANIFEST in manifest.members:
        raise BundleError(f"{MANIFEST} lists itself as a member; a hash cannot hold itself")
    if unlisted := sizes.keys() - manifest.members.keys() - {MANIFEST}:
        raise BundleError(f"members not in the manifest: {', '.join(sorted(unlisted))}; refused")
    if absent := manifest.members.keys() - sizes.keys():
        raise BundleError(
            f"the manifest lists members that are not there: {', '.join(sorted(absent))}"
        )


def _check_references(manifest: Manifest) -> None:
    users, members = {}, manifest.members
    for role, sizes in manifest.networks.items():
        for size, facts in sizes.items():
            users[facts.member] = f"network {size} ({role})"
            if facts.fp16_member is not None:
                users[facts.fp16_member] = f"network {size} ({role}) in fp16"
    if manifest.optics is not None and not isinstance(manifest.optics, LensProfile):
        users[manifest.optics.member] = "the optics"
    if isinstance(manifest.optics, HazyPsfOptics):
        users[manifest.optics.haze_member] = "the haze of the optics"
    if manifest.golden:
        users[GOLDEN] = "the golden cases"
    companions = {PLATE_HEIGHTS: PLATE, STRESS_HAZE: STRESS_PSF}
    users |= {name: f"what {what} holds" for what, name in companions.items() if what in members}
    for name, user in users.items():
        if name not in members:
            raise BundleError(f"{user} needs the member {name}, which the bundle does not have")


def _checked_member(container: Container, name: str, member: Member) -> bytes:
    data = container.read(name)
    if len(data) != member.size:
        raise BundleError(
            f"member {name} has {len(data)} bytes, the manifest says {member.size}; "
            "fetch the bundle again"
        )
    got = hashlib.sha256(data).hexdigest()
    if got != member.sha256:
        raise BundleError(
            f"member {name} has the hash {got[:16]}..., the manifest says "
            f"{member.sha256[:16]}...; fetch the bundle again"
        )
    return data


def _check_psf(
    psf: FrozenPsf,
    entry: FrozenPsfOptics | HazyPsfOptics | StatesEntry | StreakEntry,
    channels: int,
) -> None:
    """Check the PSF against the statements of the manifest."""
    if abs(psf.pixel_pitch_um - entry.pixel_pitch_um) > _PITCH_RTOL * entry.pixel_pitch_um:
        raise BundleError(
            f"{entry.member} is sampled at {psf.pixel_pitch_um} um, the manifest says "
            f"{entry.pixel_pitch_um} um; freeze the PSF at the pitch of the sensor"
        )
    if psf.symmetry != entry.symmetry:
        raise BundleError(
            f"{entry.member} is {psf.symmetry}, the manifest says {entry.symmetry}; export again"
        )
    rows = psf.distortion.coefficients.shape[0]
    if rows != channels:
        raise BundleError(
            f"{entry.member} has the distortion of {rows} channel(s), the sensor {channels}"
        )


def built_in_bundles() -> dict[str, Path]:
    """Return the bundles that come with camkit and with `camkit-bundles`, name -> path."""
    packages = (MORE_BUNDLES, BUNDLES) if importlib.util.find_spec(MORE_BUNDLES) else (BUNDLES,)
    folders = [Path(str(importlib.resources.files(package))) for package in packages]
    paths = {path.stem: path for folder in folders for path in folder.glob(f"*{SUFFIX}")}
    return dict(sorted(paths.items()))


def missing_bundles() -> list[str]:
    """Return the names of the bundles of this version that are not installed."""
    table = importlib.resources.files(BUNDLES) / "bundles.toml"
    listed = tomllib.loads(table.read_text(encoding="utf-8"))
    return sorted(listed.keys() - built_in_bundles().keys())


def install_bundles_text() -> str:
    """Return the command that installs the built-in bundles of this version, whatever is there."""
    # the face imports all that lies above, so that it is named here, not imported
    version = sys.modules["camkit"].__dict__["__version__"]
    return f"pip install camkit-bundles=={version}"


def is_built_in(bundle: Bundle) -> bool:
    """Return whether a bundle lies where those that come with camkit do."""
    path = built_in_bundles().get(bundle.path.stem)
    return path is not None and bundle.path.resolve() == path.resolve()


def find_bundle(name_or_path: str | Path) -> Path:
    """Return the path of a bundle: the name of a built-in one, or a file.

    Raises:
        BundleError: If there is neither; near names are suggested.
    """
    path, text = Path(name_or_path), str(name_or_path)
    bundles = built_in_bundles()
    if text in bundles:
        return bundles[text]
    if path.is_file():
        return path
    if path.suffix == SUFFIX or path.name != text:
        raise BundleError(f"there is no bundle file {text}")
    missing = missing_bundles()
    if text in missing:
        raise BundleError(f"{text} is not installed: {install_bundles_text()}")
    near = difflib.get_close_matches(text, [*bundles, *missing], n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are: {', '.join(bundles)}."
    raise BundleError(
        f"no built-in bundle is called {text!r}; {hint if bundles else 'there is none.'} "
        "A bundle of your own is named by its path, FILE.camkit"
    )
