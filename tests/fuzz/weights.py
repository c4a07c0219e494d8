"""Weights files: checkpoints with damaged archives or contents, and ONNX files."""

import io
import json
import random
import warnings
import zipfile
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz import mutations

DATA = Path(__file__).resolve().parents[1] / "data"


class _Checkpoint(ABC):
    """A PyTorch file whose tensors are damaged before it is written, or its bytes afterwards."""

    def __init__(self, home: Path) -> None:
        self.path = home / "weights.pt"
        self.state = self.make()
        self.small = self.written(self.as_file(dict(list(self.state.items())[:6])))

    @abstractmethod
    def make(self) -> "dict[str, Any]":
        """Return valid tensors by name."""

    @abstractmethod
    def as_file(self, state: Mapping[str, Any]) -> Any:
        """Return the content of a file with these tensors."""

    @abstractmethod
    def read(self) -> None:
        """Read the file with the project's loader."""

    def written(self, content: Any) -> bytes:
        import torch

        buffer = io.BytesIO()
        torch.save(content, buffer)
        return buffer.getvalue()

    def load(self, rng: random.Random, index: int | None) -> None:
        if index is None:
            self.path.write_bytes(self.written(self.as_file(self.state)))
        elif index % 5 == 0:
            self.path.write_bytes(self.written(self.spoilt(rng)))
        elif index % 5 == 1:
            self.path.write_bytes(self.rewritten(rng))
        else:
            self.path.write_bytes(mutations.bytes_of(rng, self.small))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.read()

    def spoilt(self, rng: random.Random) -> Any:
        """Return the file's content with one part replaced."""
        import torch

        state = dict(self.state)
        for _ in range(rng.choice((1, 1, 2))):
            name = rng.choice(list(state))
            tensor = state[name]
            options: list[Any] = [
                *(None, 3, "x", [], tensor.tolist() if tensor.numel() < 50 else 0.5, torch.zeros(()), torch.zeros(0)),
                *(tensor.to(torch.float64), tensor.to(torch.int32), tensor.to(torch.bool), tensor.half()),
                *(tensor[None], tensor.reshape(-1), torch.zeros(tensor.shape, dtype=torch.complex64)),
                *(
                    torch.full_like(tensor, 7),
                    torch.zeros(tensor.shape).to_sparse(),
                    torch.nn.Parameter(tensor.float()),
                ),
            ]
            match rng.randrange(4):
                case 0:
                    del state[name]
                case 1:
                    renamed = rng.choice((*mutations.WORDS, "features", "features.0", "module.", 7, None, (1, 2), 1.5))
                    state[renamed] = state.pop(name)
                case _:
                    state[name] = rng.choice(options)
        content = self.as_file(state)
        if rng.random() < 0.2 and isinstance(content, dict):
            content[rng.choice(list(content))] = mutations.value(rng)
        return content

    def rewritten(self, rng: random.Random) -> bytes:
        """Return the archive with a changed record and correct checksums."""
        buffer = io.BytesIO()
        chosen = rng.randrange(5)
        with zipfile.ZipFile(io.BytesIO(self.small)) as old, zipfile.ZipFile(buffer, "w") as new:
            for number, entry in enumerate(old.infolist()):
                content = old.read(entry)
                name = entry.filename
                if number == chosen or name.endswith("data.pkl"):
                    content = mutations.bytes_of(rng, content)
                if rng.random() < 0.02:
                    name = rng.choice(mutations.WORDS) or "x"
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    new.writestr(name.replace("\0", "0"), content)
        return buffer.getvalue()


class PIRLNavTarget(_Checkpoint):
    """PIRLNav's checkpoints."""

    def make(self) -> dict[str, Any]:
        from tests.models.pirlnav.checkpoints import SMALL, weights

        return weights(SMALL)

    def as_file(self, state: Mapping[str, Any]) -> Any:
        from tests.models.pirlnav.checkpoints import SMALL, configuration

        named = OrderedDict((f"actor_critic.{name}", tensor) for name, tensor in state.items())
        plain = json.loads(json.dumps(configuration(SMALL)))
        return {"state_dict": named, "config": plain, "extra_state": {"step": 3}}

    def spoilt(self, rng: random.Random) -> Any:
        content = super().spoilt(rng)
        if rng.random() < 0.4:
            content["config"] = mutations.tree(rng, content["config"])
        return content

    def read(self) -> None:
        from vsnbench.models.pirlnav.checkpoint import read_checkpoint

        read_checkpoint(self.path)


