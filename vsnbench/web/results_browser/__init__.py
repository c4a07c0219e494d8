"""The page that shows a results directory: filters, a grid of trials, and episodes frame by frame."""
