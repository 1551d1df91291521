"""The final values of a campaign, from its raw files alone: at its end, and when it is asked."""

import hashlib
import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import cosmic.autonomy.bending
from cosmic.autonomy.bending.fit import (
    Certificate,
    MeasuredFibre,
    assess_campaign,
    half_width_percent,
    in_time,
    measure_fibre,
)
from cosmic.autonomy.bending.result import BendingError, BendingResult
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.standards import ForceScale, StandardReading
from cosmic.autonomy.campaign.provenance import changed_files, changed_records
from cosmic.autonomy.campaign.records import (
    FIBRE,
    STANDARD,
    CampaignError,
    FibreRecord,
    Outcome,
)
from cosmic.autonomy.campaign.storage_format import (
    DATABASE,
    FIBRES,
    FINAL,
    Cell,
    RawFibre,
    fitted_file,
    raw_file,
    read_raw,
    result_row,
    span_row,
)
from cosmic.autonomy.campaign.store import CampaignStore, write_whole
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.handling.push import certificate_of
from cosmic.autonomy.handling.settings import StandardSettings
from cosmic.frame.config import check_model
from cosmic.frame.errors import ConfigError
from cosmic.frame.version import __version__

FITTED_SHA256: Final = "fitted_sha256"
"""Under which name the record has the SHA-256 of the file of fitted curves."""
SAME: Final = 1e-6
"""Of a value: what differs by less is the same number, rounded otherwise."""

ROUNDING: Final = 1e-9
"""Of what may be nothing: the same."""

BESIDE: Final = (
    "clamp_offset_um",
    "clamp_offset_std_um",
    "chi2",
    "freedom",
    "flags",
    "reasons",
    "used_spans",
    "budget_json",
    "scale_verified",
    "notes",
)
"""Cells of a result beside its value and interval."""


@dataclass(frozen=True, slots=True)
class AnalysisSettings:
    """What an analysis is told of instrument and standard."""

    fit: FitSettings
    standard: StandardSettings


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """A campaign as it was analysed.

    Attributes
    ----------
    results : mapping of int to BendingResult
        By the number of the fibre, or of the measurement of the standard.
    scale : ForceScale
        How the scale of the force is known.
    settings : AnalysisSettings
    versions : mapping
        By which program.
    recorded : frozenset of int
        Fibres and standards that had their end when it was begun.
    """

    results: Mapping[int, BendingResult]
    scale: ForceScale
    friction: float
    settings: AnalysisSettings
    versions: Mapping[str, str]
    recorded: frozenset[int] = frozenset()

    def as_json(self) -> dict[str, Any]:
        """Return what goes into the record beside the results."""
        return {
            "made": datetime.now().astimezone().isoformat(timespec="seconds"),
            "versions": dict(self.versions),
            "fit": self.settings.fit.model_dump(),
            "standard": self.settings.standard.model_dump(mode="json"),
            "scale": _finite(asdict(self.scale)),
            "friction": self.friction,
        }


@cache
def analysis_version() -> Mapping[str, str]:
    """Return by what values are made: CoSMic, the source of its analysis, and what that uses."""
    digest = hashlib.sha256()
    for folder in cosmic.autonomy.bending.__path__:
        for file in sorted(Path(folder).glob("*.py")):
            digest.update(file.read_bytes())
    return {
        "CoSMic": __version__,
        "analysis": digest.hexdigest()[:16],
        "numpy": metadata.version("numpy"),
        "scipy": metadata.version("scipy"),
    }


def settings_of(reader: CampaignReader) -> AnalysisSettings:
    """Return what the campaign was analysed with; what its recipe says, before it ever was.

    Defaults of that time count, not those of today.

    Raises
    ------
    CampaignError
        This program does not know a setting that was used.
    """
    kept = reader.analysis()
    if not kept:
        return settings_in(reader.info().recipe_text)
    return _checked(kept["fit"], kept["standard"], str(reader.folder))


def settings_in(recipe_text: str, name: str = "the recipe") -> AnalysisSettings:
    """Return what a recipe says of instrument and standard.

    Raises
    ------
    CampaignError
        It is no recipe, or one that this program does not understand.
    """
    try:
        parameters = tomllib.loads(recipe_text).get("parameters", {})
    except tomllib.TOMLDecodeError as exc:
        raise CampaignError(f"{name} cannot be read: {exc}") from exc
    fit = parameters.get("push", {}).get("fit", {})
    return _checked(fit, parameters.get("standard", {}), name)


