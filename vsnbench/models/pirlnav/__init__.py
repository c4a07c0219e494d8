"""PIRLNav (Ramrakhya et al., CVPR 2023): the paper's end-to-end model, from the authors' own checkpoints."""
