"""Run a model's own server, out of a checkout of its repository, on a CPU with random weights.

    python run_upstream.py navdp CHECKOUTS --port 8888

CHECKOUTS has one directory per repository (NavDP, diffusion_policy, StreamVLN, InternNav, goat-bench, UniGoal). The
files of the server are copied into the working directory with `cuda:0` replaced by `cpu`, and with the changes that a
lab makes by hand (`change_by_hand`). The function of a server puts something small in the place of networks that are
too large for a CPU and of packages that have no wheel. For `goat` and `unigoal` the working directory has the adapter,
its settings and vsnbench_policy.py.
"""

import argparse
import ctypes
import importlib.util
import re
import runpy
import shutil
import sys
import types
from abc import ABCMeta
from contextlib import suppress
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path

import flask
import numpy as np
import torch

FAR, PER_IMAGE = 30.0, 6.0
"""Distance that GNM, ViNT and NoMaD predict, and how much less for each different image that they remember."""


def module(name, **members):
    """Put a module with these members where an import finds it."""
    made = sys.modules[name] = types.ModuleType(name)
    vars(made).update(members)
    parent, _, child = name.rpartition(".")
    if parent:
        if parent not in sys.modules:
            module(parent)
        setattr(sys.modules[parent], child, made)
    return made


def random_weights():
    """Let networks keep the weights that they are created with, the same in every run."""
    torch.manual_seed(0)
    torch.load = lambda *_, **__: {}
    torch.nn.Module.load_state_dict = lambda self, *_, **__: None


def torchvision_without_cuda():
    """Define the operators of a torchvision whose wheel has them for CUDA only; it cannot be imported without them."""
    place = Path(importlib.util.find_spec("torchvision").submodule_search_locations[0])
    with suppress(OSError):  # that it looks for libcudart
        for file in place.glob("_C*.so"):
            ctypes.CDLL(str(file))
        return None
    library = torch.library.Library("torchvision", "DEF")
    for name in ("nms", "qnms"):
        library.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
    return library


def different(images):
    """Return the number of different images in (1, 3 N, height, width)."""
    return len({image.numpy().tobytes() for image in images[0].split(3)})


def nearer_with_every_image(policy, method):
    """Let a policy predict a distance that falls with the number of different images in its memory."""
    predict = getattr(policy, method)

    def predicted(self, images, goal, *rest):
        distances, other = predict(self, images, goal, *rest)
        return torch.full_like(distances, FAR - PER_IMAGE * different(images)), other

    setattr(policy, method, predicted)


def gnm():
    import gnm_model

    nearer_with_every_image(gnm_model.GNMPolicy, "predict_imagegoal_distance_and_action")


def vint():
    import vint_network

    nearer_with_every_image(vint_network.ViNTPolicy, "predict_imagegoal_distance_and_action")


def nomad():
    import nomad_model

    nearer_with_every_image(nomad_model.NoMaDPolicy, "predict_imagegoal_distance")


def viplanner():
    """Mask2Former of mmdet sees floor everywhere. Python 3.11 refuses a default of upstream's that 3.10 takes."""
    config = Path("configs/learning_config.py")
    config.write_text(
        config.read_text().replace("@dataclass\nclass DataCfg", "@dataclass(unsafe_hash=True)\nclass DataCfg")
    )

    class Segments:
        def __init__(self):
            self.dataset_meta = {"classes": ["floor-wood"]}

    def inference_detector(model, image):
        found = types.SimpleNamespace(sem_seg=torch.zeros((1, *image.shape[:2]), dtype=torch.long))
        return types.SimpleNamespace(pred_panoptic_seg=found)

    module("mmdet.apis", inference_detector=inference_detector, init_detector=lambda *_, **__: Segments())
    module("mmdet.evaluation", INSTANCE_OFFSET=1000)


