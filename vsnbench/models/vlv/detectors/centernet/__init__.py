"""COCO detector from an npm package: CenterNet with MobileNetV3, converted from TensorFlow.js to ONNX."""
