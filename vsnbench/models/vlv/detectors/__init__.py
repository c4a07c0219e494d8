"""Object detectors behind one contract: Mask R-CNN, any ONNX file of the same form, and the simulator's own."""
