"""`bluntdissect validate`: the theories beside the thesis and ANSYS."""

import json
from pathlib import Path
from typing import Annotated

import typer

from app.command_line.answer import AsJson


def validate(
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Folder for validation.md, predictions.md and their figures (needs the extra "
            "'report').",
        ),
    ] = None,
    experiment: Annotated[
        Path | None,
        typer.Option(help="Predict a published experiment of a TOML file, and nothing else."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print the thesis's tables with our theories beside them, and write the validation pages.

    Examples: bluntdissect validate -o docs, or
    bluntdissect validate --experiment assets/experiments/cystic-duct-force.toml
    """
    if experiment is not None:
        if output is not None:
            raise ValueError("--experiment writes no page: leave out --output")
        _predict(experiment, as_json=as_json)
        return
    from app.validation.bed_checks import bed_checks
    from app.validation.comparison import compared, held_out_errors, hollow_errors, solid_errors
    from app.validation.figures import draw_figures
    from app.validation.network_checks import network_checks
    from app.validation.page import beds_table, errors_table, page, rows_table, solids_table
    from app.validation.predictions import predicted, shipped
    from app.validation.predictions_page import draw_predictions, predictions_page
    from app.validation.thesis_tables import TABLES
    from organ_geometry import make_folder, write_atomic

    if output is not None:
        make_folder(output, f"--output {output} cannot be a folder")
    comparisons = [compared(table) for table in TABLES]
    solids = [solid_errors(table) for table in TABLES]
    beds = [] if output is None else [*bed_checks(), *network_checks()]
    if output is not None:
        draw_figures({each.table.number: each for each in comparisons}, output / "validation")
        text = page(comparisons, solids, held_out_errors(), hollow_errors(), beds)
        write_atomic(output / "validation.md", text.encode())
        predictions = [predicted(each) for each in shipped()]
        draw_predictions(predictions, output / "validation")
        write_atomic(output / "predictions.md", predictions_page(predictions).encode())
    if as_json:
        print(
            json.dumps(
                {
                    "tables": {
                        each.table.number: {
                            column.name: {
                                "max_error_percent": column.max_error,
                                "mean_error_percent": column.mean_error,
                            }
                            for column in each.columns
                        }
                        for each in comparisons
                    },
                    "calculated": {
                        each.table.number: {"max_abs_difference_in": each.calculated_difference}
                        for each in comparisons
                    },
                }
            )
        )
        return
    for each in comparisons:
        print(f"Table {each.table.number}: {each.table.title}; deflections, inch\n")
        print(rows_table(each))
    print("Errors against ANSYS, max / mean %\n")
    print(errors_table(comparisons))
    print("Errors against three-dimensional neo-Hookean solids, %\n")
    print(solids_table(solids))
    if output is not None:
        print("A beam on its bed beside closed forms\n")
        print(beds_table(beds))
        print(f"{output / 'validation.md'}, predictions.md and their figures are written")


def _predict(path: Path, *, as_json: bool) -> None:
    """Predict one experiment."""
    import msgspec

    from app.command_line.answer import answer
    from app.validation.predictions import predicted, read_experiment
    from app.validation.predictions_page import prediction_lines

    found = predicted(read_experiment(path))
    answer(msgspec.to_builtins(found), prediction_lines(found), as_json=as_json)
