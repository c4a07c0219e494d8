"""From a request to a robot and a model that are ready for trials."""
