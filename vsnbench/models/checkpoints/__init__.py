"""What models with neural networks share: finding, hashing and loading weights safely, runtimes, and layers."""