class ValueTarget(_Checkpoint):
    """VLV's value network."""

    def make(self) -> dict[str, Any]:
        import torch

        shapes = json.loads((DATA / "vlv" / "shapes.json").read_text())
        return {name: torch.ones(shape, dtype=torch.float16) for name, shape in shapes.items()}

    def as_file(self, state: Mapping[str, Any]) -> Any:
        return {"model_state_dict": dict(state), "epoch": 3}

    def read(self) -> None:
        from vsnbench.models.vlv.value.weights import read_value_weights

        read_value_weights(self.path)


class DetectorTarget(_Checkpoint):
    """Mask R-CNN's weights."""

    def make(self) -> dict[str, Any]:
        import torch

        from vsnbench.models.vlv.detectors.coco import CLASSES_91
        from vsnbench.models.vlv.detectors.mask_rcnn_network import MaskRCNN

        with torch.device("meta"):
            shapes = {name: tuple(tensor.shape) for name, tensor in MaskRCNN(len(CLASSES_91)).state_dict().items()}
        # All tensors share one stored number, which keeps the file small; the first check of values refuses it.
        return {name: torch.zeros(shape if np.prod(shape) < 4096 else (1,)) for name, shape in shapes.items()}

    def as_file(self, state: Mapping[str, Any]) -> Any:
        return dict(state)

    def load(self, rng: random.Random, index: int | None) -> None:
        from vsnbench.errors import ModelError

        try:
            super().load(rng, index)
        except ModelError:
            if index is not None:
                raise

    def read(self) -> None:
        from vsnbench.models.vlv.detectors.mask_rcnn import read_mask_rcnn_weights

        read_mask_rcnn_weights(self.path)


class ONNXTarget:
    """Detectors as ONNX files: opened, and asked about one image."""

    def __init__(self, home: Path) -> None:
        from tests.models.vlv.looks import look
        from tests.models.vlv.test_detectors import save_onnx

        self.path = home / "detector.onnx"
        self.good = [
            save_onnx(self.path, names).read_bytes()
            for names in ("", "{0: 'chair', 1: 'bed', 63: 'couch'}", "['chair', 'bed']")
        ]
        self.observation = look()

    def load(self, rng: random.Random, index: int | None) -> None:
        from vsnbench.models.vlv.detectors.onnx_detector import ONNXDetector

        self.path.write_bytes(self.good[0] if index is None else self.spoilt(rng))
        detector = ONNXDetector(self.path, 0.3)
        detector.detect(self.observation)

    def spoilt(self, rng: random.Random) -> bytes:
        import onnx
        from onnx import numpy_helper

        content = rng.choice(self.good)
        if rng.random() < 0.4:
            return mutations.bytes_of(rng, content)
        model = onnx.load_model_from_string(content)
        for node in model.graph.node:
            if node.op_type == "Constant" and rng.random() < 0.4:
                shape = rng.choice(
                    ((), (0,), (1,), (2,), (2, 4), (3, 4), (2, 1, 28, 28), (2, 1, 0, 0), (2, 1, 2000, 2000))
                )
                kind = rng.choice((np.float32, np.int64, np.float64, np.bool_, np.int8))
                if shape[-1:] == (2000,):
                    kind = np.bool_
                array = np.full(shape, rng.choice((0, 1, 63, -5, 300, 2**40, 1e30, np.nan, np.inf)), np.float64)
                with np.errstate(all="ignore"):
                    node.attribute[0].t.CopyFrom(numpy_helper.from_array(array.astype(kind), node.output[0]))
        if rng.random() < 0.3:
            names = (
                "{0: ",
                "[" * 300,
                "{'a': 'chair'}",
                "{1e400: 'chair'}",
                "['chair', []]",
                "3",
                "{0: {1: 2}}",
                "b'x'",
            )
            onnx.helper.set_model_props(model, {"names": rng.choice((*names, *mutations.WORDS)).replace("\0", "")})
        if rng.random() < 0.3:
            del model.graph.value_info[:]
            for info in model.graph.output:
                info.type.tensor_type.ClearField("shape")
        return bytes(model.SerializeToString())


CHECKPOINTS = {"pirlnav": PIRLNavTarget, "vlv value": ValueTarget, "mask r-cnn": DetectorTarget}
ONNX_FILE = ONNXTarget
