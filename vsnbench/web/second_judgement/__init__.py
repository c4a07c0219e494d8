"""The page on which a rater judges recorded episodes without the first verdict and the model's name."""