def _checked(fit: Mapping[str, Any], standard: Mapping[str, Any], name: str) -> AnalysisSettings:
    try:
        return AnalysisSettings(
            check_model(name, dict(fit), FitSettings, under="push.fit"),
            check_model(name, dict(standard), StandardSettings, under="standard"),
        )
    except ConfigError as exc:
        raise CampaignError(f"this program cannot analyse with these settings: {exc}") from exc


def analyse(
    reader: CampaignReader, settings: AnalysisSettings | None = None, *, check: bool = True
) -> Analysis:
    """Return final values of a campaign, from its raw files alone.

    Parameters
    ----------
    settings : AnalysisSettings, optional
        Those that the campaign was analysed with, if None.
    check : bool
        Refuse raw files that are not as they were written.

    Raises
    ------
    CampaignError
        A raw file is missing, was changed or cannot be analysed, or the settings are not
        understood.
    """
    settings = settings or settings_of(reader)
    recorded = frozenset(_records(reader))  # before raw files: more may come while it runs
    raw = [each for each in _raw(reader, check=check) if each.assessed and each.spans]
    standard = certificate_of(settings.standard) if settings.standard.ei_n_m2 > 0.0 else None
    raw = [each for each in raw if each.role != STANDARD or standard is not None]
    measured = in_time(
        [
            _measured(reader, each, settings, standard if each.role == STANDARD else None)
            for each in raw
        ],
        [each.elapsed_s for each in raw],
    )
    pairs = list(zip(raw, measured, strict=True))
    fibres = [pair for pair in pairs if pair[0].role != STANDARD]
    standards = [pair for pair in pairs if pair[0].role == STANDARD]
    found = assess_campaign(
        [each for _, each in fibres],
        standards=[each for _, each in standards],
        settings=settings.fit,
    )
    numbers = [each.number for each, _ in (*fibres, *standards)]
    results = dict(zip(numbers, (*found.fibres, *found.standards), strict=True))
    return Analysis(results, found.scale, found.friction, settings, analysis_version(), recorded)


def _records(reader: CampaignReader) -> dict[int, FibreRecord]:
    """Return fibres and standards that have their end, by number."""
    return {each.number: each for each in (*reader.finished(), *reader.fibres(STANDARD))}


def _measured(
    reader: CampaignReader,
    raw: RawFibre,
    settings: AnalysisSettings,
    certificate: Certificate | None,
) -> MeasuredFibre:
    """Return what the spans of one fibre show; raises `CampaignError` with its file's name."""
    width = {"fibre_width_um": _width_um(raw, settings)}
    try:
        return measure_fibre(
            raw.spans, settings=settings.fit.model_copy(update=width), certificate=certificate
        )
    except BendingError as exc:
        file = reader.folder / raw_file(raw.number)
        raise CampaignError(f"{file} cannot be analysed: {exc}") from exc


def _width_um(raw: RawFibre, settings: AnalysisSettings) -> float:
    return settings.standard.width_um if raw.role == STANDARD else raw.width_um


def _raw(reader: CampaignReader, *, check: bool) -> list[RawFibre]:
    found = []
    for number, (path, sha256) in reader.raw_files().items():
        if check and sha256:
            try:
                now = hashlib.sha256(path.read_bytes()).hexdigest()
            except OSError as exc:
                raise CampaignError(f"{path} cannot be read: {exc.strerror or exc}") from exc
            if now != sha256:
                raise CampaignError(f"{path} is not as it was written: its SHA-256 differs")
        raw = read_raw(path)
        if raw.number != number:
            raise CampaignError(
                f"{path} is that of fibre {raw.number}, and the record has it for fibre {number}"
            )
        found.append(raw)
    return found


