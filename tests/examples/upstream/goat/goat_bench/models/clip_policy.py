"""Stand-in for goat_bench/models/clip_policy.py (Ram81/goat-bench, commit 74c41d1): `GOATPolicy` by a rule.

It refuses what upstream's could not read. It goes forward once for each goal that it remembers, looks up, and stops.
"""

from types import SimpleNamespace

import torch


class GOATPolicy:
    def __init__(self, observation_space, action_space, hidden_size, num_recurrent_layers, **settings):
        assert observation_space == {
            "rgb": (224, 224, 3),
            "goat_subtask_goal": (1024,),
            "compass": (1,),
            "gps": (2,),
        }
        assert action_space == 7
        assert settings == {
            "rnn_type": "LSTM",
            "backbone": "resnet50_clip_avgpool",
            "add_clip_linear_projection": True,
        }
        self.net = SimpleNamespace(num_recurrent_layers=2 * num_recurrent_layers)  # an LSTM has two states

    def load_state_dict(self, state):
        assert set(state) == {"net.goat_embeeding.weight"}

    def to(self, device):
        return self

    def eval(self):
        return self

    def act(self, observations, hidden, previous, mask, deterministic):
        assert {name: tuple(value.shape) for name, value in observations.items()} == {
            "rgb": (1, 224, 224, 3),
            "goat_subtask_goal": (1, 1024),
            "compass": (1, 1),
            "gps": (1, 2),
        }
        assert hidden.shape == (1, 4, 512)
        assert not deterministic
        goals, moves, last = (int(value) for value in hidden[0, 0, :3])
        assert mask.item() == (goals > 0)
        if last in (0, 6):
            goals, moves, last = goals + 1, 0, 1
        elif last == 1 and moves >= goals:
            last = 4
        elif last == 4:
            last = 6
        moves += last == 1
        hidden = hidden.clone()
        hidden[0, 0, :3] = torch.tensor([goals, moves, last])
        return torch.zeros(1), torch.tensor([[last]]), torch.zeros(1), hidden
