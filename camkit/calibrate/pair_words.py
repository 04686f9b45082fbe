"""The use of a lens in two pictures of one plane, as people describe it."""

from collections.abc import Sequence
from dataclasses import dataclass

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.field_types import check_fields
from camkit.runtime.files.in_memory import FilePath


@dataclass(frozen=True, slots=True, kw_only=True)
class PairWords:
    """The use of a lens in two pictures, as people describe it.

    Attributes:
        focus_m: Distance that the lens was focused on, inf for infinity.
        object_m: Distance of the plane, or of each of several.
        f_number: EFL / entrance pupil diameter of the wide picture; None for that of the file.
        stop_radius_mm: Of its stop, in place of an F-number.
        sharp_f_number: Of the sharp picture.
        sharp_stop_radius_mm: Likewise.
        sensor: WIDTHxHEIGHT@PITCHum or a name; None where the pitch is known.
        pitch_um: Pixel pitch of the pictures; None for what the files state.
        distance_from: What distances count from, if known: vertex, sensor or pupil.
        glass: Catalogues (.agf), and `names` or `numbers`; see `read_noted_lens`.
        catalogue: Catalogues of camkit that are asked first, such as schott,hikari.
        configuration: State of a zoom or focusing lens, by name or number; None for the usual one.
    """

    focus_m: float
    object_m: float | Sequence[float]
    f_number: float | None = None
    stop_radius_mm: float | None = None
    sharp_f_number: float | None = None
    sharp_stop_radius_mm: float | None = None
    sensor: str | None = None
    pitch_um: float | None = None
    distance_from: str | None = None
    glass: Sequence[FilePath] = ()
    catalogue: str | None = None
    configuration: str | int | None = None

    @property
    def planes_m(self) -> tuple[float, ...]:
        """Return the distance of every plane."""
        return (self.object_m,) if isinstance(self.object_m, float | int) else tuple(self.object_m)

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.sharp_f_number is None) == (self.sharp_stop_radius_mm is None):
            raise ContractError(
                f"give {option_text('sharp_f_number')} or {option_text('sharp_stop_radius_mm')}: "
                "how far the lens was stopped down for the sharp picture"
            )
