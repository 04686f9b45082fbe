"""A network that acts near lights alone runs there alone, and changes no bit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Highlights, Network
from camkit.runtime.capture import Capture
from camkit.runtime.content import CELL_PX, LIGHT_PX
from camkit.runtime.job.walker import Walk
from camkit.runtime.network.cell_windows import RAMP_PX
from camkit.runtime.plan.decision import FULL, PLAIN, SMALL, Subject, Work
from camkit.runtime.plan.rules.lights import decide, needs_lights
from tests.bundle_factory import tiny_network
from tests.hdr_bundle import hdr_stages, write_hdr_bundle
from tests.job_factory import start
from tests.planes_bundle import facts_of
from tests.streak_factory import blurred, captured, star, street, with_lamps

WIDTH, HEIGHT = 1024, 768
REACH_PX = 40
LAMP = (300, 200)
ROLE = "highlights"
PORTS = (Port(name="rgb", channels=3), Port(name="lit", channels=3))


def _camera(folder: Path, lights_px: int | None) -> Bundle:
    """Write a camera with a network; it does act everywhere, which shows where it ran."""
    data = tiny_network()
    network = Network(role=ROLE, takes=("rgb", "lit"), lights_px=lights_px)
    stages: list = []
    for stage in hdr_stages():
        stages.append(
            stage if stage.takes != ("lit",) else stage.model_copy(update={"takes": ("clean",)})
        )
        if isinstance(stage, Highlights):
            stages.append(network)
    facts = facts_of(data, PORTS, (Port(name="clean", channels=3),))
    return write_hdr_bundle(
        folder,
        f"{lights_px}.camkit",
        size_px=(WIDTH, HEIGHT),
        stages=tuple(stages),
        networks={ROLE: {"M": facts}},
        members={facts.member: data},
    )


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return _camera(tmp_path_factory.mktemp("near"), REACH_PX)


def _capture(lamps: list[tuple[int, int, float, tuple[float, float, float]]]) -> Capture:
    light = blurred(with_lamps(street(HEIGHT, WIDTH), lamps), star())
    samples, _ = captured(light, "RGGB")
    return Capture(
        samples=np.rint(samples[0] * 4095).astype(np.uint16),
        cfa="RGGB",
        black_level=np.zeros((2, 2), np.float32),
        white_level=4095.0,
        white_balance=(1.9, 1.0, 1.5),
        iso=100.0,
    )


@pytest.fixture(scope="module")
def night() -> Capture:
    return _capture([(*LAMP, 3.0, (60.0, 60.0, 60.0))])


def _plane(bundle: Bundle, capture: Capture, name: str) -> FloatArray:
    """Give a plane as the plan of the capture has it."""
    walk = Walk(start(bundle, capture).job)
    return np.concatenate(list(walk.stream(name).bands()), axis=1)


def test_cells_within_reach_of_a_light_get_the_network_and_no_others(
    tmp_path: Path, camera: Bundle, night: Capture
) -> None:
    everywhere = _plane(_camera(tmp_path, None), night, "clean")
    got, lit = (_plane(camera, night, name) for name in ("clean", "lit"))
    near = np.zeros((HEIGHT, WIDTH), np.bool_)
    near[: 2 * CELL_PX, : 2 * CELL_PX] = True  # 44 px above it and 56 px to the right
    inside = np.s_[:, : 2 * CELL_PX - RAMP_PX, : 2 * CELL_PX - RAMP_PX]
    np.testing.assert_array_equal(got[inside], everywhere[inside])
    np.testing.assert_allclose(got[:, ~near], lit[:, ~near], rtol=1e-6)  # to equal noise and back
    assert (everywhere != lit).mean() > 0.9
    assert start(camera, night).record["decisions"][2]["choice"] == "4 of 12 cells"


def test_without_lights_no_network_runs(camera: Bundle) -> None:
    dark = _capture([])
    run = start(camera, dark)
    run.fill()
    assert run.record["stages"]["network"] == {"way": "left out"}
    decision = next(d for d in run.record["decisions"] if d["what"] == "lights")
    assert (decision["choice"], decision["reason"]) == ("no network", "nothing clipped")


def test_windows_and_memory_change_no_bit(camera: Bundle, night: Capture) -> None:
    whole = start(camera, night, threads=1).fill()
    for choices in ({"tile_px": 128}, {"threads": 2}, {"max_mem_bytes": 420_000_000}):
        np.testing.assert_array_equal(start(camera, night, **choices).fill(), whole)


# ------------------------------------------------------------------------ the rule alone


def _subject(bundle: Bundle, night: Capture, lights: NDArray[np.bool_] | None) -> Subject:
    found = start(bundle, night).job.subject
    assert found is not None
    return replace(found, lights=lights)


def _lights(*places: tuple[int, int]) -> NDArray[np.bool_]:
    lights = np.zeros((HEIGHT // LIGHT_PX, WIDTH // LIGHT_PX), np.bool_)
    for place in places:
        lights[place] = True
    return lights


def test_a_light_in_the_middle_of_a_cell_wakes_that_cell(camera: Bundle, night: Capture) -> None:
    work, decision = decide(_subject(camera, night, _lights((12, 20))), Work())
    wanted = np.full((3, 4), PLAIN)
    wanted[1, 2] = FULL
    np.testing.assert_array_equal(work.labels, wanted)
    assert decision is not None
    assert (decision.choice, decision.cost_db) == ("1 of 12 cells", 0.0)


def test_cells_that_were_given_less_keep_that(camera: Bundle, night: Capture) -> None:
    labels = np.full((3, 4), FULL, np.int8)
    labels[1, 2] = SMALL
    given = Work(labels=labels, small="S")
    work, _ = decide(_subject(camera, night, _lights((12, 20), (1, 1))), given)
    wanted = np.full((3, 4), PLAIN)
    wanted[1, 2], wanted[0, 0] = SMALL, FULL
    np.testing.assert_array_equal(work.labels, wanted)


@pytest.mark.parametrize("lights_px", [None, REACH_PX])
def test_it_speaks_for_networks_near_lights_alone(
    tmp_path: Path, night: Capture, lights_px: int | None
) -> None:
    bundle = _camera(tmp_path, lights_px)
    assert needs_lights(bundle) == (lights_px is not None)
    subject = _subject(bundle, night, _lights((12, 20)))
    assert (decide(subject, Work())[1] is None) == (lights_px is None)
    assert decide(subject, Work(networks=False))[1] is None
    assert decide(replace(subject, lights=None), Work())[1] is None
