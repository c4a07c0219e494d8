"""Values of a trial: action, observation, decision, pose, camera, step."""
