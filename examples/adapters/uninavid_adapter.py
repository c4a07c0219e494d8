"""Uni-NaVid as a model: follows instructions, and predicts up to four actions at a time.

Put this file and vsnbench_policy.py next to Uni-NaVid's offline_eval_uninavid.py, in its environment:

    python vsnbench_policy.py uninavid_adapter:UniNaVid --settings uninavid.json --port 8765
    vsnbench run --model ws://gpu-box:8765 --site examples/goals.yaml --goal past-the-sofa

uninavid.json: {"model_path": "model_zoo/uninavid-7b-full-224-video-fps-1-grid-2"}.
"""

import importlib

WORDS = {"forward": "MOVE_FORWARD", "left": "TURN_LEFT", "right": "TURN_RIGHT", "stop": "STOP"}


class UniNaVid:
    """Executes the predicted actions one at a time, so that the model sees the image after each of them."""

    def __init__(
        self,
        model_path,
        module="offline_eval_uninavid",
        at_once=2,
        chunk=False,
        category_as="Search for a {}.",
        weights_label="",
    ):
        """Load the model.

        Args:
            model_path: directory of the checkpoint.
            module: upstream's module with the class `UniNaVid_Agent`.
            at_once: number of predicted actions that are executed before the model predicts again, 1 to 4.
            chunk: send the actions as a chunk. The model then sees no image between them.
            category_as: instruction for a goal that is a category.
            weights_label: description of the checkpoint.
        """
        if not 1 <= at_once <= 4:
            raise ValueError("at_once must be 1 to 4")
        self.agent = importlib.import_module(module).UniNaVid_Agent(model_path)
        self.at_once, self.chunk, self.category_as = at_once, chunk, category_as
        self.card = {
            "name": "uninavid",
            "sensors": ["rgb"],
            "goal_kinds": ["instruction", "text", "category"],
            "action_kinds": ["discrete", "chunk"] if chunk else ["discrete"],
            # The camera and the steps of upstream's evaluation (jzhzhang/NaVid-VLN-CE at commit cf066cc,
            # VLN_CE/habitat_extensions/config/vlnce_task_navid_r2r.yaml:7-17).
            "camera": {"mount_height_m": 1.25, "tilt_deg": 0, "horizontal_fov_deg": 90, "width": 640, "height": 480},
            "forward_m": 0.25,
            "turn_deg": 30.0,
            "weights_label": weights_label or str(model_path),
            "settings": {"at_once": at_once, "chunk": chunk, "category_as": category_as},
            "deterministic": False,  # upstream samples, in half precision
        }
        self.instruction, self.left = "", []

    def reset(self, goal, seed):
        """Start an episode with an empty video."""
        torch = importlib.import_module("torch")
        torch.manual_seed(seed)
        is_category = getattr(goal, "kind", "category") == "category"
        text = getattr(goal, "text", "") or str(goal)
        self.instruction = self.category_as.format(text) if is_category else text
        self.left = []
        self.agent.reset()

    def act(self, observation):
        """Return the next action."""
        if self.left:
            self.agent.rgb_list.append(observation.rgb)  # part of the video of the next prediction
            return self._next(self.left)
        answer = self.agent.act({"instruction": self.instruction, "observations": observation.rgb})
        words = [word.strip(".,").lower() for word in answer["actions"] if word.strip(".,")]
        unknown = sorted(set(words) - set(WORDS))
        if unknown or not words:
            raise ValueError("Uni-NaVid answered {!r:.200}".format(" ".join(answer["actions"])))
        actions = [WORDS[word] for word in words[: self.at_once]]
        if self.chunk:
            return {"parts": actions, "raw_action": " ".join(words)}
        return dict(self._next(actions), raw_action=" ".join(words))

    def _next(self, actions):
        first, self.left = actions[0], actions[1:]
        return {"action": first, "diagnostics": {"note": " ".join(self.left)}}