def ddppo():
    """The network of habitat-baselines, which needs habitat-sim, turns to the point and drives to it."""

    class PointNavResNetPolicy(torch.nn.Module):
        def __init__(self, observation_space, action_space, **_):
            super().__init__()

        def act(self, observations, hidden_states, last_action, mask):
            assert observations["rgb"].shape == (1, 224, 224, 3)
            assert observations["depth"].shape == (1, 224, 224, 1)
            depth_m = observations["depth"]
            print(f"mask {mask.item()}, depth {depth_m.min():.2f} to {depth_m.max():.2f}", flush=True)
            rho, theta = (float(value) for value in observations["pointgoal_with_gps_compass"][0])
            turn = 2 if theta > 0 else 3
            action = 0 if rho < 0.3 else turn if abs(theta) > 0.27 else 1
            return types.SimpleNamespace(actions=torch.tensor([[action]]), rnn_hidden_states=hidden_states)

    made = {"low", "high", "shape", "dtype"}
    box = lambda **arguments: {name: arguments[name] for name in made}  # noqa: E731
    module("gym.spaces", Box=box, Dict=dict, Discrete=int)
    module("habitat", __version__="0.3.3")
    module("habitat_baselines.rl.ddppo.policy", PointNavResNetPolicy=PointNavResNetPolicy)
    module("habitat_baselines.common.tensor_dict", TensorDict=dict)
    module("habitat_baselines.rl.ppo.policy", PolicyActionData=types.SimpleNamespace)
    torch.load = lambda *_, **__: {"state_dict": {}}


class Words:
    """What a language model would say, one text after another; the last again and again."""

    def __init__(self, *texts):
        self.texts, self.number = texts, -1

    def next(self):
        self.number = min(self.number + 1, len(self.texts) - 1)
        return torch.tensor([[self.number]])

    def text(self, ids):
        return self.texts[int(ids.flatten()[-1])]


class Inputs(dict):
    """Inputs of a network, by name and as attributes."""

    __getattr__ = dict.__getitem__

    def to(self, device):
        return self


def change_by_hand(file, *changes):
    """Make the changes in a server that examples/adapters/README.md tells a lab to make."""
    text = Path(file).read_text(encoding="utf-8")
    for before, after in (('instruction = "[^"]*"', 'instruction = data["instruction"]'), *changes):
        text, count = re.subn(before, after, text)
        assert count == 1, before
    Path(file).write_text(text, encoding="utf-8")


