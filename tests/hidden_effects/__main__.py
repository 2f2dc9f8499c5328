"""``python -m hidden_effects``: the campaign, its score, its page and the table in docs/how-well-it-works.md."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from hidden_effects.campaign import results, run
from hidden_effects.page import page
from hidden_effects.plan import plans
from hidden_effects.running import finish
from hidden_effects.score import score
from hidden_effects.table import Part, markdown, with_table
from vjm.io.files import check_writable, write_whole
from vjm_output import terminal

PUBLISHED = 35
"""Seed of the published campaign; sets of others were looked at while the finder was developed."""
SAMPLE, SAMPLE_DESIGNS = 0.03, 6
"""Share of a whole campaign that `--sample` makes, and the designs that it has."""
OK, BAD_INPUT, INTERRUPTED = 0, 2, 130

app = App(name="blind", help="Hide causes in made-up readings, have them diagnosed, and score the verdicts.")


@app.default
def campaign(
    *,
    out: Annotated[Path, Parameter(help="Folder of the campaign; one that was cut off goes on there.")] = Path(
        "reports/runs/blind"
    ),
    jobs: Annotated[int, Parameter(help="Processes.")] = 2,
    sample: Annotated[bool, Parameter(negative="", help="A few sets of every group only.")] = False,
    share: Annotated[float, Parameter(help="Share of a whole campaign's sets, of every group alike.")] = 1.0,
    seed: Annotated[int, Parameter(help="Of the campaign; another one has other designs and sets.")] = PUBLISHED,
    only_make: Annotated[bool, Parameter(negative="", help="Make the sets and diagnose none.")] = False,
    only_score: Annotated[bool, Parameter(negative="", help="Score what is finished and go no further.")] = False,
    renew: Annotated[Path | None, Parameter(help="Page whose table is renewed.")] = None,
) -> int:
    """Make the sets, diagnose them, write score.json, blind.html and blind.md; go on where it was cut off."""
    if jobs < 1 or seed < 0:
        raise ValueError("--jobs must be 1 or more and --seed 0 or more")
    if not 0.0 < share <= 1.0:
        raise ValueError("--share must be above 0 and at most 1")
    check_writable(out)
    share = SAMPLE if sample else share
    todo = plans(share, seed, SAMPLE_DESIGNS) if sample else plans(share, seed)
    if not only_score:
        try:
            with terminal.progress() as progress:
                run(todo, out, jobs=jobs, diagnose=not only_make, progress=lambda n, of: progress("sets", n, of))
        except KeyboardInterrupt:
            terminal.error(
                f"interrupted; what is finished is in {out} and is not done again; --only-score scores it"
            )
            return INTERRUPTED
    if only_make:
        return OK
    done = results(todo, out)
    if not done:
        raise ValueError(f"{out}: no set is finished: run without --only-score")
    part = Part(share, len(done), len(todo))
    held, development = score(done, held_out=True), score(done, held_out=False)
    document = {
        "seed": seed,
        "share": share,
        "finished": len(done),
        "of": len(todo),
        "finders": sorted({str(r["found"].get("finder")) for r in done if "found" in r}),
        "held_out": held,
        "development": development,
    }
    write_whole(out / "score.json", json.dumps(document, indent=1))
    write_whole(out / "blind.html", page(held, development))
    write_whole(out / "blind.md", markdown(held, part))
    if renew is not None:
        write_whole(renew, with_table(renew.read_text(encoding="utf-8"), held, part))
    console = terminal.console()
    console.print(markdown(held, part), soft_wrap=True, markup=False)
    console.print(f"page: {out / 'blind.html'}", soft_wrap=True)
    return OK


def main() -> None:
    """Run and exit; errors are one line."""
    finish(app)


if __name__ == "__main__":
    main()
