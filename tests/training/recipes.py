"""A recipe so small that a whole run takes seconds; it learns nothing."""

from training.recipe import Recipe

TINY = Recipe.model_validate(
    {
        "name": "tiny",
        "network": {
            "image_size_px": 64,
            "base_planes": 2,
            "visual_size": 16,
            "hidden_size": 16,
            "recurrent_layers": 1,
        },
        "demonstrations": {
            "flats": 2,
            "dagger_flats": 1,
            "dagger_rounds": 1,
            "episodes": 4,
            "dagger_episodes": 4,
            "lanes": 4,
            "max_actions": 30,
        },
        "seeing": {"updates": 4, "batch": 4},
        "calibration": {"stop_biases": [0.0, -2.0], "flats": 1, "episodes": 2},
        "cloning": {"updates": [12], "lanes": 2, "steps": 8},
        "validation": {"flats": 1, "episodes": 2, "every_updates": 1000},
        "save_every_updates": 2,
    }
)