def streamvln():
    """The language model, its tokenizer and its eye say four actions for an image; upstream's agent is its own."""
    change_by_hand("streamvln/http_realworld_server.py")
    words = Words("\u2192\u2192\u2191\u2191", "\u2191\u2191\u2191\u2191", "\u2191STOP")

    class Eye:
        def preprocess(self, images, return_tensors):
            pixels = torch.from_numpy(np.array(images)).float().mean((0, 1))
            print("image", images.size, "red, green, blue", *(round(value) for value in pixels.tolist()), flush=True)
            return {"pixel_values": [torch.zeros((3, 8, 8))]}

    class StreamVLNForCausalLM(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.model = types.SimpleNamespace(num_history=None)
            self.warm = False

        @classmethod
        def from_pretrained(cls, *_, **__):
            return cls()

        def get_vision_tower(self):
            return types.SimpleNamespace(image_processor=Eye())

        def reset(self, number):
            pass

        def reset_for_env(self, number):
            words.number = -1

        def generate(self, inputs, images, past_key_values, **_):
            assert images.dtype == torch.bfloat16
            return types.SimpleNamespace(sequences=words.next(), past_key_values=None)

    class Tokenizer:
        additional_special_tokens_ids = (1, 2)
        from_pretrained = classmethod(lambda cls, *_, **__: cls())

        def __call__(self, text):
            return types.SimpleNamespace(input_ids=[3])

        def add_tokens(self, *_, **__):
            pass

        def convert_tokens_to_ids(self, token):
            return 4

        def apply_chat_template(self, talk):
            print("prompt", talk[0]["content"][:200].replace("\n", " "), flush=True)
            return [5]

        def batch_decode(self, ids, skip_special_tokens):
            return [words.text(ids)]

    config = types.SimpleNamespace(from_pretrained=lambda *_, **__: None)
    for name in ("quaternion", "omegaconf", "depth_camera_filtering"):
        module(name, OmegaConf=None, filter_depth=None)
    module("transformers.image_utils", to_numpy_array=None)
    vars(sys.modules["transformers"]).update(AutoTokenizer=Tokenizer, AutoConfig=config, PreTrainedTokenizer=Tokenizer)
    module("model.stream_video_vln", StreamVLNForCausalLM=StreamVLNForCausalLM)
    sys.path.insert(0, str(Path("streamvln").resolve()))


def dualvln():
    """The language model says actions, a point in the image, or to look down; the diffusion head plans straight on."""
    change_by_hand(
        "scripts/realworld/http_internvla_server.py",
        (
            r"    args = parser.parse_args\(\)",
            r'    parser.add_argument("--plan_step_gap", type=int, default=4)\n\g<0>',
        ),
        (r"    agent\.step\(\n(?:        .*\n)+    \)\n", ""),  # a first call that fails in three ways
    )
    words = Words("\u2190\u2190\u2191", "60, 80", "\u2193", "\u2192", "STOP")

    class InternVLAN1ForCausalLM(torch.nn.Module):
        @classmethod
        def from_pretrained(cls, *_, **__):
            return cls()

        def generate(self, **inputs):
            return types.SimpleNamespace(sequences=words.next(), past_key_values=None)

        def generate_latents(self, output_ids, pixel_values, image_grid_thw):
            return torch.zeros((1, 4, 8))

        def generate_traj(self, latent, rgb, depth):
            assert rgb.shape == (1, 2, 224, 224, 3)
            assert depth.shape == (1, 2, 224, 224, 1)
            print(f"depth {depth.min():.2f} to {depth.max():.2f} m", flush=True)
            return torch.tensor([0.2, 0.01, 0.0]).repeat(32, 32, 1)

    class Processor:
        from_pretrained = classmethod(lambda cls, *_, **__: cls())

        def __init__(self):
            self.tokenizer = types.SimpleNamespace(decode=self.decoded)

        def decoded(self, ids, skip_special_tokens):
            return words.texts[words.number]

        def apply_chat_template(self, talk, **_):
            parts = [part for turn in talk for part in turn["content"]]
            return " ".join(part["text"] for part in parts if part["type"] == "text")

        def __call__(self, text, images, return_tensors):
            pixels = torch.from_numpy(np.array(images[-1])).float().mean((0, 1))
            print("images", len(images), images[-1].size, *(round(value) for value in pixels.tolist()), flush=True)
            print("prompt", text[0][:200].replace("\n", " "), flush=True)
            ids = torch.zeros((1, 0), dtype=torch.long)
            return Inputs(input_ids=ids, image_grid_thw=torch.ones((1, 3)), pixel_values=torch.zeros(1))

    module("transformers", AutoProcessor=Processor)
    for name in ("internnav", "internnav.agent", "internnav.model", "internnav.model.utils"):
        module(name).__path__ = [str(Path(name.replace(".", "/")).resolve())]
    module("internnav.model.basemodel.internvla_n1.internvla_n1", InternVLAN1ForCausalLM=InternVLAN1ForCausalLM)


class AnyClass(ABCMeta):
    """A class that has whatever is asked of it."""

    def __getattr__(cls, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return Anything


class Anything(metaclass=AnyClass):
    """A class or decorator of a package that is not there."""

    def __init__(self, *_, **__):
        pass

    def __call__(self, *arguments, **_):
        return arguments[0] if arguments else self

    __getattr__ = AnyClass.__getattr__


class NotThere(MetaPathFinder, Loader):
    """Finds packages that a CPU or Python 3.11 cannot have, with whatever is asked of them."""

    def __init__(self, *names):
        self.names = names

    def find_spec(self, name, path, target=None):
        if any(f"{name}.".startswith(f"{each}.") for each in self.names):
            return ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec):
        return None

    def exec_module(self, module):
        module.__getattr__ = lambda name: AnyClass.__getattr__(Anything, name)


def goat():
    """GOAT-Bench's policy and CLIP's networks are their own; habitat-sim and what needs it are not there."""
    drawing = "habitat.utils.visualizations"
    others = (
        "numba",
        "ifcfg",
        "git",
        "moviepy",
        "lmdb",
        "webdataset",
        "seaborn",
        "trimesh",
        "GPUtil",
        "torch.utils.tensorboard",
        "habitat_baselines.rl.ver",
    )
    sys.meta_path.insert(0, NotThere("habitat_sim", "magnum", "corrade", "timm", "vc_models", drawing, *others))
    registration = importlib.import_module("gym.envs.registration")  # of a gym newer than habitat-lab's
    registration.registry = type("Registry", (dict,), {"env_specs": property(dict)})(registration.registry)
    packaging = importlib.import_module("packaging.version")
    module("pkg_resources", packaging=types.SimpleNamespace(version=packaging))
    for name in ("models", "task", "models.encoders", "obs_transformer", "utils"):
        module(f"goat_bench.{name}").__path__ = [str(Path(f"goat_bench/{name.replace('.', '/')}").resolve())]
    utils = importlib.import_module("habitat.core.utils")  # of habitat-lab 0.3.3; upstream's is 0.2.3
    utils.try_cv2_import = lambda: importlib.import_module("cv2")
    importlib.import_module("habitat_baselines.rl.ppo").Net.recurrent_hidden_size = 512  # asked for by 0.3.3
    clip = importlib.import_module("clip.clip")
    model = importlib.import_module("clip.model")
    sizes = (1024, 224, (3, 4, 6, 3), 64, None, 77, 49408, 512, 8, 12)  # those of RN50
    load = lambda name, device="cpu", **_: (model.CLIP(*sizes).eval(), clip._transform(224))  # noqa: E731
    clip.load = sys.modules["clip"].load = load
    torch.load = lambda *_, **__: {"state_dict": {}}


def unigoal():
    """The networks and the language model say what follows; upstream's program, maps, graphs and planner are its own.

    Mask R-CNN sees a chair in the middle of every image, Grounding DINO and Segment Anything a chair and a table there.
    LightGlue matches the goal's photograph with 120 points, of which upstream needs more than 100.
    """
    config = Path("configs/config_habitat.yaml")
    config.write_text(config.read_text(encoding="utf-8").replace("cuda: true", "cuda: false"), encoding="utf-8")
    absent = ("detectron2", "lightglue", "magnum", "openai", "moviepy", "gym", "GroundingDINO", "segment_anything")
    sys.meta_path.insert(0, NotThere(*absent, "grounded_sam_demo"))

    def middle(height, width):
        """Return the mask and the box of the middle of an image."""
        mask = torch.zeros((height, width))
        mask[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3] = 1.0
        return mask, torch.tensor([width // 3, height // 3, 2 * width // 3, 2 * height // 3])

    class ImageSegmentation:
        def __init__(self, arguments):
            pass

        def get_predictions(self, images, visualize):
            mask, box = middle(*images[0].shape[:2])
            boxes = types.SimpleNamespace(tensor=box[None].float())
            found = types.SimpleNamespace(pred_classes=torch.tensor([56]), pred_masks=mask[None], pred_boxes=boxes)
            return [{"instances": found}], None

    class Network(torch.nn.Module):
        """DISK, LightGlue or Segment Anything."""

        def __init__(self, *_, **__):
            super().__init__()
            self.transform = types.SimpleNamespace(apply_boxes_torch=lambda boxes, shape: boxes)

        def set_image(self, image):
            assert image.dtype == np.uint8
            print("image", image.shape, "red, green, blue", *(round(value) for value in image.mean((0, 1))), flush=True)
            self.size = image.shape[:2]

        def predict_torch(self, boxes, **_):
            masks = torch.zeros((len(boxes), 1, *self.size), dtype=torch.bool)
            for mask, (left, top, right, bottom) in zip(masks, boxes.int().tolist(), strict=True):
                mask[0, top:bottom, left:right] = True
            return masks, torch.full((len(boxes), 1), 0.99), None

    def matched(*_):
        points = {"keypoints": torch.zeros((2048, 2))}
        return points, points, {"matches": torch.zeros((120, 2), dtype=torch.long)}

    def said(model, prompt, image=None):
        """Return what a language model says to upstream's questions."""
        answers = {
            "extract all objects": "[chair, table]",
            "relationships between the above objects": "chair and table: chair is next to table",
            "decompose it": '{"subgraph_1": {"nodes": [{"id": "chair"}, {"id": "table"}], "edges": []}}',
            "Which room": "living room",
            "labels corresponding": "0",
            "probability of A and B appearing together is about": "0.8",
            "single spatial relationship": "next to",
        }
        return next((answer for words, answer in answers.items() if words in prompt), "0.5")

    def box3d_overlap(boxes, others):
        """Return what boxes have in common, for those along the axes."""
        low = torch.maximum(boxes.amin(1)[:, None], others.amin(1)[None])
        high = torch.minimum(boxes.amax(1)[:, None], others.amax(1)[None])
        common, all_of = (high - low).clamp(min=0).prod(-1), lambda each: (each.amax(1) - each.amin(1)).prod(-1)
        return common, common / (all_of(boxes)[:, None] + all_of(others)[None] - common)

    module("pytorch3d.ops", box3d_overlap=box3d_overlap)
    boxes = torch.tensor([[0.5, 0.5, 0.3, 0.3], [0.3, 0.6, 0.2, 0.2]])
    graph = importlib.import_module("src.graph.graph")
    # Python 3.8 ignores the argument `device`; later ones refuse it.
    graph.MapObjectList.__init__ = lambda self, items=(), **_: list.__init__(self, items)
    graph.load_model, graph.SamPredictor = lambda *_, **__: None, Network
    graph.sam_model_registry = {"vit_h": Network}
    graph.get_grounding_output = lambda *_, **__: (boxes.clone(), ["chair", "table"])
    graph.T = types.SimpleNamespace(
        RandomResize=lambda *_, **__: None,
        ToTensor=lambda: None,
        Normalize=lambda *_: None,
        Compose=lambda _: lambda image, target: (image, target),
    )
    agent = importlib.import_module("src.agent.unigoal.agent")
    for module_of in (graph, agent):
        module_of.DISK = module_of.LightGlue = Network
        module_of.match_pair, module_of.numpy_image_to_torch = matched, torch.from_numpy
    importlib.import_module("src.utils.visualization.semantic_prediction").ImageSegmentation = ImageSegmentation
    llm = importlib.import_module("src.utils.llm")
    llm.LLM.__call__ = llm.VLM.__call__ = said


UNIGOAL = ("unigoal_adapter:UniGoal", "--port", "{port}")
GOAT = ("goat_adapter:SenseActNN", "--settings", "goat.json", "--port", "{port}")
"""What has no server of upstream's: vsnbench's serves it, with the adapter in the working directory."""
SERVERS = {
    "unigoal": ("UniGoal", "vsnbench_policy.py", unigoal, UNIGOAL),
    "goat": ("goat-bench", "vsnbench_policy.py", goat, GOAT),
    "streamvln": ("StreamVLN", "streamvln/http_realworld_server.py", streamvln, ("--device", "cpu")),
    "dualvln": ("InternNav", "scripts/realworld/http_internvla_server.py", dualvln, ("--device", "cpu")),
    "navdp": ("NavDP/baselines/navdp", "navdp_server.py", None, ()),
    "gnm": ("NavDP/baselines/gnm", "gnm_server.py", gnm, ("--device", "cpu")),
    "vint": ("NavDP/baselines/vint", "vint_server.py", vint, ("--device", "cpu")),
    "nomad": ("NavDP/baselines/nomad", "nomad_server.py", nomad, ("--device", "cpu")),
    "iplanner": ("NavDP/baselines/iplanner", "iplanner_server.py", None, ()),
    "viplanner": ("NavDP/baselines/viplanner", "viplanner_server.py", viplanner, ()),
    "ddppo": ("NavDP/baselines/ddppo", "pointnav_server.py", ddppo, ("--device", "cpu")),
}
"""Directory of a checkout, script, what is replaced, arguments."""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server", choices=sorted(SERVERS))
    parser.add_argument("checkouts", type=Path)
    parser.add_argument("--port", type=int, default=8888)
    arguments = parser.parse_args()
    directory, script, replace, words = SERVERS[arguments.server]
    shutil.copytree(arguments.checkouts / directory, ".", dirs_exist_ok=True)
    for file in Path().rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        if "cuda:0" in text:
            file.write_text(text.replace("cuda:0", "cpu"), encoding="utf-8")
    sys.path[:0] = [str(Path().resolve()), str(arguments.checkouts / "diffusion_policy")]
    torchvision = torchvision_without_cuda()  # kept as long as the process runs
    random_weights()
    if replace is not None:
        replace()
    run = flask.Flask.run
    flask.Flask.run = lambda app, host, port: run(app, "127.0.0.1", arguments.port)  # not on every interface
    sys.argv = [script, *(word.format(port=arguments.port) for word in words)]
    runpy.run_path(script, run_name="__main__")
    del torchvision


if __name__ == "__main__":
    main()
