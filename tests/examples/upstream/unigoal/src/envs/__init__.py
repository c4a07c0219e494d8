def construct_envs(args):
    raise AssertionError("upstream makes an environment of Habitat here")
