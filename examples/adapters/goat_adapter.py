"""SenseAct-NN of GOAT-Bench as a model: a sequence of categories, words and photographs, with its memory kept.

Put this file and vsnbench_policy.py into GOAT-Bench's environment (its packages `goat_bench` and `clip`):

    python vsnbench_policy.py goat_adapter:SenseActNN --settings goat.json --port 8765
    vsnbench run --model ws://gpu-box:8765 --site examples/goals.yaml --goal chair-first

goat.json: {"checkpoint": "data/goat-assets/checkpoints/sense_act_nn_monolithic/ckpt.pth"}. The values of the class are
those of config/experiments/ver_goat_monolithic.yaml and config/tasks/goat_stretch_hm3d.yaml. Lines of upstream are
those of Ram81/goat-bench at commit 74c41d1.
"""

import importlib

import numpy as np

ACTIONS = {
    0: ("STOP", "stop"),
    1: ("MOVE_FORWARD", "move_forward"),
    2: ("TURN_LEFT", "turn_left"),
    3: ("TURN_RIGHT", "turn_right"),
    4: ("NOOP", "look_up"),
    5: ("NOOP", "look_down"),
    6: ("STOP", "subtask_stop"),
}
"""Actions by upstream's numbers (config/tasks/goat_stretch_hm3d.yaml:7-14). A robot's camera does not tilt; `stop`,
which ends upstream's episode, ends the leg here as `subtask_stop` does."""
SIZE = 224
"""Upstream squeezes its image to a square, by the mean of areas, before the network sees it (`Resize`)."""


class SenseActNN:
    """The monolithic policy. Goals become CLIP embeddings, as upstream computes them before its evaluation."""

    def __init__(self, checkpoint, device="cuda", weights_label=""):
        """Load the policy.

        Args:
            checkpoint: file of upstream's trainer.
            device: device of the networks.
            weights_label: description of the checkpoint.
        """
        self.torch = torch = importlib.import_module("torch")
        spaces = importlib.import_module("gym.spaces")
        saved = torch.load(str(checkpoint), map_location="cpu")["state_dict"]
        state = {
            name[len("actor_critic.") :]: value for name, value in saved.items() if name.startswith("actor_critic.")
        }
        box = spaces.Box
        seen = {
            "rgb": box(0, 255, (SIZE, SIZE, 3), np.uint8),
            "goat_subtask_goal": box(-np.inf, np.inf, (1024,), np.float32),
            "compass": box(-np.pi, np.pi, (1,), np.float32),
            "gps": box(-np.inf, np.inf, (2,), np.float32),
        }
        self.policy = importlib.import_module("goat_bench.models.clip_policy").GOATPolicy(
            observation_space=spaces.Dict(seen),
            action_space=spaces.Discrete(len(ACTIONS)),
            hidden_size=512,
            num_recurrent_layers=2,
            rnn_type="LSTM",
            backbone="resnet50_clip_avgpool",
            add_clip_linear_projection="net.goat_embeeding.weight" in state,  # spelt as upstream's attribute
        )
        self.policy.load_state_dict(state)
        self.policy.to(device).eval()
        self.clip = importlib.import_module("clip")
        self.encoder = importlib.import_module("goat_bench.models.encoders.clip").CLIPEncoder(device=device)
        self.resized = importlib.import_module("goat_bench.obs_transformer.resize").image_resize
        self.device = device
        self.card = {
            "name": "senseact-nn",
            "sensors": ["rgb", "odometry"],
            "goal_kinds": ["category", "text", "image", "sequence"],
            "forward_m": 0.25,
            "turn_deg": 30.0,
            "weights_label": weights_label or str(checkpoint),
            # The camera of a Stretch, on its side (config/tasks/goat_stretch_hm3d.yaml:66-71).
            "camera": {"mount_height_m": 1.31, "tilt_deg": 0, "horizontal_fov_deg": 42, "width": 360, "height": 640},
            "deterministic": False,  # samples its actions, in half precision on a GPU
        }
        self.goal = self.hidden = self.previous = self.mask = None

    def reset(self, goal, seed):
        """Start an episode with an empty memory."""
        torch = self.torch
        torch.manual_seed(seed)
        shape = (1, self.policy.net.num_recurrent_layers, 512)
        self.hidden = torch.zeros(shape, device=self.device)
        self.previous = torch.zeros((1, 1), dtype=torch.long, device=self.device)
        self.mask = torch.zeros((1, 1), dtype=torch.bool, device=self.device)
        self.next_goal(goal)

    def next_goal(self, goal):
        """Take the next goal of a sequence, and keep the memory (ppo_trainer_no_2d.py:192-222)."""
        if goal.kind == "image":
            embedding = self.encoder.embed_vision(goal.image)  # encoders/clip.py:28-36
        else:  # cache_clip_embeddings.py:38-75; the sensor looks descriptions up in small letters (sensors.py)
            words = goal.text.lower() if goal.kind == "text" else str(goal)
            with self.torch.no_grad():
                tokens = self.clip.tokenize(words, context_length=77, truncate=True).to(self.device)
                embedding = self.encoder.model.encode_text(tokens)[0].float().cpu().numpy()
        self.goal = np.asarray(embedding, np.float32)

    def act(self, observation):
        """Return the policy's action."""
        torch, pose = self.torch, observation.pose
        seen = {
            "goat_subtask_goal": self.goal,
            "compass": np.array([pose.heading_rad], np.float32),
            "gps": np.array([pose.x_m, -pose.y_m], np.float32),  # Habitat's is (forward, right)
        }
        batch = {name: torch.from_numpy(value)[None].to(self.device) for name, value in seen.items()}
        rgb = torch.from_numpy(np.ascontiguousarray(observation.rgb))[None].to(self.device)
        batch["rgb"] = self.resized(rgb, (SIZE, SIZE), channels_last=True)
        with torch.no_grad():
            found = self.policy.act(batch, self.hidden, self.previous, self.mask, deterministic=False)
        # A tuple in habitat-baselines 0.2.3 (upstream's), an object later.
        actions, self.hidden = (
            (found[1], found[3]) if isinstance(found, tuple) else (found.actions, found.rnn_hidden_states)
        )
        self.previous, self.mask = actions.clone(), torch.ones_like(self.mask)
        action, raw = ACTIONS[int(actions.flatten()[0])]
        return {"action": action, "raw_action": raw}