def finish(store: CampaignStore, settings: AnalysisSettings | None = None) -> Analysis | None:
    """Put the final values of a campaign into its record; None where nothing was measured.

    Raises
    ------
    CampaignError
        A raw file is missing or was changed, or the record cannot be written.
    """
    reader = store.reader
    analysis = analyse(reader, settings or settings_in(reader.info().recipe_text))
    if not analysis.results:
        return None
    fitted = {
        number: [each.fitted_un for each in result.spans]
        for number, result in analysis.results.items()
    }
    content = fitted_file(fitted)
    write_whole(store.folder / FINAL, content)
    kept = analysis.as_json() | {FITTED_SHA256: hashlib.sha256(content).hexdigest()}
    store.keep_analysis(analysis.results, kept)
    return analysis


def scale_in(kept: Mapping[str, Any]) -> ForceScale | None:
    """Return how the scale of the force is known by the analysis that is in a record.

    Raises
    ------
    CampaignError
        It is not understood.
    """
    if not kept:
        return None
    scale = dict(kept["scale"])
    try:
        readings = tuple(
            StandardReading(**{key: _number(value) for key, value in each.items()})
            for each in scale.pop("standards")
        )
        reasons = tuple(scale.pop("reasons"))
        return ForceScale(**scale, standards=readings, reasons=reasons)
    except (AttributeError, KeyError, TypeError) as exc:
        raise CampaignError(f"what the record says of the scale is not understood: {exc}") from exc


def _finite(value: object) -> object:
    """Return the same without nan, which JSON does not know."""
    if isinstance(value, Mapping):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _number(value: object) -> Any:
    return math.nan if value is None else value


@dataclass(frozen=True, slots=True)
class Change:
    """What an analysis makes otherwise of a fibre than its record has it.

    Attributes
    ----------
    half_before_percent, half_now_percent : float
        Half of the 95 % interval, of the value.
    """

    number: int
    before_n_m2: float
    now_n_m2: float
    trusted_before: bool
    trusted_now: bool
    half_before_percent: float = math.nan
    half_now_percent: float = math.nan

    @property
    def percent(self) -> float:
        """By how much the value changed."""
        return 100.0 * (self.now_n_m2 / self.before_n_m2 - 1.0)


@dataclass(frozen=True, slots=True)
class Comparison:
    """An analysis beside the record.

    Attributes
    ----------
    compared : int
        Values that were compared.
    changed : tuple of Change
        Those whose value, interval or trust differs.
    versions : tuple of str
        What of the program is another one than then, in words.
    scale_percent : float
        By how much the sensor's scale is taken to be another one.
    missing : tuple of int
        Fibres with a value in the record and none in the raw files.
    differences : tuple of str
        What else in the record is not what the raw files give, in words: scale of the force,
        budgets, spans and the like. Only what the same program made can be compared so closely.
    standards_left_out : int
        Measurements of a standard that are not analysed, as the settings name no standard.
    """

    compared: int
    changed: tuple[Change, ...]
    versions: tuple[str, ...]
    scale_percent: float
    missing: tuple[int, ...] = ()
    differences: tuple[str, ...] = ()
    standards_left_out: int = 0

    @property
    def same(self) -> bool:
        """Whether the record says what its raw files do."""
        return not (self.changed or self.missing or self.differences)


def compare(reader: CampaignReader, analysis: Analysis) -> Comparison:
    """Return what an analysis changes of what stands in the record."""
    kept = reader.analysis()
    versions = _versions(kept, analysis) if kept else ()
    scale = scale_in(kept)
    off = 0.0 if scale is None else scale.off_part
    records = _records(reader)
    pairs = [(records[number], result) for number, result in analysis.results.items()]
    changed = tuple(
        change for record, result in pairs if (change := _change(record, result)) is not None
    )
    left_out = analysis.settings.standard.ei_n_m2 <= 0.0  # then none is analysed
    missing = tuple(
        number
        for number, record in records.items()
        if record.bending is not None
        and number in analysis.recorded
        and number not in analysis.results
        and not (left_out and record.role == STANDARD)
    )
    percent = 100.0 * (analysis.scale.off_part - off)
    differences: tuple[str, ...] = ()
    if kept and not versions:
        differences = tuple(_differences(pairs, changed, scale, analysis.scale))
    standards = [each for each in records.values() if each.role == STANDARD and each.bending]
    return Comparison(
        len(pairs),
        changed,
        versions,
        percent,
        missing,
        differences,
        standards_left_out=len(standards) if left_out else 0,
    )


