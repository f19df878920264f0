"""Arguments about data: what tables call things, frames of known states, resampling."""

from collections.abc import Mapping

from dpgcli.api.arguments import as_texts, check_whole, point
from dpgcli.api.inputs import Place, SceneInput, Texts, by_text, plain
from dpgcli.calibration.choices import MOST_RESAMPLES
from dpgcli.calibration.known import Frame, KnownStates
from dpgcli.errors import Field, UsageError
from dpgcli.files.csv_file import Choice
from dpgcli.files.scene_file.models import DataSpec

ORIGINS = ("as given", "from the data's header", "from the spec")
FORMS = {"column": "NAME=TITLE, such as force_N=Load", "units": "QUANTITY=UNIT, such as force=kN"}


def table_choice(column: Texts, skip: int | None, units: Texts) -> Choice:
    """What of a table is read: our names and quantities with its titles and units.

    >>> table_choice(["force_N=Load"], 4, {"force": "kN"})
    Choice(columns={'force_N': 'Load'}, skip=4, units={'force': 'kN'})
    """
    check_whole(skip=skip)
    return Choice(_by_name("column", column), skip, _by_name("units", units))


def _by_name(field: str, texts: Texts) -> dict[str, str]:
    """Texts by name. Raises UsageError for what is no "name=text"."""
    if isinstance(texts, Mapping):
        return {name: str(plain(text)) for name, text in by_text(field, texts).items()}
    parts = [(text, *map(str.strip, text.partition("="))) for text in as_texts(field, texts)]
    for text, name, _, said in parts:
        if not name or not said:
            raise UsageError(Field(field), f" {text}: expected {FORMS[field]}")
    return {name: said for _, name, _, said in parts}


def frame_of(
    given: SceneInput, known: KnownStates, first_station: Place, tip_offset: Place
) -> tuple[Frame, str]:
    """The frame of known states, and where it is from: options, else the data, else the spec."""
    spec = (given.spec and given.spec.data) or DataSpec()
    said: dict[str, tuple[Place, ...]] = {
        "first_station": (first_station, known.first_station, spec.first_station_mm),
        "tip_offset": (tip_offset, known.tip_offset, spec.tip_offset_mm),
    }
    points, words = [], []
    for field, places in said.items():
        pairs = zip(places, ORIGINS, strict=True)
        found = [(place, origin) for place, origin in pairs if place is not None]
        place, origin = found[0] if found else ((0.0, 0.0), "assumed")
        x, y = point(field, place)
        points.append((x, y))
        words.append(f"{field.replace('_', ' ')} {x:g},{y:g} mm ({origin})")
    return Frame(*points), ", ".join(words)


def check_resampling(bootstrap: int, seed: int) -> None:
    """Raise UsageError for a number of samples, or a seed, that is none; or of too many samples."""
    check_whole(bootstrap=bootstrap, seed=seed)
    for field, value in (("bootstrap", bootstrap), ("seed", seed)):
        if value is None or value < 0:
            raise UsageError(Field(field), f" {value}: expected a whole number from 0 on")
    if bootstrap > MOST_RESAMPLES:
        raise UsageError(Field("bootstrap"), f" {bootstrap}: expected at most {MOST_RESAMPLES:,}")
