"""Loaders under mutated files, and what they may answer."""

import signal
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import FrameType

from helpers.file_texts import instruments_text, table_text

from fuzz.mutations import mutated
from vjm.io.machine_file import load_model
from vjm.io.model_file import build_chain
from vjm.io.model_plausibility import findings_of
from vjm.io.robot_file import Description, import_robot
from vjm_output.terminal import one_line
from vjm_updating.experiment import read_measurement, read_sheet
from vjm_updating.experiment.plausibility import plausibility
from vjm_updating.identify.matrix_file import read_matrix

PATIENCE = 20
"""Seconds after which a loader hangs."""
SHEET = (
    table_text("test", title="two postures", model="orthoglide-chain")
    + table_text("model", link_segments=2)
    + table_text("postures", A=[0.0, 0.0, 0.0, 0.0])
    + instruments_text(ux_mm=(0.001,))
    + table_text("instrument.fx_N", noise=2.0, scale=0.003)
    + table_text("tolerance", link_length_mm=0.2)
)
DATA = "time_s,posture,ux_mm,fx_N,temperature_C\n" + "".join(
    f"{k},A,{-0.05 * k:.3f},{-165.0 * k:.2f},{21.0 + 0.01 * k:.2f}\n" for k in range(12)
)


ARM = resources.files("vjm_validation").joinpath("examples", "arm", "arm.urdf")


class HangError(Exception):
    """A loader took more than `PATIENCE`."""


@dataclass(frozen=True)
class Subject:
    """A loader and a sound file for it."""

    name: str
    content: bytes
    load: Callable[[Path], object]


def subjects() -> list[Subject]:
    """Every loader with each of its sound files."""
    models = resources.files("vjm").joinpath("models")
    files = [*models.iterdir(), *models.joinpath("manipulators").iterdir()]
    found = [
        Subject(file.name, file.read_bytes(), _judge)
        for file in sorted(files, key=lambda file: file.name)
        if file.name.endswith(".toml")
    ]
    matrices = resources.files("vjm_updating").joinpath("identify", "matrices")
    found += [
        Subject(file.name, file.read_bytes(), read_matrix)
        for file in sorted(matrices.iterdir(), key=lambda file: file.name)
        if file.name.endswith(".txt")
    ]
    found.append(Subject("sheet.toml", SHEET.encode(), read_sheet))
    found.append(Subject("data.csv", DATA.encode(), _measure))
    found.append(Subject("arm.urdf", ARM.read_bytes(), _imported))
    return found


def prepare(folder: Path) -> None:
    """Put the chain files that manipulators name beside them."""
    for file in resources.files("vjm").joinpath("models", "manipulators", "chains").iterdir():
        if file.name.endswith(".toml"):
            (folder / file.name).write_bytes(file.read_bytes())


def _judge(file: Path) -> object:
    """A model, and what is implausible about it."""
    load_model(file)
    return findings_of(file)


def _imported(file: Path) -> object:
    return build_chain(import_robot(Description(file)).document, file.name)


def _measure(data: Path) -> object:
    sheet = data.with_name("sound-sheet.toml")
    sheet.write_text(SHEET, encoding="utf-8")
    return plausibility(read_measurement(data, sheet))


def answer(subject: Subject, seed: int, folder: Path) -> str:
    """What a loader says of a mutated file: empty for a result or one line, else what is wrong with its answer."""
    file = folder / subject.name
    file.write_bytes(mutated(subject.content, seed))
    try:
        with _patience(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            subject.load(file)
    except HangError:
        return f"{subject.name}, seed {seed}: no answer after {PATIENCE} s"
    except (ValueError, OSError) as error:
        said = one_line(error)
        return "" if said and len(said) < 3000 else f"{subject.name}, seed {seed}: {len(said)} characters"
    except BaseException:
        return f"{subject.name}, seed {seed}: {traceback.format_exc()}"
    return ""


@contextmanager
def _patience() -> Iterator[None]:
    def enough(_: int, __: FrameType | None) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, enough)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
