"""Small ONNX models for tests of policies."""

import json
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

HANDS = ("hands", [1, 2, 12])


def write(path: Path, nodes: list, inputs: list, outputs: list, constants=(), **arguments) -> Path:
    """Write a model of nodes; inputs and outputs have names and shapes."""
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in inputs],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs],
        [numpy_helper.from_array(value, name) for name, value in constants],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    if arguments:
        helper.set_model_props(model, {"arguments": json.dumps(arguments)})
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path


def linear(
    path: Path,
    weights: np.ndarray,
    offset: np.ndarray,
    see: tuple[str, list] = HANDS,
    **arguments,
) -> Path:
    """Write a linear policy of one key: action = weights @ seen + offset."""
    return write(
        path,
        [
            helper.make_node("Flatten", [see[0]], ["flat"]),
            helper.make_node("Gemm", ["flat", "w", "b"], ["action"], transB=1),
        ],
        [see],
        [("action", [1, len(weights)])],
        [("w", weights.astype(np.float32)), ("b", offset.astype(np.float32))],
        **arguments,
    )


def endless(path: Path, rounds: int = 1_000_000_000) -> Path:
    """Write a policy that goes round a loop so often."""
    one = helper.make_tensor_value_info("one", TensorProto.FLOAT, [1, 10])
    more = helper.make_tensor_value_info("more", TensorProto.FLOAT, [1, 10])
    body = helper.make_graph(
        [
            helper.make_node("Identity", ["go_in"], ["go_out"]),
            helper.make_node("Cos", ["one"], ["more"]),
        ],
        "round",
        [
            helper.make_tensor_value_info("i", TensorProto.INT64, []),
            helper.make_tensor_value_info("go_in", TensorProto.BOOL, []),
            one,
        ],
        [helper.make_tensor_value_info("go_out", TensorProto.BOOL, []), more],
    )
    return write(
        path,
        [
            helper.make_node("Flatten", ["hands"], ["flat"]),
            helper.make_node("Gemm", ["flat", "w"], ["start"]),
            helper.make_node("Loop", ["rounds", "go", "start"], ["action"], body=body),
        ],
        [HANDS],
        [("action", [1, 10])],
        [
            ("rounds", np.array(rounds)),
            ("go", np.array(True)),
            ("w", np.zeros((24, 10), np.float32)),
        ],
    )
