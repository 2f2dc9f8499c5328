"""What a diagnosis or a calibration found, as an object; the commands write it to files."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

from pydantic import BaseModel

from vjm.io.files import write_together
from vjm.io.provenance import Provenance
from vjm.outcome import Outcome
from vjm_output.documents import as_json
from vjm_output.optional_drawing import page_of, why_no_page
from vjm_updating.calibration.document import Calibration, ParameterRow, fit_report
from vjm_updating.diagnosis.document import Diagnosis
from vjm_updating.diagnosis.summary_text import lines as lines_of_ramps
from vjm_updating.inference.significance import NORMAL_95
from vjm_updating.poses.document import MemberRow, PoseCalibration, PoseDiagnosis
from vjm_updating.poses.document import lines as lines_of_poses

if TYPE_CHECKING:
    from vjm.outcome import Axes

F = TypeVar("F", bound=BaseModel)
D = TypeVar("D", Diagnosis, PoseDiagnosis)
C = TypeVar("C", Calibration, PoseCalibration)
EXTENDED, CALIBRATED = "extended-model.toml", "calibrated-model.toml"
"""Names of the model files."""


@dataclass(frozen=True, eq=False, repr=False)
class Result(Outcome, Generic[F]):
    """What was found in data.

    Attributes:
        figures: every figure, as the JSON document has it.
        models: text of each model file by its name; empty where the model is not for use.
        draw: makes the page of a document; None where there is none.
    """

    NAME: ClassVar[str]

    figures: F
    models: Mapping[str, str]
    draw: Callable[[F], str] | None = None

    @abstractmethod
    def lines(self) -> list[str]:
        """What a person wants to know first, line by line."""

    @abstractmethod
    def rows(self) -> list[dict[str, Any]]:
        """A table of the main figures."""

    def stamped(self, made_of: Provenance) -> Self:
        """With what it was made of in its document."""
        return replace(self, figures=self.figures.model_copy(update={"made_of": dict(made_of.inputs)}))

    def document(self) -> dict[str, Any]:
        """The JSON document, of lists, texts and numbers."""
        return self.figures.model_dump(mode="json")

    def page(self) -> str:
        """The page as HTML that needs nothing else.

        Raises:
            ImportError: the extra ``report`` is not installed.
            ValueError: this kind of result has no page.
        """
        if self.draw is None:
            raise ValueError(f"a {self.NAME} of a test of this kind has no page: see its document")
        if why := why_no_page():
            raise ImportError(f"no page: {why}")
        return self.draw(self.figures)

    def write(self, out: Path | str) -> None:
        """Write document, model files and page into a folder: all at the end or none.

        What an earlier run left there under the name of a file that this one does not write is removed.

        Raises:
            OSError: the folder cannot be written to.
        """
        folder = Path(out)
        files: dict[Path, str] = {folder / f"{self.NAME}.json": as_json(self.figures)}
        files |= {folder / name: text for name, text in self.models.items() if text}
        page = folder / f"{self.NAME}.html"
        write_together(files | (page_of(page, self.page) if self.draw else {}))
        texts = {**self.models, page.name: "" if self.draw is None else "drawn"}
        for name, text in texts.items():
            if not text:
                (folder / name).unlink(missing_ok=True)

    def table(self) -> list[dict[str, Any]]:
        """As `rows`."""
        return self.rows()

    def to_dict(self) -> dict[str, Any]:
        """As `document`."""
        return self.document()

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        from vjm.outcome import table_html

        rows = self.rows()
        return f"<pre>{escape(repr(self))}</pre>{table_html(rows) if rows else ''}"


@dataclass(frozen=True, eq=False, repr=False)
class DiagnosisResult(Result[D]):
    """What a diagnosis found; see `vjm_updating.diagnose`.

    Example:
        >>> from importlib.resources import files
        >>> from vjm_updating import diagnose, load_data
        >>> folder = files("vjm_validation") / "examples/fanuc-deflections"
        >>> data = load_data(folder / "readings.csv", folder / "sheet.toml")
        >>> [row["cause"] for row in diagnose(data, only=("actuator_compliance",)).rows()]
        ['actuator_compliance']
    """

    NAME: ClassVar[str] = "diagnosis"

    def lines(self) -> list[str]:
        """Verdict, causes with their parameters, the residual, and what to measure next."""
        document = self.figures
        return lines_of_poses(document) if isinstance(document, PoseDiagnosis) else lines_of_ramps(document)

    def rows(self) -> list[dict[str, Any]]:
        """One row a cause: what is said of it, the probability that it acts, its share of what the model misses."""
        return [
            {
                "cause": row.cause,
                "said": str(row.word),
                "probability": row.probability,
                "share": row.share,
                "places": ", ".join(place.place for place in row.places),
            }
            for row in self.figures.findings.causes
        ]

    def plot(self, ax: Axes | None = None) -> Axes:
        """A bar for each cause, as long as the probability that it acts.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.outcome import axes_or_new

        ax = axes_or_new(ax)
        from vjm_updating.diagnosis.figures import bars

        bars(ax, self.figures.findings)
        return ax


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationResult(Result[C]):
    """What a calibration found; see `vjm_updating.calibrate`.

    Example:
        >>> from importlib.resources import files
        >>> from vjm_updating import calibrate, load_data
        >>> folder = files("vjm_validation") / "examples/soft-springs"
        >>> calibration = calibrate(load_data(folder / "readings.csv", folder / "sheet.toml"))
        >>> [f"{row['name']} {row['value']:.2f}" for row in calibration.rows()]
        ['foot.factor 1.10', 'link.factor 1.20']
    """

    NAME: ClassVar[str] = "calibration"

    def lines(self) -> list[str]:
        """How well it fits, the parameters with their uncertainty, predictions, and what to measure next."""
        document = self.figures
        return (
            lines_of_poses(document) if isinstance(document, PoseCalibration) else fit_report(document).splitlines()
        )

    def rows(self) -> list[dict[str, Any]]:
        """One row a parameter: name, unit, value, standard deviation and 95 % interval."""
        return [
            {
                "name": row.name,
                "unit": row.unit,
                "value": row.value,
                "std": row.std,
                "low": row.interval95[0],
                "high": row.interval95[1],
            }
            for row in self._parameters()
        ]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Every parameter with its 95 % interval, over its standard deviations from zero or from the model's value.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from vjm.outcome import axes_or_new

        ax = axes_or_new(ax)
        rows = self._parameters()
        over = [(r.value - getattr(r, "nominal", 0.0)) / r.std if r.std > 0.0 else 0.0 for r in rows]
        ax.barh([r.name for r in rows], over)
        for end in (-NORMAL_95, NORMAL_95):
            ax.axvline(end, color="k", linewidth=0.7, linestyle=":")
        ax.invert_yaxis()
        ax.set_xlabel("difference from the model, standard deviations")
        return ax

    def _parameters(self) -> Sequence[ParameterRow | MemberRow]:
        document = self.figures
        if isinstance(document, PoseCalibration):
            return [row for family in document.families for row in family.members]
        return document.parameters
