"""Policies as ONNX files: what they need to see, and what they do, without waiting for them.

A model's inputs are named as what is observed ("hands", "wall" ...), each of one row with the shape
that docs/rl.md gives; its output is one row of an action. Its metadata may have `arguments`, JSON
of the environment's arguments that it was trained with.
"""

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotYetError
from importlib import import_module
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from app.bounded_file import read_bounded
from app.rl.episode import Episode, Observation
from app.rl.task import Task

MOST_BYTES = 100_000_000
KINDS = {"tensor(float)": "float32", "tensor(uint8)": "uint8"}


class Answer:
    """An action that a policy is at work on."""

    def __init__(self, future: Future[NDArray[np.float64]], options: Any) -> None:
        self._future, self._options = future, options

    def action(self, seconds: float) -> NDArray[np.float64] | None:
        """Return the action, (A,), waiting so long at most; None if it is not there yet.

        Parameters
        ----------
        seconds
            Most time to wait.

        Returns
        -------
        ndarray or None
            Numbers from -1 to 1.

        Raises
        ------
        ValueError
            If the model has failed.
        """
        try:
            found = self._future.result(timeout=seconds)
        except NotYetError:
            return None
        except Exception as error:
            raise ValueError(f"the policy has failed: {_first_line(error)}") from None
        if not np.isfinite(found).all():
            raise ValueError("the policy has failed: its action is not finite")
        return np.clip(found, -1.0, 1.0)

    def give_up(self) -> None:
        """Let the model end its work as soon as it can."""
        self._options.terminate = True
        self._future.cancel()


class Policy:
    """A policy in an ONNX file, run by a thread of its own on one core.

    Parameters
    ----------
    file
        The ONNX file.

    Attributes
    ----------
    task
        What it was trained for.

    Raises
    ------
    ValueError
        If the file is no model, or its inputs and outputs are not those of its task.
    """

    def __init__(self, file: Path) -> None:
        content = read_bounded(file, MOST_BYTES, "policy")
        try:
            self._onnx = import_module("onnxruntime")
        except ImportError:
            raise ValueError(
                "policies need onnxruntime: pip install 'bluntdissect[policy]'"
            ) from None
        options = self._onnx.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 4
        try:
            self._model = self._onnx.InferenceSession(
                content, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:
            raise ValueError(f"{file} is no ONNX model: {_first_line(error)}") from None
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="policy")
        written = self._model.get_modelmeta().custom_metadata_map.get("arguments", "{}")
        try:
            arguments = json.loads(written)
            if not isinstance(arguments, dict):
                raise TypeError("they must be an object")
            self.task = Task(**cast(Mapping[str, Any], arguments))
            self.check(Episode(self.task))
        except (TypeError, ValueError) as error:
            raise ValueError(f"{file}: {error}") from None

    def check(self, episode: Episode) -> None:
        """Raise a `ValueError` where an episode shows or takes something else than the model."""
        bounds = episode.bounds
        for each in self._model.get_inputs():
            if each.name not in bounds:
                raise ValueError(
                    f"the policy wants to see {each.name!r}; there are {', '.join(bounds)}"
                )
            low = bounds[each.name][0]
            _compare(f"sees {each.name!r}", each.shape, low.shape)
            if KINDS.get(each.type) != str(low.dtype):
                raise ValueError(
                    f"the policy sees {each.name!r} as {each.type}; here it is {low.dtype}"
                )
        outputs = self._model.get_outputs()
        if len(outputs) != 1 or outputs[0].type != "tensor(float)":
            raise ValueError("the policy must have one output, of 32-bit floats: an action")
        _compare("does actions", outputs[0].shape, (episode.task.size,))

    def ask(self, observed: Observation) -> Answer:
        """Let the model decide on an observation, meanwhile."""
        options = self._onnx.RunOptions()
        given = {each.name: observed[each.name][None].copy() for each in self._model.get_inputs()}
        return Answer(self._pool.submit(self._run, given, options), options)

    def _run(self, given: Mapping[str, NDArray[Any]], options: Any) -> NDArray[np.float64]:
        found = self._model.run(None, given, options)[0]
        return np.asarray(found, dtype=np.float64).reshape(-1)

    def close(self) -> None:
        """End its thread once what it works on is done."""
        self._pool.shutdown(wait=False, cancel_futures=True)


def _compare(what: str, shape: Sequence[object], wanted: tuple[int, ...]) -> None:
    """Raise a `ValueError` where a model's shape is not one row of what is wanted."""
    # Dimensions that are not fixed have a name, or none.
    fits = len(shape) == len(wanted) + 1 and all(
        have == need or not isinstance(have, int)
        for have, need in zip(shape, (1, *wanted), strict=True)
    )
    if not fits:
        have = "x".join(str(each) for each in shape)
        raise ValueError(
            f"the policy {what} of shape {have}; here it is 1x{'x'.join(map(str, wanted))}"
        )


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
