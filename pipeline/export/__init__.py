"""Export of a trained policy: ONNX, TorchScript, booster_deploy task folder, golden vectors, model card."""
