"""Run a model's own server, out of a checkout of its repository, on a CPU with random weights.

    python run_upstream.py navdp CHECKOUTS --port 8888

CHECKOUTS has one directory per repository (NavDP, diffusion_policy, StreamVLN, InternNav, goat-bench). The files of the
server are copied into the working directory with `cuda:0` replaced by `cpu`; nothing else of them is changed. Where a
network is too large for a CPU, or its package has no wheel, STAND_INS has a small one with the same calls.
"""

import argparse
import runpy
import shutil
import sys
import types
from pathlib import Path

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
    """Define the operators that torchvision's wheel has for CUDA only."""
    library = torch.library.Library("torchvision", "DEF")
    library.define("nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
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
    """Mask2Former of mmdet sees floor everywhere."""

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


SERVERS = {
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
    sys.argv = [script, "--port", str(arguments.port), *words]
    runpy.run_path(script, run_name="__main__")
    del torchvision


if __name__ == "__main__":
    main()
