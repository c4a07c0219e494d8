"""Stand-in for habitat_baselines.common.tensor_dict, as VLFM's policies use it."""


class TensorDict(dict):
    def to_tree(self):
        return dict(self)
