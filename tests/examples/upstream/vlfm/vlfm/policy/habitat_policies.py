"""Stand-in for VLFM's Habitat policy: the same arguments, observations and answers, without detectors.

Written from bdaiinstitute/vlfm (commit 584ed56), vlfm/policy/habitat_policies.py and base_objectnav_policy.py: it reads
what they read. It turns once around, as upstream's does, and drives on; the 15th action is STOP.
"""

from types import SimpleNamespace

import torch


class HabitatITMPolicyV2:
    def __init__(self, camera_height, min_depth, max_depth, camera_fov, image_width, dataset_type="hm3d", **others):
        assert {"pointnav_policy_path", "depth_image_shape", "text_prompt"} <= set(others)
        assert 0 < camera_height < 2
        assert 0 <= min_depth < max_depth
        self.image_width, self.steps = image_width, 0

    def act(self, observations, rnn_hidden_states, prev_actions, masks, deterministic=False):
        assert masks.shape == (1, 1)
        if masks[0] == 0:
            self.steps = 0
        assert 0 <= observations["objectgoal"][0].item() < 6
        seen = observations.to_tree()
        rgb, depth = seen["rgb"][0].cpu().numpy(), seen["depth"][0].cpu().numpy()
        assert rgb.dtype == "uint8"
        assert rgb.shape == (*depth.shape[:2], 3)
        assert rgb.shape[1] == self.image_width
        assert depth.reshape(depth.shape[:2]).min() >= 0
        assert depth.max() <= 1
        _x, _y = seen["gps"][0].cpu().numpy()
        seen["compass"][0].cpu().item()
        seen["heading"][0].item()
        self.steps += 1
        number = 2 if self.steps <= 12 else 1 if self.steps < 15 else 0
        return SimpleNamespace(actions=torch.tensor([[number]]), rnn_hidden_states=None, policy_info=[{}])
