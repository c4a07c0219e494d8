"""Object detectors: Mask R-CNN, ONNX files of the same form, and a simulated detector."""
