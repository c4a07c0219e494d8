"""Stand-in for Uni-NaVid's agent: the same class, attributes and answers, without the network.

Written from the file of this name in Uni-NaVid (jzhzhang/Uni-NaVid, commit 64444eb). Each prediction consumes
`rgb_list`; the third one is `stop`.
"""


class UniNaVid_Agent:  # noqa: N801 - upstream's name
    def __init__(self, model_path):
        self.rgb_list = []
        self.videos = []
        self.reset()

    def reset(self, task_type="vln"):
        self.rgb_list, self.videos = [], []

    def act(self, data):
        assert isinstance(data["instruction"], str)
        self.rgb_list.append(data["observations"])
        assert all(image.ndim == 3 and image.dtype == "uint8" for image in self.rgb_list)
        self.videos.append(len(self.rgb_list))
        self.rgb_list = []
        actions = ["forward", "left", "forward", "right"] if len(self.videos) < 3 else ["stop"]
        return {"step": len(self.videos), "path": [[[0.0, 0.0, 0.0]]], "actions": actions}
