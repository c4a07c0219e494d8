class RealWorld_Env:  # noqa: N801 - upstream's name
    def __init__(self, args):
        self.args = args
        self.episode_over = False
        self.current_episode = None

    def reset(self):
        return self.get_observation()