def _versions(kept: Mapping[str, Any], analysis: Analysis) -> tuple[str, ...]:
    before = kept.get("versions", {})
    return tuple(
        f"{name} {before.get(name, 'unknown')} then, {now} now"
        for name, now in analysis.versions.items()
        if before.get(name) != now
    )


def _differences(
    pairs: Sequence[tuple[FibreRecord, BendingResult]],
    changed: Sequence[Change],
    scale: ForceScale | None,
    now: ForceScale,
) -> Iterator[str]:
    """Yield what beside values and intervals differs, in words."""
    if scale is None or not _alike(asdict(scale), asdict(now)):
        yield "the scale of the force"
    named = {each.number for each in changed}
    for record, result in pairs:
        if record.number in named or record.bending is None:
            continue
        before, after = result_row(record.bending), result_row(result)
        wrong = [name for name in BESIDE if not _alike(_parsed(before[name]), _parsed(after[name]))]
        spans = zip(record.bending.spans, result.spans, strict=False)
        if len(record.bending.spans) != len(result.spans) or not all(
            _alike(span_row(one), span_row(other)) for one, other in spans
        ):
            wrong.append("spans")
        if wrong:
            yield f"fibre {record.number}: {', '.join(map(_in_words, wrong))}"


def _parsed(value: Cell) -> object:
    return json.loads(value) if isinstance(value, str) and value.startswith("[") else value


def _in_words(name: str) -> str:
    return name.removesuffix("_json").removesuffix("_um").replace("_", " ")


def _alike(one: object, other: object) -> bool:
    """Return whether two values, or trees of them, are the same but for rounding."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return _same(one, other) or abs(one - other) < ROUNDING
    return one == other


def altered_files(reader: CampaignReader) -> tuple[str, ...]:
    """Return what of a folder, beside raw curves, is not as it was written, in words.

    These are images, fitted curves, what each run was made with, copies of the files of that, raw
    files that belong to no fibre of the record, and parts of the database that another program
    has changed.

    Raises
    ------
    CampaignError
        The campaign cannot be read.
    """
    known = {path for path, _ in reader.raw_files().values()}
    known |= {reader.folder / file for file in reader.unfinished_files()}
    strangers = [
        f"{path.relative_to(reader.folder).as_posix()} belongs to no fibre of the record"
        for path in sorted((reader.folder / FIBRES).glob("*.h5"))
        if path not in known
    ]
    written = dict(reader.image_files())
    if sha256 := reader.analysis().get(FITTED_SHA256):  # older records do not have it
        written[FINAL] = str(sha256)
    altered = [
        f"{file}: {'is missing' if not path.exists() else 'its SHA-256 differs'}"
        for file, sha256 in written.items()
        if _digest(path := reader.folder / file) != sha256
    ]
    copies = [f"{each}: its copy differs or is missing" for each in changed_files(reader.folder)]
    records = changed_records(reader.folder, reader.run_records())
    parts = [f"{DATABASE}: {each} was changed since" for each in reader.changed_parts()]
    return (*parts, *strangers, *altered, *records, *copies)


def _digest(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


def _change(record: FibreRecord, now: BendingResult) -> Change | None:
    before = record.bending
    if before is None:
        return Change(
            record.number,
            math.nan,
            now.ei_n_m2,
            trusted_before=False,
            trusted_now=now.trusted,
            half_now_percent=half_width_percent(now),
        )
    pairs = (
        (before.ei_n_m2, now.ei_n_m2),
        (before.ei_low_n_m2, now.ei_low_n_m2),
        (before.ei_high_n_m2, now.ei_high_n_m2),
    )
    said = record.outcome is Outcome.GOOD if record.role == FIBRE else before.trusted
    same = all(_same(*pair) for pair in pairs) and before.trusted == now.trusted
    if same and not (said and not now.trusted):
        return None
    return Change(
        record.number,
        before.ei_n_m2,
        now.ei_n_m2,
        trusted_before=before.trusted or said,
        trusted_now=now.trusted,
        half_before_percent=half_width_percent(before),
        half_now_percent=half_width_percent(now),
    )


def _same(one: float, other: float) -> bool:
    if math.isnan(one) or math.isnan(other):
        return math.isnan(one) == math.isnan(other)
    return math.isclose(one, other, rel_tol=SAME)
