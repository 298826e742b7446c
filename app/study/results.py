# pyarrow has no types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportUnknownParameterType=false
"""The results of a study: a Parquet file for each block, and one of all in order.

A part is written under a temporary name and moved into place, so that a folder holds whole parts
only. The plan stands beside them; a folder is gone on with by the same plan and versions alone.
"""

import csv
import json
import shutil
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from app.study.inputs import INPUTS
from app.study.plan import Plan
from app.versions import versions
from organ_geometry import make_folder, write_atomic

UNITS = ("MPa", "N", "mm", "mJ", "ml", "s")
"""Of outputs, whose names end in them."""
KEY = b"bluntdissect"
"""Of the metadata of a results file: JSON with `plan`, `versions` and `seed`."""


def unit_of(name: str) -> str:
    """Return the unit of a column, '' for words."""
    if name in INPUTS:
        return INPUTS[name].unit or ("1" if INPUTS[name].is_number else "")
    if name.endswith("distance_to_break"):
        return "1"
    return next((unit for unit in UNITS if name.endswith(f"_{unit}")), "")


study_versions = partial(versions, "scipy", "pyarrow")
"""Returns the versions of what a study is computed with."""


def packed(
    draw: NDArray[np.int64],
    mix: NDArray[np.int16],
    inputs: Mapping[str, Any],
    outputs: Mapping[str, Any],
    faults: list[str],
) -> bytes:
    """Return a block as a Parquet file; nan, and an index of words below 0, become null."""
    columns: dict[str, pa.Array] = {"draw": pa.array(draw), "mix": pa.array(mix)}
    for name, row in [*inputs.items(), *outputs.items()]:
        if isinstance(row, tuple):
            words, at = row
            indices = pa.array(at.astype(np.int32), mask=at < 0)
            columns[name] = pa.DictionaryArray.from_arrays(indices, pa.array(words, pa.string()))
        else:
            columns[name] = pa.array(row, from_pandas=name in outputs)
    named = pa.array([each or None for each in faults], pa.string())
    columns["fault"] = named.dictionary_encode()
    fields = [
        pa.field(name, column.type, metadata={"unit": unit_of(name)})
        for name, column in columns.items()
    ]
    table = pa.table(list(columns.values()), schema=pa.schema(fields))
    sink = pa.BufferOutputStream()
    with _writer(sink, table.schema) as writer:
        writer.write_table(table)
    return sink.getvalue().to_pybytes()


def _writer(where: Any, schema: pa.Schema) -> pq.ParquetWriter:
    # Numbers hardly ever come twice: a dictionary of them takes twice the time and more room.
    words: Any = [field.name for field in schema if pa.types.is_dictionary(field.type)]
    return pq.ParquetWriter(where, schema, compression="zstd", use_dictionary=words)


@dataclass(frozen=True, slots=True)
class ResultsFolder:
    """A folder of results."""

    path: Path

    @property
    def table(self) -> Path:
        """The file of all results."""
        return self.path / "results.parquet"

    @property
    def _state(self) -> Path:
        return self.path / "study.json"

    def open(self, plan: Plan, files: str) -> None:
        """Make the folder, or make sure that what it holds is of this plan and these versions."""
        make_folder(self.path, f"--output {self.path} cannot be a folder")
        state = {"plan": plan.text, "files": files, "versions": study_versions()}
        try:
            held = json.loads(self._state.read_text("utf-8"))
        except FileNotFoundError:
            if any(self.path.iterdir()):
                raise ValueError(
                    f"{self.path} holds files that are of no study; give a folder of its own"
                ) from None
            write_atomic(self._state, json.dumps(state, indent=1).encode())
            write_atomic(self.path / "plan.toml", plan.text.encode())
            return
        except ValueError:
            raise ValueError(f"{self._state} is damaged; give another folder") from None
        for name, words in (
            ("plan", "another plan"),
            ("files", "other organ or preset files"),
            ("versions", "other versions of the program"),
        ):
            if held.get(name) != state[name]:
                raise ValueError(f"{self.path} holds results of {words}; give another folder")

    def block_file(self, block: int) -> Path:
        """Return the file of a block."""
        return self.path / "parts" / f"{block:07d}.parquet"

    def written(self) -> set[int]:
        """Return the blocks that are written."""
        return {int(each.stem) for each in (self.path / "parts").glob("[0-9]*.parquet")}

    def write(self, block: int, content: bytes) -> None:
        """Write a block."""
        self.block_file(block).parent.mkdir(exist_ok=True)
        write_atomic(self.block_file(block), content)

    @contextmanager
    def joining(self, plan: Plan, blocks: int) -> Generator[Callable[[], None]]:
        """Give what joins the parts that are there in order; all are at the end."""
        about = {"plan": plan.text, "versions": study_versions(), "seed": plan.seed}
        unfinished = self.path / ".results.part"
        left = iter(range(blocks))
        waiting = next(left, None)
        writer: Any = None

        def join() -> None:
            nonlocal waiting, writer
            while waiting is not None and self.block_file(waiting).exists():
                table = pq.read_table(self.block_file(waiting))
                if writer is None:
                    schema = table.schema.with_metadata({KEY: json.dumps(about).encode()})
                    writer = _writer(unfinished, schema)
                writer.write_table(table)
                waiting = next(left, None)

        try:
            yield join
            join()
        finally:
            if writer is not None:
                writer.close()
        unfinished.replace(self.table)
        shutil.rmtree(self.block_file(0).parent)

    def csv(self) -> None:
        """Write the results as CSV, too."""
        beside = self.path / ".results.csv.part"
        with pq.ParquetFile(self.table) as file, beside.open("w", newline="") as out:
            writer = csv.writer(out)
            writer.writerow(file.schema_arrow.names)
            for batch in file.iter_batches():
                writer.writerows(zip(*(column.to_pylist() for column in batch), strict=True))
        beside.replace(self.path / "results.csv")

    def faults(self) -> int:
        """Return the number of rows that have a fault."""
        return sum(batch.num_rows - batch[0].null_count for batch in self.batches(["fault"]))

    def batches(self, columns: list[str]) -> Iterator[pa.RecordBatch]:
        """Give some columns of the results, batch by batch."""
        with pq.ParquetFile(self.table) as file:
            yield from file.iter_batches(columns=columns)

    def about(self) -> dict[str, Any]:
        """Return the plan's text, the versions and the seed of the results."""
        try:
            metadata = pq.read_schema(self.table).metadata or {}
            return json.loads(metadata[KEY])
        except (FileNotFoundError, NotADirectoryError):
            raise ValueError(
                f"{self.path} holds no results; `bluntdissect study plan.toml -o {self.path}` "
                "writes them, and goes on where it was ended"
            ) from None
        except (KeyError, ValueError, pa.ArrowInvalid):
            raise ValueError(f"{self.table} holds no results of a study") from None
